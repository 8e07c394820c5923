"""Spaces that do more in a step than pymunk's C code: a subclass's step, callbacks, threads."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ..protocol import EngineError

UNDERNEATH = "pymunk.space", "Space.step"
"""Module and name of pymunk's own step, which a script may replace."""


def has_own_step(space: Any) -> bool:
    """Return whether the C call under `Space.step` would omit something, or run Python functions.

    A callback may request another after the step (`add_post_step_callback`), or change the content
    of the Space, which pymunk postpones until then.
    """
    import pymunk

    step = type(space).step
    springs = (pymunk.DampedSpring, pymunk.DampedRotarySpring)
    return bool(
        "step" in vars(space)
        or (step.__module__, step.__qualname__) != UNDERNEATH
        or space.threaded
        or space._post_step_callbacks
        or space._handlers
        or any(c.pre_solve or c.post_solve for c in space.constraints)
        or any(_has_function(c) for c in space.constraints if isinstance(c, springs))
        or any(_has_functions(body) for body in (*space.bodies, space.static_body))
    )


def _has_function(spring: Any) -> bool:
    functions = (getattr(spring, name, None) for name in ("_force_func", "_torque_func"))
    return any(function is not None for function in functions)


def _has_functions(body: Any) -> bool:
    import pymunk

    plain = pymunk.Body.update_velocity, pymunk.Body.update_position
    return (body.velocity_func, body.position_func) != plain


def step_whole(space: Any, handles: Sequence[Any], h: float, push: Sequence[float] | None) -> None:
    """Take one step of the script, with forces on the named bodies in each of its parts.

    pymunk clears forces after each of its steps, and a script's step may take several.

    Raises:
        EngineError: if forces do not reach the bodies.
    """
    import pymunk

    plain, reached = pymunk.Space.step, False

    def pushed(self: Any, dt: float) -> None:
        nonlocal reached
        if self is space and push is not None:
            reached = True
            _push(handles, push)
        plain(self, dt)

    pymunk.Space.step = pushed
    try:
        space.step(h)
    finally:
        pymunk.Space.step = plain
    if push is not None and not reached:
        raise EngineError(
            "the Space's own step doesn't call pymunk.Space.step; call "
            "super().step(dt) in it, so that inputs can act"
        )


def _push(handles: Sequence[Any], push: Sequence[float]) -> None:
    """Add forces to those that a script has set for this step."""
    from pymunk._chipmunk_cffi import lib

    for j, body in enumerate(handles):
        force = lib.cpBodyGetForce(body)
        lib.cpBodySetForce(body, (force.x + push[3 * j], force.y + push[3 * j + 1]))
        lib.cpBodySetTorque(body, lib.cpBodyGetTorque(body) + push[3 * j + 2])


@contextmanager
def collect_callback_errors() -> Iterator[list[BaseException]]:
    """Collect exceptions of callbacks in this block, which the C code in between discards."""
    raised: list[BaseException] = []

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if lost.exc_value is not None:
            raised.append(lost.exc_value)

    before, sys.unraisablehook = sys.unraisablehook, hook
    try:
        yield raised
    finally:
        sys.unraisablehook = before
