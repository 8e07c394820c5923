"""Checks of forces that are held over each step, and of the limit of small steps."""

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.conformance.subject import (
    BATCH,
    EVERY,
    STEPS,
    ConformanceSubject,
    Loaded,
    alike,
    ask,
)
from physics_crosscheck.harness.engines.protocol import StateForce

ORDER_STEPS = (16, 32, 64, 128)
"""Step counts of a short motion from which its order is observed."""

ORDER_SPAN = 12.0
"""Length of that motion, in the file's own time steps."""


def a_force_acts_in_its_own_step(subject: ConformanceSubject) -> None:
    """Require that a force acts in its own step only, and at once in the velocity."""
    loaded = subject.load()
    free = loaded.free(STEPS, 1)
    driven = False
    for coordinate in range(loaded.size):
        force = np.zeros((BATCH, STEPS, loaded.size))
        force[:, 5, coordinate] = 0.01
        z, w = loaded.run(loaded.states(), STEPS, force, 1)
        before = (z[:, :5], w[:, :5]), (free[0][:, :5], free[1][:, :5])
        ask(alike(*before), "a force acts before the step that it is given for")
        moved = (w - free[1])[:, 5:, coordinate]
        name = loaded.model.coordinates[coordinate]
        if not np.any(moved):
            continue  # a body too heavy to turn
        driven = True
        ask(bool(np.all(moved[:, 0] > 0)), f"a force on {name} doesn't act in its own step")
        kept = np.abs(moved[:, 1]) < 1.5 * np.abs(moved[:, 0])
        ask(bool(np.all(kept)), f"a force on {name} acts again in the step after its own")
    ask(driven, "no force moves it")


def impulses_are_in_proportion(subject: ConformanceSubject) -> None:
    """Require that twice the force over a step changes the velocity by twice as much."""
    loaded = subject.load()
    force = loaded.pushes(1)
    still, once, twice = (
        loaded.run(loaded.states(), 1, share * force, 1)[1] for share in (0.0, 1.0, 2.0)
    )
    change, error = once - still, np.abs(twice - still - 2 * (once - still))
    rounding = 1e3 * loaded.model.epsilon * (np.abs(still).max() + np.abs(change).max())
    allowed = 1e-3 * np.abs(change).max() + rounding
    ask(bool(np.all(error <= allowed)), "twice the force doesn't change velocities twice as much")


def a_force_by_state_is_the_same_force(subject: ConformanceSubject) -> None:
    """Require that a `StateForce` that copies its inputs gives the same motion as an array."""
    loaded = subject.load()
    given = StateForce(loaded.pushes(STEPS), lambda _, u: tuple(u))
    motion = loaded.run(loaded.states(), STEPS, given, EVERY)
    error = max(
        float(np.max(np.abs(a - b)))
        for a, b in zip(motion, loaded.pushed(every=EVERY), strict=True)
    )
    allowed = 1e3 * loaded.model.epsilon * max(1.0, *(float(np.abs(a).max()) for a in motion))
    ask(error <= allowed, f"the same forces, given as a map, change the motion by {error:.1e}")


def a_force_by_state_sees_the_start_of_its_step(subject: ConformanceSubject) -> None:
    """Require one call of a `StateForce` map per step, with the positions at its start."""
    loaded = subject.load()
    q, v = (values[:1] for values in loaded.states())
    seen: list[list[float]] = []

    def record(z: Sequence[float], _: Sequence[float]) -> list[float]:
        seen.append([float(x) for x in z])
        return [0.0] * loaded.size

    given = StateForce(np.zeros((1, STEPS, 1)), record)
    z, _ = loaded.run((q, v), STEPS, given, 1)
    ask(len(seen) == STEPS, f"its map was called {len(seen)} times in {STEPS} steps")
    passed = np.concatenate([q, z[0, :-1]])
    error = float(np.max(np.abs(np.array(seen) - passed)))
    allowed = 10 * loaded.model.epsilon * max(1.0, float(np.abs(passed).max()))
    ask(
        error <= allowed,
        f"its map gets states that differ by {error:.1e} from those at the start of a step",
    )


def orders_are_as_claimed(subject: ConformanceSubject) -> None:
    """Require the order that `exponents` claims, without force and with a varying input."""
    loaded = subject.load()
    for varying in (False, True):
        claimed = loaded.model.exponents(varying)[0]
        observed = _order(loaded, varying)
        if observed is not None:
            kind = "under an input that varies" if varying else "of a free motion"
            ask(
                abs(observed - claimed) < 0.35, f"the order {kind} is {observed:.2f}, not {claimed}"
            )


def accelerations_are_those_of_small_steps(subject: ConformanceSubject) -> None:
    """Require that `accelerations` equals the change of velocity over a small step, under a
    force.
    """
    loaded = subject.load()
    model, v = loaded.model, loaded.states()[1]
    # At home the rates of rotation coordinates are angular velocities.
    q, force = np.tile(model.home, (BATCH, 1)), loaded.pushes(1)
    stated = model.accelerations(q, v, force[:, 0])
    if stated is None:
        return
    ask(stated.shape == v.shape, f"accelerations have shape {stated.shape}; expected {v.shape}")
    h = loaded.h / 8
    coarse, fine = ((loaded.run((q, v), 1, force, 1, one)[1][:, 0] - v) / one for one in (h, h / 2))
    finite = np.isfinite(stated).all(axis=1)
    error = np.abs(stated - (2 * fine - coarse))[finite].max(initial=0.0)
    rounding = 1e3 * model.epsilon * (np.abs(v).max() / h + np.abs(coarse).max())
    allowed = np.abs(fine - coarse).max() + rounding
    ask(
        error <= allowed,
        f"its accelerations differ by {error:.1e} from the change of its velocities",
    )


def _order(loaded: Loaded, varying: bool) -> float | None:
    """Return the order observed from the last three step counts; None if only rounding is
    visible.
    """
    span = ORDER_SPAN * loaded.h
    ends = []
    for n in ORDER_STEPS:
        t = np.arange(n) / n
        force = 2.0 * np.cos(3 * t)[None, :, None] * np.ones((BATCH, 1, loaded.size))
        given = force if varying else None
        z, w = loaded.run(loaded.states(), n, given, n, span / n)
        ends.append(np.concatenate([z, w], axis=2)[:, 0])
    steps = np.abs(np.diff(ends, axis=0))
    scale = np.abs(ends[-1]).max()
    # The component whose error is largest above rounding.
    rounding = 30 * loaded.model.epsilon * scale * np.sqrt(ORDER_STEPS[-1]) / span
    seen = steps[1:].min(axis=0)
    best = np.unravel_index(np.argmax(seen), seen.shape)
    if seen[best] < 30 * rounding:
        return None
    return float(np.log2(steps[1][best] / steps[2][best]))
