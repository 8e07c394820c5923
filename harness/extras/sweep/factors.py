"""Values of `--vary`: a constant over a range, or at some values."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

ANY, TIMES = "*", "x"


class SweepError(ValueError):
    """An error in planning a sweep; the message gives the problem, the place and the remedy."""


@dataclass(frozen=True, kw_only=True)
class Factor:
    """A varied constant.

    Attributes:
        name: name of the constant; `*` matches any text.
        low, high: ends of its range; the minimum and maximum of `values`.
        log: whether it is uniform in its logarithm.
        values: its only values; empty: the whole range.
        relative: whether all of these are multiples of the declared value.
    """

    name: str
    low: float
    high: float
    log: bool = False
    values: tuple[float, ...] = ()
    relative: bool = False

    def for_constants(self, constants: Mapping[str, float]) -> tuple[Factor, ...]:
        """Return a factor for each matching constant, in declared units; none for zero constants.

        A multiple of zero is not a range: a pattern leaves such constants unchanged.

        Raises:
            SweepError: if the name itself is of a zero constant.
        """
        pattern = re.compile(".*".join(map(re.escape, self.name.split(ANY))), re.DOTALL)
        matching = []
        for name, declared in constants.items():
            if not pattern.fullmatch(name):
                continue
            if self.relative and not declared:
                if ANY in self.name:
                    continue
                raise SweepError(f"--vary {name}: it is 0, and so are all its multiples")
            matching.append(self._named(name, declared if self.relative else 1.0))
        return tuple(matching)

    def _named(self, name: str, unit: float) -> Factor:
        low, high = sorted((self.low * unit, self.high * unit))
        if self.log and low <= 0:
            raise SweepError(
                f"--vary {name}: it is below zero, and a logarithm needs values above; leave out"
                " `:log`"
            )
        values = tuple(value * unit for value in self.values)
        return Factor(name=name, low=low, high=high, log=self.log, values=values)

    def value(self, share: float) -> float:
        """Return the value at a share of the range, 0 to 1."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share


def factor(text: str) -> Factor:
    """Parse NAME=LOW:HIGH, NAME=LOW:HIGH:log or NAME=V1,V2,...; `x0.8:x1.25` are multiples.

    Raises:
        SweepError: naming the invalid part.
    """
    name, sign, given = text.rpartition("=")
    name, given = name.strip(), given.strip()
    if not (sign and name and given):
        raise SweepError(f"--vary {text}: write NAME=LOW:HIGH, NAME=LOW:HIGH:log or NAME=V1,V2")
    if ":" not in given:
        values, relative = _numbers(given.split(","), text)
        if len(set(values)) < len(values):
            raise SweepError(f"--vary {text}: it names a value twice; keep one")
        return Factor(
            name=name, low=min(values), high=max(values), values=values, relative=relative
        )
    parts = given.split(":")
    log = len(parts) == 3 and parts[2] == "log"
    if len(parts) > 2 and not log:
        raise SweepError(f"--vary {text}: after LOW:HIGH only `:log` may follow")
    (low, high), relative = _numbers(parts[:2], text)
    if not low < high:
        raise SweepError(f"--vary {text}: {low:g} is not below {high:g}, so the range is empty")
    if log and low <= 0:
        raise SweepError(f"--vary {text}: a logarithm needs values above zero; leave out `:log`")
    return Factor(name=name, low=low, high=high, log=log, relative=relative)


def factors(texts: Sequence[str]) -> tuple[Factor, ...]:
    """Parse all factors.

    Raises:
        SweepError: for an invalid factor or a duplicate name.
    """
    parsed = tuple(map(factor, texts))
    names = [one.name for one in parsed]
    for name in names:
        if names.count(name) > 1:
            raise SweepError(f"--vary {name}: it is varied twice; keep one")
    return parsed


def matching_factors(
    factors: Sequence[Factor], constants: Mapping[str, float]
) -> tuple[Factor, ...]:
    """Return the factors of constants that exist, one per constant.

    Raises:
        SweepError: if two factors match one constant, or a range is invalid for it.
    """
    matching = [made for one in factors for made in one.for_constants(constants)]
    names = [made.name for made in matching]
    for name in names:
        if names.count(name) > 1:
            raise SweepError(f"--vary {name}: two options mean it; keep one")
    return tuple(matching)


def _numbers(parts: Sequence[str], text: str) -> tuple[tuple[float, ...], bool]:
    """Parse numbers, and return whether they are multiples."""
    times = [part.strip().startswith(TIMES) for part in parts]
    if len(set(times)) > 1:
        raise SweepError(f"--vary {text}: either all of its numbers have {TIMES!r} before, or none")
    numbers = tuple(_number(part.strip().removeprefix(TIMES), text) for part in parts)
    return numbers, times[0]


def _number(part: str, text: str) -> float:
    try:
        value = float(part)
    except ValueError:
        raise SweepError(f"--vary {text}: {part!r} is not a number") from None
    if not math.isfinite(value):
        raise SweepError(f"--vary {text}: {part!r} is not a finite number")
    return value
