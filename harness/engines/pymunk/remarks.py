"""Effects that a Space adds to its bodies and joints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from physics_crosscheck.harness.engines.pymunk.own_step import has_own_step
from physics_crosscheck.harness.engines.remark import POSITION_FORCE_TERMS, Remark


def space_remarks(space: Any, settings: Mapping[str, object]) -> Iterator[Remark]:
    """Yield all remarks about a Space as its file builds it, under the adapter's settings."""
    yield from _overridden(space, settings)
    if has_own_step(space):
        yield Remark(
            message=(
                "the Space has its own step, callbacks or threads; crosscheck uses its own step"
            ),
            address="",
        )
    damping: Any = settings.get("damping", space.damping)
    if damping != 1:
        value = float(damping)
        yield Remark(
            message=(
                f"Space.damping is {value:g}: every velocity loses {1 - value:.3g} per second"
            ),
            subject=("Space.damping",),
            fault=True,
            address=_address("damping", settings),
            value=value,
        )
    given: Any = settings.get("gravity", space.gravity)
    gravity = (float(given[0]), float(given[1]))
    if gravity[0] and gravity[1]:
        yield Remark(
            message=f"gravity is tilted: {gravity} is not along an axis",
            address=_address("gravity", settings),
            shows_in=POSITION_FORCE_TERMS,
        )
    yield from _joint_remarks(space.constraints)
    yield from _spring_remarks(space.constraints)
    shapes = [s for s in space.shapes if not s.sensor and s.filter.mask != 0]
    if len(shapes) > 1:
        yield Remark(
            kind="contact",
            message=f"{len(shapes)} shapes can collide: their filters allow it",
            address="",
        )


def _overridden(space: Any, settings: Mapping[str, object]) -> Iterator[Remark]:
    """Yield values of the script that the sidecar's settings override, except pymunk's defaults."""
    for name, stated, plain, shows_in in (
        ("gravity", tuple(map(float, space.gravity)), (0.0, 0.0), POSITION_FORCE_TERMS),
        ("damping", float(space.damping), 1.0, ("damping",)),
    ):
        given: Any = settings.get(name, stated)
        counts = tuple(map(float, given[:2])) if name == "gravity" else float(given)
        if stated not in (plain, counts):
            yield Remark(
                kind="setting",
                message=f"the sidecar's {name}, {counts}, overrides the file's, {stated}",
                address=f"Space().{name}",
                related_address=f"sidecar:settings.{name}",
                shows_in=shows_in,
            )


def _address(name: str, settings: Mapping[str, object]) -> str:
    return f"sidecar:settings.{name}" if name in settings else f"Space().{name}"


def _joint_remarks(constraints: Iterable[Any]) -> Iterator[Remark]:
    import pymunk

    plain = pymunk.PivotJoint(pymunk.Body(1, 1), pymunk.Body(1, 1), (0, 0)).error_bias
    for constraint in constraints:
        kind = type(constraint).__name__
        if isinstance(constraint, (pymunk.DampedSpring, pymunk.DampedRotarySpring)):
            continue  # forces have no error to correct
        if constraint.error_bias == plain:
            yield Remark(
                kind="constraint",
                message=f"error_bias of a {kind} is pymunk's default, 0.9**60: at ordinary steps"
                " the joint takes energy out of the motion",
                address=f"{kind}()",
                value=float(plain),
            )
        if constraint.max_force < float("inf") or constraint.max_bias < float("inf"):
            yield Remark(
                kind="constraint",
                message=f"a {kind} has a largest force or correction: it yields beyond",
                address=f"{kind}()",
            )


def _spring_remarks(constraints: Iterable[Any]) -> Iterator[Remark]:
    import pymunk

    for spring in constraints:
        if isinstance(spring, pymunk.DampedSpring) and spring.stiffness:
            start = spring.a.local_to_world(spring.anchor_a)
            end = spring.b.local_to_world(spring.anchor_b)
            here, rest, what = (end - start).length, spring.rest_length, "length"
        elif isinstance(spring, pymunk.DampedRotarySpring) and spring.stiffness:
            here, rest, what = spring.a.angle - spring.b.angle, spring.rest_angle, "angle"
        else:
            continue
        kind = type(spring).__name__
        if abs(here - rest) > 1e-9 * max(1.0, abs(here)):
            yield Remark(
                message=f"a {kind} is built at the {what} {here:g} and rests at {rest:g}",
                address=f"{kind}()",
                value=float(rest),
                shows_in=POSITION_FORCE_TERMS,
            )
