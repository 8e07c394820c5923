"""What `--vary` may say: a constant over a range, or at some values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


class SweepError(ValueError):
    """A sweep that can't be planned; the message names what, where and the remedy."""


@dataclass(frozen=True, kw_only=True)
class Factor:
    """A constant that is varied.

    Attributes:
        name: of the constant.
        low, high: ends of its range; equal to the least and the largest of `values`.
        log: whether it is spread evenly in its logarithm.
        values: the only ones that it takes; empty: the whole range.
    """

    name: str
    low: float
    high: float
    log: bool = False
    values: tuple[float, ...] = ()

    def value(self, share: float) -> float:
        """Its value at a share of its range, 0 to 1."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share


def factor(text: str) -> Factor:
    """Read NAME=LOW:HIGH, NAME=LOW:HIGH:log or NAME=V1,V2,...

    Raises:
        SweepError: naming what can't be read.
    """
    name, sign, given = text.rpartition("=")
    name, given = name.strip(), given.strip()
    if not (sign and name and given):
        raise SweepError(f"--vary {text}: say NAME=LOW:HIGH, NAME=LOW:HIGH:log or NAME=V1,V2")
    if ":" not in given:
        values = tuple(_number(part, text) for part in given.split(","))
        if len(set(values)) < len(values):
            raise SweepError(f"--vary {text}: it names a value twice; keep one")
        return Factor(name=name, low=min(values), high=max(values), values=values)
    parts = given.split(":")
    log = len(parts) == 3 and parts[2] == "log"
    if len(parts) > 2 and not log:
        raise SweepError(f"--vary {text}: after LOW:HIGH only `:log` may follow")
    low, high = (_number(part, text) for part in parts[:2])
    if not low < high:
        raise SweepError(f"--vary {text}: {low:g} is not below {high:g}, so this is no range")
    if log and low <= 0:
        raise SweepError(f"--vary {text}: a logarithm needs values above zero; leave out `:log`")
    return Factor(name=name, low=low, high=high, log=log)


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


def _number(part: str, text: str) -> float:
    try:
        value = float(part)
    except ValueError:
        raise SweepError(f"--vary {text}: {part!r} is no number") from None
    if not math.isfinite(value):
        raise SweepError(f"--vary {text}: {part!r} is no finite number")
    return value
