"""All families, in the order in which they are told."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from harness.mistakes.axes import axes
from harness.mistakes.defaults import defaults
from harness.mistakes.degrees import degrees
from harness.mistakes.exchanges import exchanges
from harness.mistakes.gravity import gravity
from harness.mistakes.left_in import left_in
from harness.mistakes.mistake import Mistake
from harness.mistakes.rests import rests
from harness.mistakes.soft import soft
from harness.mistakes.steps import steps
from harness.mistakes.subject import Subject

FAMILIES: tuple[Callable[[Subject], Iterator[Mistake]], ...] = (
    axes, gravity, exchanges, rests, degrees, left_in, soft, defaults, steps,
)  # fmt: skip


def known_mistakes(subject: Subject) -> tuple[Mistake, ...]:
    """Every known mistake that this model has a place for."""
    return tuple(mistake for family in FAMILIES for mistake in family(subject))
