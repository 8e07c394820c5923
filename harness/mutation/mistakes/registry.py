"""All families of mistakes, in their order in reports."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from physics_crosscheck.harness.mutation.mistakes.axes import axes
from physics_crosscheck.harness.mutation.mistakes.bases import bases
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.defaults import defaults
from physics_crosscheck.harness.mutation.mistakes.degrees import degrees
from physics_crosscheck.harness.mutation.mistakes.exchanges import exchanges
from physics_crosscheck.harness.mutation.mistakes.gravity import gravity
from physics_crosscheck.harness.mutation.mistakes.left_in import left_in
from physics_crosscheck.harness.mutation.mistakes.left_out import left_out
from physics_crosscheck.harness.mutation.mistakes.mistake import Mistake
from physics_crosscheck.harness.mutation.mistakes.rests import rests
from physics_crosscheck.harness.mutation.mistakes.steps import steps

FAMILIES: tuple[Callable[[Subject], Iterator[Mistake]], ...] = (
    axes, bases, gravity, exchanges, rests, degrees, left_in, left_out, defaults, steps,
)  # fmt: skip


def known_mistakes(subject: Subject) -> tuple[Mistake, ...]:
    """Return every known mistake that fits a model."""
    return tuple(mistake for family in FAMILIES for mistake in family(subject))
