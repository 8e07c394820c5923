"""What `--vary` may say: a constant over a range, or at some values."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

ANY, TIMES = "*", "x"


class SweepError(ValueError):
    """A sweep that can't be planned; the message names what, where and the remedy."""


@dataclass(frozen=True, kw_only=True)
class Factor:
    """A constant that is varied.

    Attributes:
        name: of the constant; a `*` in it stands for anything.
        low, high: ends of its range; equal to the least and the largest of `values`.
        log: whether it is spread evenly in its logarithm.
        values: the only ones that it takes; empty: the whole range.
        relative: whether all of these are multiples of what is declared.
    """

    name: str
    low: float
    high: float
    log: bool = False
    values: tuple[float, ...] = ()
    relative: bool = False

    def of(self, constants: Mapping[str, float]) -> tuple[Factor, ...]:
        """A factor for each constant that is meant, in what it is declared in; none is at nought.

        A multiple of nought is no range: by a pattern such constants stay as they are.

        Raises:
            SweepError: where it is named itself.
        """
        pattern = re.compile(".*".join(map(re.escape, self.name.split(ANY))), re.DOTALL)
        found = []
        for name, declared in constants.items():
            if not pattern.fullmatch(name):
                continue
            if self.relative and not declared:
                if ANY in self.name:
                    continue
                raise SweepError(f"--vary {name}: it is 0, and so are all its multiples")
            found.append(self._named(name, declared if self.relative else 1.0))
        return tuple(found)

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
        """Its value at a share of its range, 0 to 1."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share


def factor(text: str) -> Factor:
    """Read NAME=LOW:HIGH, NAME=LOW:HIGH:log or NAME=V1,V2,...; `x0.8:x1.25` are multiples.

    Raises:
        SweepError: naming what can't be read.
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
    """Read them all.

    Raises:
        SweepError: for a name that comes twice, too.
    """
    found = tuple(map(factor, texts))
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise SweepError(f"--vary {name}: it is varied twice; keep one")
    return found


def meant(factors: Sequence[Factor], constants: Mapping[str, float]) -> tuple[Factor, ...]:
    """What is varied of some constants, each by one factor.

    Raises:
        SweepError: where two mean one constant, or a range is none for it.
    """
    found = [made for one in factors for made in one.of(constants)]
    names = [made.name for made in found]
    for name in names:
        if names.count(name) > 1:
            raise SweepError(f"--vary {name}: two options mean it; keep one")
    return tuple(found)


def _numbers(parts: Sequence[str], text: str) -> tuple[tuple[float, ...], bool]:
    """Numbers, and whether they are multiples."""
    times = [part.strip().startswith(TIMES) for part in parts]
    if len(set(times)) > 1:
        raise SweepError(f"--vary {text}: either all of its numbers have {TIMES!r} before, or none")
    found = tuple(_number(part.strip().removeprefix(TIMES), text) for part in parts)
    return found, times[0]


def _number(part: str, text: str) -> float:
    try:
        value = float(part)
    except ValueError:
        raise SweepError(f"--vary {text}: {part!r} is not a number") from None
    if not math.isfinite(value):
        raise SweepError(f"--vary {text}: {part!r} is not a finite number")
    return value
