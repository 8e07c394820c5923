"""A USD stage as a tree of bodies, by the schemas of UsdPhysics and Newton.

Sources: https://openusd.org/release/api/usd_physics_page_front.html, and `generatedSchema.usda` of
newton-usd-schemas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Mimic, free_name
from physics_crosscheck.harness.documents.errors import LocationError, ReadError, quote
from physics_crosscheck.harness.documents.sdf.frames import inverse
from physics_crosscheck.harness.documents.usd import (
    STAGE_SETTINGS,
    UsdStage,
    is_outside,
    stage_of,
    unique_tails,
)
from physics_crosscheck.reference.mechanism.bodies import ForceElement, Joint, RigidBody
from physics_crosscheck.reference.mechanism.rotations import (
    IDENTITY,
    Array,
    Place,
    from_quaternion,
    to_quaternion,
)
from ..build_tree import built_robot, enforceable
from ..robot import FREE_MIMIC, LinkPart, Note, Robot, count_notes, refused
from .masses import mass_of

DEGREES = 180 / math.pi
"""Degrees of a radian: gains of hinges are per degree."""

_KINDS = {
    "PhysicsRevoluteJoint": "hinge",
    "PhysicsPrismaticJoint": "slide",
    "PhysicsSphericalJoint": "ball",
    "PhysicsFixedJoint": "fixed",
    "PhysicsJoint": "generic",
}
_AXES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")


@dataclass(frozen=True, kw_only=True, eq=False)
class UsdBody:
    """A rigid body of a stage.

    Attributes:
        prim: of OpenUSD.
        name: the shortest unique end of its path.
        place: its frame in the world, m.
        is_still: whether it is kinematic, or switched off.
    """

    prim: Any
    name: str
    place: Place
    is_still: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class UsdJoint:
    """A joint of a stage.

    Attributes:
        prim: of OpenUSD.
        name: the shortest unique end of its path.
        kind: "hinge", "slide", "ball" or "fixed".
        axis: index of its axis.
        ends: names of its two bodies; None for the world.
        frames: its frame in each of them.
        drive, limit: the prefix of the drive's properties, and the names of its limits.
    """

    prim: Any
    name: str
    kind: str
    axis: int
    ends: tuple[str | None, str | None]
    frames: tuple[Place, Place]
    drive: str
    limit: tuple[str, str]


def read_usd_robot(path: Path, settings: Mapping[str, object]) -> Robot:
    """Read all rigid bodies of a stage.

    A body without a joint to the world moves freely; one that is kinematic or switched off is
    still. Masses, moments and centers that no layer states follow from collision shapes.

    Args:
        path: of the root layer.
        settings: `variants` and `allow_outside` of `UsdStage`.
    """
    try:
        stage = stage_of(path, settings)
    except LocationError as error:
        return refused(path, path.stem, [ReadError.unreadable(error, error.file or path)])
    with np.errstate(all="ignore"):  # overflow is reported
        return read_stage(stage, settings)


def read_stage(stage: UsdStage, settings: Mapping[str, object]) -> Robot:
    """Read an open stage; `settings` are those of `read_usd_robot`."""
    tree = StageTree(stage)
    links = {name: tree.link(one) for name, one in tree.bodies.items()}
    parents = tree.parents
    names = [one.name for one in tree.joints]
    singles = {one.name for one in tree.joints if one.kind in ("hinge", "slide")}
    mimics = enforceable(tree.mimics, singles)
    free = {root: free_name(root, names) for root, joint in parents if joint is None
            and not tree.bodies[root].is_still}  # fmt: skip

    def bodies_with(still: Collection[str]) -> tuple[RigidBody, ...]:
        return tuple(tree.placed(links[name], joint, free, still) for name, joint in parents)

    root = stage.stage.GetPseudoRoot()
    if not tree.bodies:
        stage.add_problem(root, "it has no rigid body", "name the layer of a robot", "no joint")
    robot = built_robot(
        stage,
        name=stage.stage.GetRootLayer().defaultPrim or stage.path.stem,
        root=root,
        links={name: one.prim for name, one in tree.bodies.items()},
        joints={one.name: one.prim for one in tree.joints},
        mimics=mimics,
        bodies_with=bodies_with,
        parts=tuple(
            LinkPart(link=links[name], line=stage.place(one.prim).line or 0)
            for name, one in tree.bodies.items()
        ),
        placed=(),
        left_out=count_notes(tree.notes(), mimics),
        gravity=stage.gravity,
        floats=bool(free),
        pulls=tuple(tree.pulls()),
        stated={
            **stage.settings,
            **{key: settings[key] for key in STAGE_SETTINGS if settings.get(key)},
        },
    )
    return replace(robot, selection=", ".join(stage.selection))


class StageTree:
    """The bodies and joints of a stage; problems are noted in it."""

    def __init__(self, stage: UsdStage) -> None:
        self.stage = stage

    @cached_property
    def bodies(self) -> Mapping[str, UsdBody]:
        """Rigid bodies by name, in the order of the stage."""
        stage, physics = self.stage, self.stage.pxr.UsdPhysics
        prims = [one for one in stage.prims if one.HasAPI(physics.RigidBodyAPI)]
        names = unique_tails([str(one.GetPath()) for one in prims])
        bodies = {}
        for prim, name in zip(prims, names, strict=True):
            is_on = stage.value(prim, "physics:rigidBodyEnabled", True)
            is_still = not is_on or bool(stage.value(prim, "physics:kinematicEnabled"))
            place = stage.world(prim)[0]
            bodies[name] = UsdBody(prim=prim, name=name, place=place, is_still=is_still)
        return bodies

    @cached_property
    def _body_names(self) -> Mapping[str, str]:
        return {str(one.prim.GetPath()): name for name, one in self.bodies.items()}

    def _owner(self, path: Any) -> str | None:
        """Return the body that a path is, or is below of; None for the world."""
        while path and not path.IsAbsoluteRootPath():
            if str(path) in self._body_names:
                return self._body_names[str(path)]
            path = path.GetParentPath()
        return None

    @cached_property
    def all_joints(self) -> tuple[UsdJoint, ...]:
        """All joints, in the order of the stage."""
        return tuple(self._joints_of(lambda prim: True))

    @cached_property
    def joints(self) -> tuple[UsdJoint, ...]:
        """Joints that act, in the order of the stage."""
        return tuple(self._joints_of(self._acts))

    def _joints_of(self, is_chosen: Callable[[Any], bool]) -> Iterator[UsdJoint]:
        joint_type = self.stage.pxr.UsdPhysics.Joint
        prims = [one for one in self.stage.prims if one.IsA(joint_type)]
        names = unique_tails([str(one.GetPath()) for one in prims])
        for prim, name in zip(prims, names, strict=True):
            if is_chosen(prim):
                yield from self._joint(prim, name)

    def _acts(self, prim: Any) -> bool:
        """Return whether a joint is switched on, and in the tree."""
        stage = self.stage
        return bool(stage.value(prim, "physics:jointEnabled", default=True)) and not is_outside(
            stage, prim
        )

    def _joint(self, prim: Any, name: str) -> Iterator[UsdJoint]:
        stage = self.stage
        ends, frames = zip(*(self._end(prim, i) for i in (0, 1)), strict=True)
        kind = _KINDS.get(str(prim.GetTypeName()), "")
        axis, drive, limit = 0, "", ("", "")
        if kind in ("hinge", "slide"):
            axis = "XYZ".index(str(stage.value(prim, "physics:axis", "X")))
            drive = f"drive:{'angular' if kind == 'hinge' else 'linear'}:physics"
            limit = "physics:lowerLimit", "physics:upperLimit"
        elif kind == "generic":
            kind, axis, drive, limit = self._generic(prim)
        if not kind:
            stage.add_problem(
                prim,
                f"a {prim.GetTypeName()} of these axes is not covered",
                "describe it by joints with one axis each",
                "unsupported",
            )
        elif ends[0] == ends[1]:
            stage.add_problem(
                prim, "both ends are on the same body", "name two bodies", name="physics:body1"
            )
        else:
            yield UsdJoint(
                prim=prim, name=name, kind=kind, axis=axis, ends=ends, frames=frames, drive=drive,
                limit=limit,
            )  # fmt: skip

    def _generic(self, prim: Any) -> tuple[str, int, str, tuple[str, str]]:
        """Return kind, axis, drive and limits of a joint whose limits lock other axes."""
        free = [i for i, axis in enumerate(_AXES) if not self._is_locked(prim, axis)]
        if free == [3, 4, 5]:
            return "ball", 0, "", ("", "")
        if len(free) > 1:
            return "", 0, "", ("", "")
        if not free:
            return "fixed", 0, "", ("", "")
        name = _AXES[free[0]]
        kind = "slide" if free[0] < 3 else "hinge"
        limit = f"limit:{name}:physics:low", f"limit:{name}:physics:high"
        return kind, free[0] % 3, f"drive:{name}:physics", limit

    def _is_locked(self, prim: Any, axis: str) -> bool:
        if f"PhysicsLimitAPI:{axis}" not in prim.GetAppliedSchemas():
            return False
        low = self.stage.value(prim, f"limit:{axis}:physics:low", -math.inf)
        return bool(low > self.stage.value(prim, f"limit:{axis}:physics:high", math.inf))

    def _end(self, prim: Any, i: int) -> tuple[str | None, Place]:
        """Return the body of an end of a joint, and the joint's frame there."""
        stage = self.stage
        targets = stage.targets(prim, f"physics:body{i}")
        turn = rotation_of(stage.value(prim, f"physics:localRot{i}", (1.0, 0.0, 0.0, 0.0)))
        local = np.array(stage.value(prim, f"physics:localPos{i}", (0.0, 0.0, 0.0))) * stage.unit
        if not targets:
            return None, Place(turn, local)
        target = stage.stage.GetPrimAtPath(targets[0])
        if not target:
            stage.add_problem(
                prim, f"{targets[0]} does not exist", "name a body", name=f"physics:body{i}"
            )
            return None, Place(turn, local)
        place, scale = stage.world(target)
        owner = self._owner(targets[0])
        outer = IDENTITY if owner is None else inverse(self.bodies[owner].place)
        is_body = owner is not None and self.bodies[owner].prim == target
        base = IDENTITY if is_body else outer.compose(place)
        return owner, base.compose(Place(turn, local * scale))

    @cached_property
    def parents(self) -> tuple[tuple[str, UsdJoint | None], ...]:
        """Bodies, parents first, each with the joint to its parent; None for a root."""
        order = list[tuple[str, UsdJoint | None]]()
        placed = {None, *(name for name, one in self.bodies.items() if one.is_still)}
        order += [(name, None) for name, one in self.bodies.items() if one.is_still]
        waiting = list(self.joints)
        while True:
            ready = next((one for one in waiting if not placed.isdisjoint(one.ends)), None)
            if ready is not None:
                waiting.remove(ready)
                new = [end for end in ready.ends if end not in placed]
                if new:
                    order.append((new[0] or "", ready))
                    placed.add(new[0])
                elif not set(ready.ends) <= {None, *self._still}:
                    self.stage.add_problem(
                        ready.prim,
                        f"joint {quote(ready.name)} closes a loop",
                        "closed loops are not supported: remove the joint",
                        "unsupported",
                    )
                continue
            children = {one.ends[1] for one in waiting}
            rest = [name for name in self.bodies if name not in placed]
            if not rest:
                return tuple(order)
            root = next((name for name in rest if name not in children), rest[0])
            placed.add(root)
            order.append((root, None))

    @property
    def _still(self) -> set[str]:
        return {name for name, one in self.bodies.items() if one.is_still}

    def link(self, body: UsdBody) -> RigidBody:
        """Return a body with its inertia, without a parent."""
        inertia = mass_of(self.stage, body.prim, body.place)
        tensor = inertia.inertia
        x, y, z = inertia.center.tolist()
        i, j = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
        xx, yy, zz, xy, xz, yz = tensor[i, j].tolist()
        return RigidBody(
            name=body.name,
            parent=None,
            mass=inertia.mass,
            center=(x, y, z),
            inertia=(xx, yy, zz, xy, xz, yz),
        )

    def placed(
        self,
        link: RigidBody,
        joint: UsdJoint | None,
        free: Mapping[str, str],
        still: Collection[str],
    ) -> RigidBody:
        """Return a body with its joint and its place in its parent."""
        if joint is None:
            if link.name in free:
                return replace(link, joints=(Joint(name=free[link.name], kind="free"),))
            return _placed_link(link, None, self.bodies[link.name].place)
        inner = joint.ends.index(link.name)
        outer, frame = joint.frames[1 - inner], joint.frames[inner]
        moving = joint.kind != "fixed" and joint.name not in still
        placed = _placed_link(link, joint.ends[1 - inner], outer.compose(inverse(frame)))
        return replace(placed, joints=(self._moving(joint, frame, inner),) if moving else ())

    def _moving(self, joint: UsdJoint, frame: Place, inner: int) -> Joint:
        """Return a joint in the frame of its child, which is body `inner` of it."""
        stage, prim = self.stage, joint.prim
        axis = frame.rotation[:, joint.axis] * (1 if inner else -1)
        (x, y, z), (a, b, c) = axis.tolist(), frame.origin.tolist()
        per, size = self._units(joint)
        stiffness, damping, target, _ = self.drive(joint)
        passive = stage.stated(prim, "newton:damping") or 0.0
        return Joint(
            name=joint.name,
            kind=joint.kind,  # type: ignore[arg-type]  # checked
            axis=(x, y, z),
            at=(a, b, c),
            damping=passive * size * per + damping,
            stiffness=stiffness,
            rest=target,
            armature=(stage.stated(prim, "newton:armature") or 0.0) * size,
            limits=self._limits(joint),
        )

    def _units(self, joint: UsdJoint) -> tuple[float, float]:
        """Return degrees per radian of a turning joint, or 1, and the unit of its inertia."""
        if joint.kind == "slide":
            return 1.0, self.stage.mass_unit
        return DEGREES, self.stage.mass_unit * self.stage.unit**2

    def drive(self, joint: UsdJoint) -> tuple[float, float, float, float]:
        """Return stiffness, damping, target and target velocity of a drive, in SI units."""
        stage, prim, key = self.stage, joint.prim, joint.drive
        name = key.split(":")[1] if key else ""
        if not key or f"PhysicsDriveAPI:{name}" not in prim.GetAppliedSchemas():
            return 0.0, 0.0, 0.0, 0.0
        if stage.value(prim, f"{key}:type", "force") == "acceleration":
            return 0.0, 0.0, 0.0, 0.0
        per, size = self._units(joint)
        length = 1 / DEGREES if joint.kind == "hinge" else stage.unit
        gains = (stage.value(prim, f"{key}:{one}", 0.0) for one in ("stiffness", "damping"))
        goals = (
            stage.value(prim, f"{key}:{one}", 0.0) for one in ("targetPosition", "targetVelocity")
        )
        stiffness, damping = (one * size * per for one in gains)
        target, velocity = (one * length for one in goals)
        return stiffness, damping, target, velocity

    def pulls(self) -> Iterator[ForceElement]:
        """Yield forces of drives with a target velocity."""
        for joint in self.joints:
            _, damping, _, velocity = self.drive(joint)
            if damping * velocity:
                yield ForceElement(
                    name=f"drive of {joint.name}",
                    joints=((joint.name, 1.0),),
                    bias=(damping * velocity, 0.0, 0.0),
                )

    def _limits(self, joint: UsdJoint) -> tuple[float, float] | None:
        if not joint.limit[0]:
            return None
        length = 1 / DEGREES if joint.kind == "hinge" else self.stage.unit
        low = self.stage.value(joint.prim, joint.limit[0], -math.inf) * length
        high = self.stage.value(joint.prim, joint.limit[1], math.inf) * length
        return (low, high) if low <= high and math.isfinite(high - low) else None

    @cached_property
    def mimics(self) -> Mapping[str, Mimic]:
        """Joints that follow others, by name."""
        by_path = {str(one.prim.GetPath()): one.name for one in self.joints}
        mimics = {}
        for joint in self.joints:
            leaders = self.stage.targets(joint.prim, "newton:mimicJoint")
            if leaders and self.stage.value(joint.prim, "newton:mimicEnabled", True):
                offset = self.stage.value(joint.prim, "newton:mimicCoef0", 0.0)
                per = 1 / DEGREES if joint.kind == "hinge" else self.stage.unit
                mimics[joint.name] = Mimic(
                    joint=joint.name,
                    leader=by_path.get(str(leaders[0]), ""),
                    multiplier=self.stage.value(joint.prim, "newton:mimicCoef1", 1.0),
                    offset=offset * per,
                )
        return mimics

    def notes(self) -> Iterator[Note]:
        """Yield content that the tree omits."""
        stage = self.stage
        for prim in stage.prims:
            if prim.HasAPI(stage.pxr.UsdPhysics.CollisionAPI):
                yield "collision geometry", self._owner(prim.GetPath()) or ""
            elif prim.IsA(stage.pxr.UsdPhysics.Joint) and not self._acts(prim):
                is_on = is_outside(stage, prim)
                kind = "excluded from the articulation" if is_on else "switched off"
                yield f"joints that are {kind}", str(prim.GetName())
        for joint in self.joints:
            yield from self._joint_notes(joint)

    def _joint_notes(self, joint: UsdJoint) -> Iterator[Note]:
        stage, prim, name = self.stage, joint.prim, joint.name
        if name in self.mimics:
            yield FREE_MIMIC, name
        if self._limits(joint) is not None:
            yield "limits of position", name
        if stage.stated(prim, "newton:friction"):
            yield "dry friction", name
        if stage.value(prim, f"{joint.drive}:type", "force") == "acceleration":
            yield "drives of the type acceleration", name
        if math.isfinite(stage.value(prim, f"{joint.drive}:maxForce", math.inf)):
            yield "limits of effort", name
        if math.isfinite(stage.stated(prim, "newton:velocityLimit") or math.inf):
            yield "limits of velocity", name
        for space in ("mjc", "physx"):
            if any(one.startswith(space) for one in prim.GetAuthoredPropertyNames()):
                yield f"properties {space}: of joints", name


def rotation_of(quaternion: tuple[float, ...]) -> Array:
    """Return the rotation of a quaternion of any length; none for one without length."""
    q = np.array(quaternion, dtype=float)
    length = np.linalg.norm(q)
    rotation: Array = from_quaternion(q / length) if length else np.eye(3)
    return rotation


def _placed_link(link: RigidBody, parent: str | None, place: Place) -> RigidBody:
    x, y, z = place.origin.tolist()
    return replace(
        link, parent=parent, position=(x, y, z), quaternion=to_quaternion(place.rotation)
    )
