"""Checks of rollouts: their shapes, and that they depend on their arguments only."""

import numpy as np

from physics_crosscheck.harness.engines.conformance.subject import (
    BATCH,
    EVERY,
    STEPS,
    ConformanceSubject,
    Motion,
    alike,
    ask,
)


def rollouts_have_their_shape(subject: ConformanceSubject) -> None:
    """Require positions and velocities of shape (B, n // every, nz), in double precision."""
    loaded = subject.load()
    for n, every in ((STEPS, EVERY), (STEPS, STEPS), (STEPS, 1), (1, 1)):
        for values in loaded.free(n, every):
            wanted = BATCH, n // every, loaded.size
            ask(values.shape == wanted, f"a rollout has shape {values.shape}; expected {wanted}")
            ask(values.dtype == np.float64, f"its numbers are {values.dtype}, not float64")


def every_gives_the_ends_of_shorter_rollouts(subject: ConformanceSubject) -> None:
    """Require that samples by `every` are bitwise the ends of shorter rollouts."""
    loaded = subject.load()
    sampled = loaded.free(STEPS, EVERY)
    for row, n in enumerate(range(EVERY, STEPS + 1, EVERY)):
        part = sampled[0][:, row : row + 1], sampled[1][:, row : row + 1]
        ask(alike(loaded.free(n), part), f"the sample after {n} steps differs from {n} steps")


def arguments_are_left_alone(subject: ConformanceSubject) -> None:
    """Require that a rollout does not change the arrays that it receives."""
    loaded = subject.load()
    (q, v), force = loaded.states(), loaded.pushes(STEPS)
    kept = q.copy(), v.copy(), force.copy()
    loaded.model.rollout(q, v, loaded.h, STEPS, force, STEPS)
    for name, old, new in zip(("q", "v", "force"), kept, (q, v, force), strict=True):
        ask(np.array_equal(old, new), f"a rollout has changed the {name} that it was given")


def results_are_the_callers(subject: ConformanceSubject) -> None:
    """Require that a later rollout does not change an earlier result."""
    loaded = subject.load()
    first = loaded.model.rollout(*loaded.states(), loaded.h, STEPS, None, STEPS)
    kept = first[0].copy(), first[1].copy()
    loaded.free(h=loaded.h / 3)
    ask(alike(first, kept), "a later rollout has changed what an earlier one returned")


def a_rollout_repeats_bitwise(subject: ConformanceSubject) -> None:
    """Require that the same call gives the same bits, at once and after other calls."""
    loaded = subject.load()
    first = loaded.pushed()
    ask(alike(loaded.pushed(), first), "the same call gives a different motion the second time")


def an_earlier_step_leaves_no_trace(subject: ConformanceSubject) -> None:
    """Require that a rollout with another step does not change the next one."""
    loaded = subject.load()
    first = loaded.free()
    loaded.free(n=2, h=7 * loaded.h)
    ask(alike(loaded.free(), first), "a rollout with another step has changed the next one")


def an_earlier_force_leaves_no_trace(subject: ConformanceSubject) -> None:
    """Require that a free rollout after a pushed one is free."""
    loaded = subject.load()
    first = loaded.free()
    loaded.pushed()
    ask(alike(loaded.free(), first), "a force of an earlier rollout acts in a free one")


def a_batch_is_its_rows_one_by_one(subject: ConformanceSubject) -> None:
    """Require that a state's motion does not depend on the rest of the batch or its order."""
    loaded = subject.load()
    (q, v), force = loaded.states(), loaded.pushes(STEPS)

    def run(rows: list[int]) -> Motion:
        return loaded.run((q[rows], v[rows]), STEPS, force[rows], EVERY)

    whole = run([0, 1, 2])
    for rows in ([2, 0, 1], [0], [1], [2]):
        part = whole[0][rows], whole[1][rows]
        ask(alike(run(rows), part), f"rows {rows} of a batch move differently alone")


def what_is_not_finite_is_returned_so(subject: ConformanceSubject) -> None:
    """Require that a NaN state gives NaN, without a reset or an error."""
    loaded = subject.load()
    q, v = loaded.states()
    q[1] = np.nan
    z, w = loaded.run((q, v), STEPS, None, STEPS)
    finite = np.isfinite(z[1]).all() and np.isfinite(w[1]).all()
    ask(not finite, "a motion from a NaN state returns finite numbers")


def what_is_not_finite_spoils_nothing(subject: ConformanceSubject) -> None:
    """Require that a NaN motion changes neither others of its batch nor later ones."""
    loaded = subject.load()
    first = loaded.free()
    q, v = loaded.states()
    q[1] = np.nan
    z, w = loaded.run((q, v), STEPS, None, STEPS)
    rows = [0, 2]
    unchanged = alike((z[rows], w[rows]), (first[0][rows], first[1][rows]))
    ask(unchanged, "a NaN motion has changed other motions of the batch")
    ask(alike(loaded.free(), first), "a NaN motion has changed later ones")
