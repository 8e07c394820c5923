"""Links and joints of a URDF, connected: each link is a body with its parent."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

from physics_crosscheck.harness.modelfiles.urdf.parts import ENDLESS, UrdfJoint, UrdfLink
from physics_crosscheck.reference.mechanism.bodies import ZERO, Joint, RigidBody

Springs = Mapping[str, tuple[float, float]]
"""Stiffness and rest by the joint's name."""


@dataclass(frozen=True)
class UrdfPlan:
    """The bodies of a URDF, connected.

    Attributes:
        bodies: the links, each after its parent.
    """

    bodies: tuple[RigidBody, ...]

    def with_springs(self, springs: Springs) -> tuple[RigidBody, ...]:
        """Return the bodies with springs on their hinges and slides."""
        return tuple(
            replace(body, joints=tuple(_with_spring(one, springs) for one in body.joints))
            for body in self.bodies
        )


def _with_spring(joint: Joint, springs: Springs) -> Joint:
    if not joint.single or joint.name not in springs:
        return joint
    stiffness, rest = springs[joint.name]
    return replace(joint, stiffness=stiffness, rest=rest)


def fix_joints(joints: Mapping[str, UrdfJoint], names: Collection[str]) -> dict[str, UrdfJoint]:
    """Return the joints with some of them fixed at their drawn positions."""
    return {name: replace(one, kind=None) if name in names else one for name, one in joints.items()}


def plan_bodies(
    root: str, links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], floating: bool
) -> UrdfPlan:
    """Return bodies depth first, from the root; joints of one link in the file's order."""
    return UrdfPlan(tuple(_bodies(root, links, joints, floating)))


def _bodies(
    root: str, links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint], floating: bool
) -> Iterator[RigidBody]:
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    carried = root in links
    if carried:
        yield replace(links[root].body, joints=_free(root, joints) if floating else ())
    waiting = list(reversed(below.get(root, [])))
    while waiting:
        joint = waiting.pop()
        # A free body next to a fixed root counts from the world, as in engines.
        loose = joint.kind == "free" and joint.parent == root and not floating
        yield replace(
            links[joint.child].body,
            parent=joint.parent if carried or joint.parent != root else None,
            position=ZERO if loose else joint.origin,
            rpy=ZERO if loose else joint.rpy,
            joints=_joints_of(joint),
        )
        waiting += reversed(below.get(joint.child, []))


def _joints_of(joint: UrdfJoint) -> tuple[Joint, ...]:
    """Return the joint of a body; empty for a fixed one."""
    if joint.kind is None:
        return ()
    return (
        Joint(
            name=joint.name,
            kind=joint.kind,
            axis=joint.axis,
            damping=0.0 if joint.kind == "free" else joint.damping,
            limits=None if joint.bounds == ENDLESS else joint.bounds,
        ),
    )


def _free(root: str, joints: Mapping[str, UrdfJoint]) -> tuple[Joint, ...]:
    """Return the joint of a floating root: with the link's name, unless a joint has it."""
    name = root
    while name in joints:
        name += "_free"
    return (Joint(name=name, kind="free"),)
