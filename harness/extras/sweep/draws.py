"""Designs of experiments: the positions of draws in the ranges of the constants.

Each design is a function of a seed and a draw's number, so memory never holds more than a table of
the draws. A Latin hypercube is computed at once, with 8 bytes per number. A Sobol sequence
continues from its current position. Each random draw has its own generator.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.reference.mechanism.numeric import Array
from .factors import Factor, SweepError

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
