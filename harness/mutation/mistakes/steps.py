"""Harmless changes: another time step or integrator, which only changes a motion's error."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake


def steps(subject: Subject) -> Iterator[Mistake]:
    """Yield twice the time step, and every other integrator that suits the model."""
    step = 2 * subject.model.step
    edit = Edit(settings={"step": step})
    yield Mistake("another time step", f"step {step:g} s", edit, sound=True)
    for name, settings in subject.model.integrators.items():
        yield Mistake("another integrator", name, Edit(settings=settings), sound=True)
