"""Values of `--vary`, a constant over a range or at some values, and designs of experiments.

Each design is a function of a seed and a draw's number, so memory never holds more than a table of
the draws. A Latin hypercube is computed at once, with 8 bytes per number. A Sobol sequence
continues from its current position. Each random draw has its own generator.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.reference.mechanism.numeric import Array

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


MAX_SOBOL_DRAWS = 2**30
"""Maximum number of draws of scipy's Sobol sequence."""


class Design(StrEnum):
    """Design of an experiment: how draws cover the ranges."""

    LATIN = "latin"
    SOBOL = "sobol"
    RANDOM = "random"
    ALL = "all"
    """Design with every combination of listed values, used without a number of draws."""


@dataclass(frozen=True, kw_only=True)
class SweepOptions(Options):
    """Options of a sweep, which has the engines, limits and resolution of a run.

    Attributes:
        factors: varied constants.
        design, count, seed: draws.
        steps: time steps, seconds; empty: each model's own.
        integrators, scenarios: names; empty: each model's own, all.
        command: words of the command line, without `--only`.
    """

    factors: tuple[Factor, ...] = ()
    design: Design = Design.LATIN
    count: int | None = None
    seed: int = 0
    steps: tuple[float, ...] = ()
    integrators: tuple[str, ...] = ()
    scenarios: tuple[str, ...] = ()
    jobs: int = 2
    command: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Draws:
    """A number of draws of some factors.

    Attributes:
        factors: varied constants; none: one draw that varies nothing.
        design: the design.
        count: number of draws.
        seed: random seed.
    """

    factors: tuple[Factor, ...]
    design: Design
    count: int
    seed: int

    def point_at(self, draw: int) -> dict[str, float]:
        """Return the values of the varied constants in a draw."""
        if not self.factors:
            return {}
        if self.design is Design.ALL:
            return self._combination(draw)
        shares = self._shares(draw)
        return {one.name: one.value(float(x)) for one, x in zip(self.factors, shares, strict=True)}

    def _combination(self, draw: int) -> dict[str, float]:
        values = {}
        for factor in reversed(self.factors):
            draw, place = divmod(draw, len(factor.values))
            values[factor.name] = factor.values[place]
        return {factor.name: values[factor.name] for factor in self.factors}

    def _shares(self, draw: int) -> Array:
        size = len(self.factors)
        if self.design is Design.RANDOM:
            point: Array = np.random.default_rng([self.seed, draw]).random(size)
            return point
        if self.design is Design.LATIN:
            row: Array = self._table[draw]
            return row
        return self._sobol.point_at(draw)

    @cached_property
    def _table(self) -> Array:
        from scipy.stats import qmc  # takes half a second to import

        sampler = qmc.LatinHypercube(len(self.factors), seed=np.random.default_rng(self.seed))
        table: Array = sampler.random(self.count)
        return table

    @cached_property
    def _sobol(self) -> _Sobol:
        return _Sobol(len(self.factors), self.seed)


class _Sobol:
    """A scrambled Sobol sequence, mostly accessed in order."""

    def __init__(self, size: int, seed: int) -> None:
        from scipy.stats import qmc

        generator = np.random.default_rng(seed)
        self._sampler: Any = qmc.Sobol(size, scramble=True, seed=generator)

    def point_at(self, draw: int) -> Array:
        """Return the point of a number."""
        if draw < self._sampler.num_generated:
            self._sampler.reset()
        if draw > self._sampler.num_generated:
            self._sampler.fast_forward(draw - self._sampler.num_generated)
        point: Array = self._sampler.random(1)[0]
        return point


def draws(factors: Sequence[Factor], design: Design, count: int | None, seed: int) -> Draws:
    """Return the requested draws; without a number, every combination of listed values.

    Raises:
        SweepError: if a range is given without a number of draws.
    """
    if not factors:
        return Draws(factors=(), design=Design.ALL, count=1, seed=seed)
    if count is None:
        for factor in factors:
            if not factor.values:
                raise SweepError(
                    f"--vary {factor.name}: a range has infinitely many values; add --draws N, or"
                    f" list values as in {factor.name}={factor.low:g},{factor.high:g}"
                )
        every = math.prod(len(factor.values) for factor in factors)
        return Draws(factors=tuple(factors), design=Design.ALL, count=every, seed=seed)
    if design is Design.SOBOL and count > MAX_SOBOL_DRAWS:
        raise SweepError(f"--draws {count}: a Sobol sequence has {MAX_SOBOL_DRAWS} points at most")
    return Draws(factors=tuple(factors), design=design, count=count, seed=seed)
