"""Forces that are held over each step, and what small steps come to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.conformance.asked import (
    BATCH,
    EVERY,
    STEPS,
    Asked,
    Loaded,
    alike,
    ask,
)
from physics_crosscheck.harness.engines.protocol import StateForce

ORDER_STEPS = (16, 32, 64, 128)
"""In how many steps a short motion is made to see its order."""

ORDER_SPAN = 12.0
"""Length of that motion, in steps that the file ships with."""


def a_force_acts_in_its_own_step(asked: Asked) -> None:
    """A force is held over one step: not before it, not after, and at once in the velocity."""
    loaded = asked.load()
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


def impulses_are_in_proportion(asked: Asked) -> None:
    """Twice the force over a step changes the velocity by twice as much."""
    loaded = asked.load()
    force = loaded.pushes(1)
    still, once, twice = (
        loaded.run(loaded.states(), 1, share * force, 1)[1] for share in (0.0, 1.0, 2.0)
    )
    change, error = once - still, np.abs(twice - still - 2 * (once - still))
    rounding = 1e3 * loaded.model.epsilon * (np.abs(still).max() + np.abs(change).max())
    allowed = 1e-3 * np.abs(change).max() + rounding
    ask(bool(np.all(error <= allowed)), "twice the force doesn't change velocities twice as much")


def a_force_by_state_is_the_same_force(asked: Asked) -> None:
    """`StateForce` with a map that copies its inputs moves a model as the plain array does."""
    loaded = asked.load()
    given = StateForce(loaded.pushes(STEPS), lambda _, u: tuple(u))
    found = loaded.run(loaded.states(), STEPS, given, EVERY)
    error = max(
        float(np.max(np.abs(a - b))) for a, b in zip(found, loaded.pushed(every=EVERY), strict=True)
    )
    allowed = 1e3 * loaded.model.epsilon * max(1.0, *(float(np.abs(a).max()) for a in found))
    ask(error <= allowed, f"the same forces, given as a map, change the motion by {error:.1e}")


def a_force_by_state_sees_the_start_of_its_step(asked: Asked) -> None:
    """The map of a `StateForce` is asked once a step, with the positions at its start."""
    loaded = asked.load()
    q, v = (values[:1] for values in loaded.states())
    seen: list[list[float]] = []

    def at(z: Sequence[float], _: Sequence[float]) -> list[float]:
        seen.append([float(x) for x in z])
        return [0.0] * loaded.size

    given = StateForce(np.zeros((1, STEPS, 1)), at)
    z, _ = loaded.run((q, v), STEPS, given, 1)
    ask(len(seen) == STEPS, f"its map was called {len(seen)} times in {STEPS} steps")
    passed = np.concatenate([q, z[0, :-1]])
    error = float(np.max(np.abs(np.array(seen) - passed)))
    allowed = 10 * loaded.model.epsilon * max(1.0, float(np.abs(passed).max()))
    ask(
        error <= allowed,
        f"its map gets states that differ by {error:.1e} from those at the start of a step",
    )


def orders_are_as_claimed(asked: Asked) -> None:
    """The error falls with the step as `exponents` says, free and under a varying input."""
    loaded = asked.load()
    for varying in (False, True):
        claimed = loaded.model.exponents(varying)[0]
        found = _order(loaded, varying)
        if found is not None:
            kind = "under an input that varies" if varying else "of a free motion"
            ask(abs(found - claimed) < 0.35, f"the order {kind} is {found:.2f}, not {claimed}")


def accelerations_are_those_of_small_steps(asked: Asked) -> None:
    """What `accelerations` tells, under a force, is how velocities change over a small step."""
    loaded = asked.load()
    model, v = loaded.model, loaded.states()[1]
    # Where it is drawn, the rates of what turns are its velocities.
    q, force = np.tile(model.home, (BATCH, 1)), loaded.pushes(1)
    told = model.accelerations(q, v, force[:, 0])
    if told is None:
        return
    ask(told.shape == v.shape, f"accelerations have shape {told.shape}; expected {v.shape}")
    h = loaded.h / 8
    coarse, fine = ((loaded.run((q, v), 1, force, 1, one)[1][:, 0] - v) / one for one in (h, h / 2))
    known = np.isfinite(told).all(axis=1)
    error = np.abs(told - (2 * fine - coarse))[known].max(initial=0.0)
    rounding = 1e3 * model.epsilon * (np.abs(v).max() / h + np.abs(coarse).max())
    allowed = np.abs(fine - coarse).max() + rounding
    ask(
        error <= allowed,
        f"its accelerations differ by {error:.1e} from the change of its velocities",
    )


def _order(loaded: Loaded, varying: bool) -> float | None:
    """Observed from the last three of the step counts; None where rounding is all there is."""
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
    # The component whose error is seen best above rounding.
    rounding = 30 * loaded.model.epsilon * scale * np.sqrt(ORDER_STEPS[-1]) / span
    seen = steps[1:].min(axis=0)
    best = np.unravel_index(np.argmax(seen), seen.shape)
    if seen[best] < 30 * rounding:
        return None
    return float(np.log2(steps[1][best] / steps[2][best]))
