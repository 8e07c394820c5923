"""A USD stage as a tree of bodies, by the schemas of UsdPhysics and Newton.

Sources: https://openusd.org/release/api/usd_physics_page_front.html, and `generatedSchema.usda` of
newton-usd-schemas.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Mimic, free_name
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.errors import LocationError, ReadError, quote
from physics_crosscheck.harness.documents.reading import STAGE_SETTINGS
from physics_crosscheck.harness.documents.sdf.frames import inverse
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.reference.mechanism.assemble import assemble
from physics_crosscheck.reference.mechanism.bodies import ForceElement, Joint, RigidBody
from physics_crosscheck.reference.mechanism.rotations import IDENTITY, Place
from physics_crosscheck.reference.mechanism.tree import Tree
from ..build_tree import built_robot, enforceable, placed_body
from ..numbers import SMALL, UNSIZED, ModelFile
from ..robot import FREE_MIMIC, LinkPart, Note, Robot, count_notes, refused
from .masses import mass_of, rotation_of, stated_of

DEGREES = 180 / math.pi
"""Degrees of a radian: gains of hinges are per degree."""

_KINDS = {
    "PhysicsRevoluteJoint": "hinge",
    "PhysicsPrismaticJoint": "slide",
    "PhysicsSphericalJoint": "ball",
    "PhysicsFixedJoint": "fixed",
}
_AXES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")


@dataclass(frozen=True, eq=False)
class UsdJoint:
    """A joint of a stage that acts.

    Attributes:
        kind: "hinge", "slide", "ball" or "fixed".
        axis: index of its axis.
        key: the name of its axis in properties of drives; empty without one.
        ends, frames: names of its two bodies, None for the world, and its frame in each.
    """

    prim: Any
    name: str
    kind: str
    axis: int
    key: str
    ends: tuple[str | None, str | None]
    frames: tuple[Place, Place]

    @property
    def limit(self) -> tuple[str, str]:
        """Names of its limits."""
        if self.key in _AXES:
            return f"limit:{self.key}:physics:low", f"limit:{self.key}:physics:high"
        return "physics:lowerLimit", "physics:upperLimit"


def read_usd_robot(path: Path, settings: Mapping[str, object]) -> Robot:
    """Read all rigid bodies of a stage.

    A body without a joint to the world moves freely; one that is kinematic or switched off is
    still. Masses, moments and centers that no layer states follow from collision shapes. The
    settings are those of `UsdStage`.
    """
    try:
        stage = UsdStage(path, settings)
    except LocationError as error:
        return refused(path, path.stem, [ReadError.unreadable(error, error.file or path)])
    with np.errstate(all="ignore"):  # overflow is reported
        return _read_stage(stage, settings)


def _read_stage(stage: UsdStage, settings: Mapping[str, object]) -> Robot:
    tree, root = StageTree(stage), stage.stage.GetPseudoRoot()
    links, parents = {name: tree.link(name) for name in stage.bodies}, tree.parents
    joints = {joint.name: joint.prim for joint in tree.joints}
    singles = {joint.name for joint in tree.joints if joint.kind in ("hinge", "slide")}
    mimics = enforceable(tree.mimics, singles)
    roots = (name for name, joint in parents if joint is None and name not in tree.still)
    free = {name: free_name(name, joints) for name in roots}

    def bodies_with(still: Collection[str]) -> tuple[RigidBody, ...]:
        return tuple(tree.placed(links[name], joint, free, still) for name, joint in parents)

    if not links:
        stage.add_problem(root, "it has no rigid body", "name the layer of a robot", "no joint")
    given = {key: settings[key] for key in STAGE_SETTINGS if settings.get(key)}
    robot = built_robot(
        stage,
        name=stage.stage.GetRootLayer().defaultPrim or stage.path.stem,
        root=root,
        links=stage.bodies,
        joints=joints,
        mimics=mimics,
        bodies_with=bodies_with,
        parts=tuple(
            LinkPart(link=links[name], line=place.line or 0, file=place.file)
            for name, place in zip(links, map(stage.place, stage.bodies.values()), strict=True)
        ),
        placed=(),
        left_out=count_notes(tree.notes(), mimics),
        gravity=stage.gravity,
        floats=bool(free),
        pulls=tuple(tree.pulls()),
        stated={**stage.settings, **given},
    )
    return replace(robot, selection=", ".join(stage.selection))


class StageTree:
    """The bodies and joints of a stage; problems are noted in it."""

    def __init__(self, stage: UsdStage) -> None:
        self.stage, self.stacked = stage, list[UsdJoint]()

    @cached_property
    def still(self) -> list[str]:
        """Names of bodies that are kinematic, or switched off."""
        value, rows = self.stage.value, self.stage.bodies.items()
        on, still = "physics:rigidBodyEnabled", "physics:kinematicEnabled"
        return [name for name, prim in rows if value(prim, still) or not value(prim, on, True)]

    @cached_property
    def all_joints(self) -> tuple[UsdJoint, ...]:
        """All joints, in the order of the stage."""
        rows = self.stage.joints.items()
        return tuple(joint for name, prim in rows for joint in self._joint(prim, name))

    @cached_property
    def joints(self) -> tuple[UsdJoint, ...]:
        """Joints that act, in the order of the stage."""
        rows = [(name, prim) for name, prim in self.stage.joints.items() if self._acts(prim)]
        return tuple(joint for name, prim in rows for joint in self._joint(prim, name))

    def _acts(self, prim: Any) -> bool:
        is_on = self.stage.value(prim, "physics:jointEnabled", default=True)
        return bool(is_on) and not self.stage.is_outside(prim)

    def _joint(self, prim: Any, name: str) -> Iterator[UsdJoint]:
        stage = self.stage
        ends, frames = zip(*(self._end(prim, i) for i in (0, 1)), strict=True)
        kind, axis, key = self._axis(prim)
        if not kind:
            sentence = f"a {prim.GetTypeName()} of these axes is not covered"
            remedy = "describe it by joints with one axis each"
            stage.add_problem(prim, sentence, remedy, "unsupported")
        elif ends[0] == ends[1]:
            sentence = "both ends are on the same body"
            stage.add_problem(prim, sentence, "name two bodies", name="physics:body1")
        else:
            yield UsdJoint(prim, name, kind, axis, key, ends, frames)

    def _axis(self, prim: Any) -> tuple[str, int, str]:
        kind = _KINDS.get(str(prim.GetTypeName()), "")
        if kind in ("hinge", "slide"):
            axis = "XYZ".index(str(self.stage.value(prim, "physics:axis", "X")))
            return kind, axis, "angular" if kind == "hinge" else "linear"
        if prim.GetTypeName() != "PhysicsJoint":
            return kind, 0, ""
        free = [i for i, axis in enumerate(_AXES) if not self._is_locked(prim, axis)]
        if len(free) == 1:
            return "slide" if free[0] < 3 else "hinge", free[0] % 3, _AXES[free[0]]
        return {(): "fixed", (3, 4, 5): "ball"}.get(tuple(free), ""), 0, ""

    def _is_locked(self, prim: Any, axis: str) -> bool:
        if f"PhysicsLimitAPI:{axis}" not in prim.GetAppliedSchemas():
            return False
        low = self.stage.value(prim, f"limit:{axis}:physics:low", -math.inf)
        return bool(low > self.stage.value(prim, f"limit:{axis}:physics:high", math.inf))

    def _end(self, prim: Any, i: int) -> tuple[str | None, Place]:
        """Return the body of an end of a joint, and the joint's frame there."""
        stage, name = self.stage, f"physics:body{i}"
        turn = rotation_of(stage.value(prim, f"physics:localRot{i}", (1.0, 0.0, 0.0, 0.0)))
        local = np.array(stage.value(prim, f"physics:localPos{i}", (0.0, 0.0, 0.0))) * stage.unit
        for path in stage.targets(prim, name)[:1]:
            target = stage.stage.GetPrimAtPath(path)
            if not target:
                stage.add_problem(prim, f"{path} does not exist", "name a body", name=name)
                break
            (place, scale), body = stage.world(target), stage.body_of(target)
            frame = Place(turn, local * scale)
            if body is None:
                return None, place.compose(frame)
            base = IDENTITY if body == target else inverse(stage.world(body)[0]).compose(place)
            return stage.body_names[body], base.compose(frame)
        return None, Place(turn, local)

    @cached_property
    def parents(self) -> tuple[tuple[str, UsdJoint | None], ...]:
        """Bodies, parents first, each with the joint to its parent; None for a root."""
        order: list[tuple[str, UsdJoint | None]] = [(name, None) for name in self.still]
        placed = {None, *self.still}
        still, waiting = frozenset(placed), list(self.joints)
        while waiting or len(order) < len(self.stage.bodies):
            joint = next((one for one in waiting if not placed.isdisjoint(one.ends)), None)
            if joint is None:
                children = {one.ends[1] for one in waiting}
                rest = [name for name in self.stage.bodies if name not in placed]
                new = [*(name for name in rest if name not in children), *rest]
            else:
                waiting.remove(joint)
                new = [end for end in joint.ends if end is not None and end not in placed]
                if not new and not still.issuperset(joint.ends):
                    self._add_closing(joint, order)
            order += [(name, joint) for name in new[:1]]
            placed.update(new[:1])
        return tuple(order)

    def _add_closing(self, joint: UsdJoint, order: Sequence[tuple[str, UsdJoint | None]]) -> None:
        """Stack a joint on the one between its bodies if the file asks for that, or refuse it."""
        first = next((one for _, one in order if one and {*one.ends} == {*joint.ends}), None)
        kinds = {joint.kind, first.kind} if first else {""}
        name = "newton:jointsAddMobility"
        if kinds <= {"hinge", "slide"} and any(
            self.stage.stated(o, name) for o in self.stage.prims
        ):
            self.stacked.append(joint)
            return
        sentence = "closes a loop, which is not supported"
        remedy = "set physics:excludeFromArticulation, which leaves it out, or remove it"
        if first:
            sentence = f"joins the same bodies as joint {quote(first.name)}, so that both hold them"
            remedy = (
                f"add a body between them, or set {name} on the articulation root to stack hinges"
            )
        text = f"joint {quote(joint.name)} {sentence}"
        self.stage.add_problem(joint.prim, text, remedy, "unsupported")

    def link(self, name: str) -> RigidBody:
        """Return a body with its inertia, without a parent."""
        prim = self.stage.bodies[name]
        mass, center, tensor = mass_of(self.stage, prim)
        x, y, z = center.tolist()
        xx, yy, zz, xy, xz, yz = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
        inertia = xx, yy, zz, xy, xz, yz
        return RigidBody(name=name, parent=None, mass=mass, center=(x, y, z), inertia=inertia)

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
            return placed_body(link, None, self.stage.world(self.stage.bodies[link.name])[0])
        inner = joint.ends.index(link.name)
        outer, frame = joint.frames[1 - inner], joint.frames[inner]
        stack = (joint, *(one for one in self.stacked if {*one.ends} == {*joint.ends}))
        moving = (one for one in stack if one.kind != "fixed" and one.name not in still)
        joints = tuple(self._moving(one, one.ends.index(link.name)) for one in moving)
        return placed_body(link, joint.ends[1 - inner], outer.compose(inverse(frame)), joints)

    def _moving(self, joint: UsdJoint, inner: int) -> Joint:
        frame = joint.frames[inner]
        axis = frame.rotation[:, joint.axis] * (1 if inner else -1)
        (x, y, z), (a, b, c) = axis.tolist(), frame.origin.tolist()
        _, gain, inertia = self._units(joint)
        stiffness, damping, target, _ = self._drive(joint)
        return Joint(
            name=joint.name,
            kind=joint.kind,  # type: ignore[arg-type]  # checked
            axis=(x, y, z),
            at=(a, b, c),
            damping=(self.stage.stated(joint.prim, "newton:damping") or 0.0) * gain + damping,
            stiffness=stiffness,
            rest=target,
            armature=(self.stage.stated(joint.prim, "newton:armature") or 0.0) * inertia,
            limits=self._limits(joint),
        )

    def _units(self, joint: UsdJoint) -> tuple[float, float, float]:
        stage = self.stage
        if joint.kind == "slide":
            return stage.unit, stage.mass_unit, stage.mass_unit
        inertia = stage.mass_unit * stage.unit**2
        return 1 / DEGREES, inertia * DEGREES, inertia

    def _drive(self, joint: UsdJoint) -> tuple[float, float, float, float]:
        value, prim, key = self.stage.value, joint.prim, f"drive:{joint.key}:physics"
        has_drive = f"PhysicsDriveAPI:{joint.key}" in prim.GetAppliedSchemas()
        if not has_drive or value(prim, f"{key}:type", "force") == "acceleration":
            return 0.0, 0.0, 0.0, 0.0
        unit, gain, _ = self._units(joint)
        gains = [value(prim, f"{key}:{name}", 0.0) * gain for name in ("stiffness", "damping")]
        goals = [value(prim, f"{key}:target{end}", 0.0) * unit for end in ("Position", "Velocity")]
        return gains[0], gains[1], goals[0], goals[1]

    def pulls(self) -> Iterator[ForceElement]:
        """Yield forces of drives with a target velocity."""
        for joint in self.joints:
            _, damping, _, velocity = self._drive(joint)
            if damping * velocity:
                yield ForceElement(
                    name=f"drive of {joint.name}",
                    joints=((joint.name, 1.0),),
                    bias=(damping * velocity, 0.0, 0.0),
                )

    def _limits(self, joint: UsdJoint) -> tuple[float, float] | None:
        if not joint.key:
            return None
        unit = self._units(joint)[0]
        low = self.stage.value(joint.prim, joint.limit[0], -math.inf) * unit
        high = self.stage.value(joint.prim, joint.limit[1], math.inf) * unit
        return (low, high) if low <= high and math.isfinite(high - low) else None

    @cached_property
    def mimics(self) -> Mapping[str, Mimic]:
        """Joints that follow others, by name."""
        value, mimics = self.stage.value, {}
        by_path = {joint.prim.GetPath(): joint.name for joint in self.joints}
        for joint in self.joints:
            leaders = self.stage.targets(joint.prim, "newton:mimicJoint")
            if leaders and value(joint.prim, "newton:mimicEnabled", True):
                mimics[joint.name] = Mimic(
                    joint=joint.name,
                    leader=by_path.get(leaders[0], ""),
                    multiplier=value(joint.prim, "newton:mimicCoef1", 1.0),
                    offset=value(joint.prim, "newton:mimicCoef0", 0.0) * self._units(joint)[0],
                )
        return mimics

    def notes(self) -> Iterator[Note]:
        """Yield content that the tree omits."""
        stage = self.stage
        for prim in stage.prims:
            if prim.HasAPI(stage.pxr.UsdPhysics.CollisionAPI):
                yield "collision geometry", stage.body_names.get(stage.body_of(prim), "")
            elif prim.IsA(stage.pxr.UsdPhysics.Joint) and not self._acts(prim):
                is_on = stage.is_outside(prim)
                kind = "excluded from the articulation" if is_on else "switched off"
                yield f"joints that are {kind}", str(prim.GetName())
        for joint in self.joints:
            yield from (
                (what, joint.name) for what, is_omitted in self._omitted(joint) if is_omitted
            )

    def _omitted(self, joint: UsdJoint) -> Iterator[tuple[str, object]]:
        stage, prim = self.stage, joint.prim
        yield FREE_MIMIC, joint.name in self.mimics
        yield "limits of position", self._limits(joint)
        yield "dry friction", stage.stated(prim, "newton:friction")
        if joint.key:
            key = f"drive:{joint.key}:physics"
            is_acceleration = stage.value(prim, f"{key}:type", "force") == "acceleration"
            yield "drives of the type acceleration", is_acceleration
            yield "limits of effort", stage.value(prim, f"{key}:maxForce", math.inf) < math.inf
        speed = stage.stated(prim, "newton:velocityLimit") or math.inf
        yield "limits of velocity", math.isfinite(speed)
        for space in ("mjc", "physx"):
            names = (name for name in prim.GetAuthoredPropertyNames() if name.startswith(space))
            yield f"properties {space}: of joints", next(names, "")


_BODY, _SHAPE = "physics:body", re.compile(r"xformOp:.*|size|radius|height")
"""Start of the names of a joint's ends; numbers of a prim's place and shape."""

_RELEVANT = re.compile(
    r".*@(physics:(mass|density|centerOfMass|diagonalInertia|principalAxes|localPos\d|localRot\d"
    r"|gravity\w+)|newton:(inertia|damping|armature|mimic\w+)"
    r"|drive:\w+:physics:(stiffness|damping|target\w+)|xformOp:.*|size|radius|height)"
)
"""Numbers that may affect a tree."""


class UsdNumbers(ModelFile):
    """The numbers of a stage that has a tree; the setting `held` names joints that are fixed."""

    def __init__(self, path: Path, settings: Mapping[str, object]) -> None:
        super().__init__([])
        self._stage, self._settings = UsdStage(path, settings), settings
        self.numerals = tuple(
            one if one.scale > SMALL else replace(one, scale=UNSIZED)
            for one in self._stage.numbers()
        )

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree; without shapes of bodies with masses."""
        stage, rows = self._stage, enumerate(self.numerals)
        bodies, joints = stage.bodies.values(), stage.joints.values()
        ends = [path for joint in joints for i in "01" for path in stage.targets(joint, _BODY + i)]
        placed = {up for path in ends for up in path.GetAncestorsRange()}
        placed.update(up for body in bodies for up in body.GetPath().GetAncestorsRange())
        weighed = [one for one in bodies if any(part is None for part in stated_of(stage, one))]

        def is_relevant(number: Number) -> bool:
            if not _RELEVANT.fullmatch(number.path) or not _SHAPE.fullmatch(number.key):
                return _RELEVANT.fullmatch(number.path) is not None
            prim = stage.stage.GetPrimAtPath(number.address.partition(".")[0])
            return prim.GetPath() in placed or stage.body_of(prim) in weighed

        return tuple(i for i, number in rows if is_relevant(number))

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        stage, held = self._stage, self._settings.get("held")
        stage.change({self.numerals[i]: value for i, value in values.items()})
        count = len(stage.obstacles)
        try:
            robot = _read_stage(stage, self._settings)
        finally:
            stage.change({})
            del stage.obstacles[count:]
        if not held or not isinstance(held, list) or robot.body_model is None:
            return robot.tree
        return assemble(robot.body_model.without(held)).tree

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return a layer over the file, by its path beside it."""
        layer = self._stage.overlay({self.numerals[i]: value for i, value in values.items()})
        return {self._stage.path.with_suffix(".usda"): layer}
