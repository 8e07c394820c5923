"""What is no mistake: another step or integrator, which changes a motion's error alone."""

from __future__ import annotations

from collections.abc import Iterator

from harness.mutation.mistakes.context import Subject
from harness.mutation.mistakes.mistake import Edit, Mistake


def steps(subject: Subject) -> Iterator[Mistake]:
    """Twice the step; in MuJoCo another integrator.

    Not with equalities: their limits are resolved with Euler alone.
    """
    step = 2 * subject.model.step
    edit = Edit(settings={"step": step})
    yield Mistake("another time step", f"step {step:g} s", edit, sound=True)
    if subject.task.engine == "mujoco" and not getattr(subject.model, "remedies", {}):
        other = "Euler" if subject.model.integrator == "rk4" else "RK4"
        edit = Edit(settings={"integrator": other})
        yield Mistake("another integrator", other, edit, sound=True)
