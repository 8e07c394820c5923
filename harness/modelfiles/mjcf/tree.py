"""What an engine made of a file, as bodies with their joints and pulls, each with its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from physics_crosscheck.harness.engines.compiled import (
    CompiledBody,
    CompiledJoint,
    CompiledMark,
    CompiledPull,
    CompiledTree,
    CompiledWay,
)
from physics_crosscheck.harness.modelfiles.robot import LeftOut, Part, Robot, Told, home_of
from physics_crosscheck.reference.mechanism.assemble import Assembled, assembled
from physics_crosscheck.reference.mechanism.bodies import (
    ZERO,
    Coupling,
    ForceElement,
    Joint,
    Powers,
    Quaternion,
    RigidBody,
    Site,
    Triple,
)
from physics_crosscheck.reference.mechanism.force_paths import CablePath, FrameForce, JointForce
from physics_crosscheck.reference.mechanism.tree import Fluid, Kind, Tree

KINDS: Mapping[str, Kind] = {
    "hinge": "hinge", "slide": "slide", "ball": "ball", "free": "free"
}  # fmt: skip

SPREAD = (5**0.5 - 1) / 2
"""By whose multiples controls are spread over their ranges, so that no two are alike."""


def compiled_robot(
    found: CompiledTree,
    path: Path,
    left_out: tuple[LeftOut, ...],
    controls: Sequence[float] | None = None,
) -> Robot:
    """Return the whole, its controls held where they are given, or anywhere in their ranges.

    Raises:
        TreeError: naming the joint that is not covered.
    """
    controls = held_controls(found) if controls is None else tuple(controls)
    told = _told(found, controls)
    whole = _assembled(told)
    return Robot(
        name=found.name or path.stem,
        file=path,
        tree=whole.tree,
        parts=tuple(_part(body, whole.bodies[body.name]) for body in told.bodies),
        limits=whole.limits,
        home=home_of(whole.tree, whole.limits),
        left_out=left_out,
        obstacles=(),
        controls=controls,
        told=told,
        shapes=found.shapes,
    )


def compiled_tree(found: CompiledTree, controls: Sequence[float]) -> Tree:
    """The tree alone, under held controls.

    Raises:
        TreeError: naming the joint that is not covered.
    """
    return _assembled(_told(found, controls)).tree


def _told(found: CompiledTree, controls: Sequence[float]) -> Told:
    bodies = compiled_bodies(found)
    return Told(
        bodies=bodies,
        gravity=found.gravity,
        pulls=tuple(_pulls(found, bodies, controls)),
        couplings=tuple(_couplings(found, bodies)),
        medium=_medium(found),
    )


def _medium(found: CompiledTree) -> Fluid | None:
    one = found.medium
    if one is None:
        return None
    return Fluid(density=one.density, viscosity=one.viscosity, wind=one.wind)


def _assembled(told: Told) -> Assembled:
    return assembled(told.bodies, told.gravity, told.pulls, told.couplings, told.medium)


def _part(body: RigidBody, within: int) -> Part:
    mass, center, inertia = body.spatial_inertia
    return Part(name=body.name, line=0, mass=mass, center=center, inertia=inertia, body=within)


def compiled_bodies(found: CompiledTree) -> tuple[RigidBody, ...]:
    """Bodies in the engine's order; those without a name are called by their number."""
    taken = {body.name for body in found.bodies}
    names: list[str | None] = [None]
    bodies: list[RigidBody] = []
    count = 0
    for i, body in enumerate(found.bodies, start=1):
        name = body.name or f"body_{i}"
        while not body.name and name in taken:
            name += "_"
        joints = tuple(_joint(one, count + k) for k, one in enumerate(body.joints))
        count += len(joints)
        bodies.append(_body(body, name, names[body.parent], joints))
        names.append(name)
    return tuple(bodies)


def _body(
    body: CompiledBody, name: str, parent: str | None, joints: tuple[Joint, ...]
) -> RigidBody:
    """A body; one that moves freely counts from the world, wherever the file draws it."""
    free = any(joint.kind == "free" for joint in joints)
    xx, yy, zz = body.moments
    return RigidBody(
        name=name,
        parent=parent,
        position=ZERO if free else _triple(body.at),
        quaternion=None if free else _quaternion(body.turn),
        joints=joints,
        mass=body.mass,
        center=_triple(body.centre),
        inertia=(xx, yy, zz, 0.0, 0.0, 0.0),
        inertia_quaternion=_quaternion(body.principal),
        lift=body.lift,
        dragged=body.dragged,
    )


def _joint(joint: CompiledJoint, index: int) -> Joint:
    kind, name = KINDS[joint.kind], joint.name or f"joint_{index}"
    if kind not in ("hinge", "slide"):
        anchor = _triple(joint.at) if kind == "ball" else ZERO
        return Joint(
            name=name,
            kind=kind,
            at=anchor,
            damping=_powers(joint.damping),
            stiffness=_powers(joint.stiffness),
            armature=joint.armature,
            rest_place=_triple(joint.rest_place),
            rest_turn=_quaternion(joint.rest_turn),
        )
    return Joint(
        name=name,
        kind=kind,
        axis=_triple(joint.axis),
        at=_triple(joint.at),
        zero=joint.zero,
        damping=_powers(joint.damping),
        stiffness=_powers(joint.stiffness),
        rest=joint.rest,
        armature=joint.armature,
        limits=joint.limits,
    )


def held_controls(found: CompiledTree) -> tuple[float, ...]:
    """A value within the range of each control; within 0 and 1 where it has none."""
    ranges = {one.control: one.range for one in found.pulls if one.control >= 0}
    held = []
    for i in range(found.controls):
        low, high = ranges.get(i) or (0.0, 1.0)
        held.append(low + (high - low) * ((i + 1) * SPREAD % 1.0))
    return tuple(held)


def _pulls(
    found: CompiledTree, bodies: tuple[RigidBody, ...], controls: Sequence[float]
) -> Iterator[ForceElement]:
    names = [joint.name for body in bodies for joint in body.joints]
    of = [None, *(body.name for body in bodies)]
    for one in found.pulls:
        yield replace(_pull(one, names, controls), along=_along(one.along, names, of))


def _along(
    one: CompiledWay | None, joints: list[str], bodies: list[str | None]
) -> CablePath[Site] | FrameForce[Site] | JointForce[str] | None:
    """A way by the names of what it is along."""
    if one is None:
        return None
    if one.joint >= 0:
        return JointForce(joint=joints[one.joint], gear=one.gear, in_parent=one.in_parent)

    def site(mark: CompiledMark) -> Site:
        turn = _quaternion(mark.turn)
        return Site(body=bodies[mark.body], position=_triple(mark.at), quaternion=turn)

    if one.frame is None:
        return CablePath(branches=one.branches).mapped(site)
    return FrameForce(frame=one.frame, gear=one.gear, against=one.against).mapped(site)


def _couplings(found: CompiledTree, bodies: tuple[RigidBody, ...]) -> Iterator[Coupling]:
    names = [joint.name for body in bodies for joint in body.joints]
    for one in found.couplings:
        yield Coupling(
            follower=names[one.follower],
            leader=None if one.leader is None else names[one.leader],
            multiplier=one.multiplier,
            offset=one.offset,
            others=tuple((names[joint], share) for joint, share in one.others),
        )


def _pull(one: CompiledPull, names: list[str], controls: Sequence[float]) -> ForceElement:
    return ForceElement(
        name=one.name,
        joints=tuple((names[i], share) for i, share in one.joints),
        bias=one.bias,
        gain=one.gain,
        control=controls[one.control] if one.control >= 0 else 0.0,
        stiffness=_powers(one.stiffness),
        damping=_powers(one.damping),
        rest=one.rest,
        armature=one.armature,
    )


def _powers(values: tuple[float, ...]) -> Powers:
    """One number where there is one alone."""
    return values if any(values[1:]) else (values[0] if values else 0.0)


def _triple(values: tuple[float, ...]) -> Triple:
    x, y, z = values
    return x, y, z


def _quaternion(values: tuple[float, ...]) -> Quaternion | None:
    """None where nothing is turned."""
    w, x, y, z = values
    return None if (x, y, z) == ZERO else (w, x, y, z)
