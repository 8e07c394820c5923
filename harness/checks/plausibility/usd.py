"""Advice about a USD stage: what engines read in different ways, or not at all.

Units and fallbacks are those of the schemas of UsdPhysics, and of the namespaces `newton:`, `mjc:`
and `physx*:`. A value that no layer states has a fallback that means something.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.harness.modelfiles.usd.masses import rotation_of
from physics_crosscheck.harness.modelfiles.usd.read import StageTree, UsdJoint
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding, PlausibilityKind
from physics_crosscheck.harness.results.status import counted, listed
from ..findings import finding
from .facts import Advice

DEGREE, NAMED = math.pi / 180, 3
"""rad; most joints, shapes or bodies that a message names."""

SAME_FLOAT, UNIT_NORM = 1e-5, 1e-4
"""Relative difference of two floats that state one quantity; of a quaternion's norm from 1."""

MAX_GAP, MAX_TURN = 1e-4, 1e-3
"""Distance of a joint's two frames, m, and angle between them, rad, that rounding explains."""

SATURATED = 2.0
"""Degrees at which a drive reaches its largest force, below which its gain may be per radian."""

QUATERNIONS = ("quatf", "quatd", "quath")

ROOT = "PhysicsArticulationRootAPI"

FORCE, MOMENTS = "largest force", "physics:diagonalInertia"

STATED: Mapping[str, Mapping[str, float]] = {
    "damping": {"newton:damping": 1 / DEGREE, "mjc:damping": 1.0},
    "armature": {"newton:armature": 1.0, "mjc:armature": 1.0, "physxJoint:armature": 1.0},
    "dry friction": {"newton:friction": 1.0, "mjc:frictionloss": 1.0},
    "largest speed": {"newton:velocityLimit": DEGREE, "physxJoint:maxJointVelocity": DEGREE},
    FORCE: {
        "drive:angular:physics:maxForce": 1.0, "drive:linear:physics:maxForce": 1.0,
        "mjc:actuatorfrcrange:max": 1.0, "urdf:limit:effort": 1.0,
    },
}  # fmt: skip
"""Attributes of a joint that state one quantity, with a hinge's factor to SI units in radians."""

UsdAdvice = Iterator[Advice]


class _Statement(NamedTuple):
    """A quantity as an attribute states it, and the factor to SI units."""

    prim: Any
    name: str
    value: float
    factor: float


class StageFacts:
    """The prims of a stage by their roles."""

    def __init__(self, stage: UsdStage) -> None:
        self.stage, self.joints = stage, StageTree(stage).all_joints
        self.bodies = [*stage.bodies.values()]
        self.colliders = [one for one in stage.prims if _has(one, "PhysicsCollisionAPI")]

    @cached_property
    def _actuators(self) -> Mapping[Any, Any]:
        prims = (one for one in self.stage.prims if one.HasRelationship("mjc:target"))
        return {path: one for one in prims for path in self.stage.targets(one, "mjc:target")}

    def statements(self, joint: UsdJoint, quantity: str) -> list[_Statement]:
        """Return the attributes that state a quantity of a joint; inf states none."""
        names = [(joint.prim, name, factor) for name, factor in STATED[quantity].items()]
        if quantity == FORCE and joint.prim.GetPath() in self._actuators:
            names.append((self._actuators[joint.prim.GetPath()], "mjc:forceRange:max", 1.0))
        values = ((prim, name, self.stage.stated(prim, name), one) for prim, name, one in names)
        return [
            _Statement(prim, name, value, factor if joint.kind == "hinge" else 1.0)
            for prim, name, value, factor in values
            if isinstance(value, float) and math.isfinite(value)
        ]

    def advice(
        self, kind: PlausibilityKind, prims: Sequence[Any], message: str, name: str = "",
        expected: float | None = None, actual: float | None = None, excess: float = 1.0,
    ) -> Advice:  # fmt: skip
        """Return advice about prims, at a property of the first one."""
        names = (*(str(prim.GetPath()) for prim in prims), *([name] if name else []))
        return excess, finding(
            kind, names, message, location=self.line(prims[0], name), expected=expected,
            actual=actual, severity="advice",
        )  # fmt: skip

    def line(self, prim: Any, name: str) -> SourceLine:
        """Return the place of a property, or without a name of a prim."""
        place = self.stage.place(prim, name)
        return SourceLine(file=str(place.file), line=place.line)


def _has(prim: Any, schema: str) -> bool:
    return schema in prim.GetAppliedSchemas()


def articulation_roots(facts: StageFacts) -> UsdAdvice:
    """Yield articulation roots on the body of a fixed base, and those below another one."""
    for prim in (one for one in facts.stage.prims if _has(one, ROOT)):
        above = (facts.stage.stage.GetPrimAtPath(up) for up in prim.GetPath().GetAncestorsRange())
        outer = next((one for one in above if one != prim and _has(one, ROOT)), None)
        if outer:
            message = (
                f"{prim.GetPath()} has an articulation root, and so has {outer.GetPath()} above it:"
                f" engines refuse nested roots or cut the tree there. Remove {ROOT} from the first"
            )
            yield facts.advice("articulation root", [prim], message)
    for joint in facts.joints:
        body = facts.stage.bodies[next(end for end in joint.ends if end)]
        if _fixes(facts.stage, joint, body) and _has(body, ROOT):
            message = (
                f"the articulation root is on the body {quote(body.GetName())}, which "
                f"{joint.prim.GetPath()} fixes to the world: engines simulate a free base and an "
                "outer joint. Apply PhysicsArticulationRootAPI to that joint, or above the body"
            )
            yield facts.advice("articulation root", [body], message)


def repaired(file: Path, findings: Iterable[AuditFinding]) -> str:
    """Return a layer over a stage that repairs roots and quaternions; empty without any of them.

    It moves articulation roots of fixed bases to their joints, removes nested ones, and normalizes
    quaternions.
    """
    stage = UsdStage(file, {})
    joints, session = StageFacts(stage).joints, stage.stage.GetSessionLayer()
    with stage.pxr.Usd.EditContext(stage.stage, session):
        for fault in findings:
            prim = stage.stage.GetPrimAtPath(fault.subject[0])
            if fault.kind == "articulation root":
                base: Any = next((one.prim for one in joints if _fixes(stage, one, prim)), None)
                for name in prim.GetPrimTypeInfo().GetAppliedAPISchemas():  # unknown ones too
                    if "Articulation" in name and (not base or base.AddAppliedSchema(name)):
                        prim.RemoveAppliedSchema(name)
                for member in prim.GetAuthoredAttributes() if base else ():
                    if "rticulation" in (name := member.GetName()):
                        base.CreateAttribute(name, member.GetTypeName()).Set(member.Get())
            elif fault.kind == "quaternion" and not prim.IsInstanceProxy():
                turn = prim.GetAttribute(fault.subject[1])
                turn.Set(turn.Get().GetNormalized())
    layer = stage.pxr.Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(session)
    text = stage.over_file(layer)
    return text.replace(os.path.abspath(file), f"./{file.name}") if layer.rootPrims else ""


def _fixes(stage: UsdStage, joint: UsdJoint, body: Any) -> bool:
    ends = [stage.bodies[end] for end in joint.ends if end]
    return joint.kind == "fixed" and ends == [body]


def unset_masses(facts: StageFacts) -> UsdAdvice:
    """Yield moving bodies with the mass 0, or without shapes that give what is not stated."""
    moved = {end for joint in facts.joints for end in joint.ends}
    solid = set(map(facts.stage.body_of, facts.colliders))
    for body in (one for name, one in facts.stage.bodies.items() if name in moved):
        mass, moments, tensor = (
            facts.stage.stated(body, one) for one in ("physics:mass", MOMENTS, "newton:inertia")
        )
        how = "hold it, refuse the file"
        if mass == 0:
            what = "the mass 0, which means that it is not stated"
            how = "compute it from the density of its shapes" if body in solid else how
        elif mass and not any(moments or ()) and tensor and not any(tensor):
            what = "the moments 0, which mean in UsdPhysics that they are not stated"
            how = "compute them from its shapes, or take 0" if body in solid else how
        elif body in solid or (mass and (any(moments or ()) or tensor)):
            continue
        else:
            what = "a mass, but neither moments of inertia" if mass else "neither a mass"
            what += " nor a shape"
        message = (
            f"body {quote(body.GetName())} has {what}: engines {how}, or invent numbers, such as"
            " 1 kg. State physics:mass and physics:diagonalInertia, or join it to its parent"
        )
        name = "" if mass is None else MOMENTS if tensor and mass else "physics:mass"
        yield facts.advice("unset mass", [body], message, name, actual=mass)


def gain_units(facts: StageFacts) -> UsdAdvice:
    """Yield gains of hinges, per degree, that look like gains per radian, as a person wrote."""
    names = [f"drive:angular:physics:{one}" for one in ("stiffness", "maxForce", "damping")]
    for joint in facts.joints:
        gain, force, damping = (facts.stage.stated(joint.prim, name) or 0.0 for name in names)
        is_written = all(f"{one:.6g}" == f"{float(f'{one:.3g}'):.6g}" for one in (gain, damping))
        if joint.kind == "hinge" and is_written and 0 < force < SATURATED * gain:
            message = (
                f"the drive of {quote(joint.prim.GetName())} has the stiffness {gain:g} per degree,"
                f" {gain / DEGREE:.5g} N m/rad, and reaches its largest force, {force:g} N m, at "
                f"{force / gain:.2g} degrees. If {gain:g} N m/rad is meant, write "
                f"{gain * DEGREE:.6g}, and the damping {damping * DEGREE:.6g}"
            )
            excess = SATURATED * gain / force
            yield facts.advice(
                "gain unit", [joint.prim], message, names[0], gain * DEGREE, gain, excess
            )


def clashing_values(facts: StageFacts) -> UsdAdvice:
    """Yield quantities of a joint or a body that two namespaces state differently."""
    for joint in facts.joints:
        for quantity in STATED:
            rows = facts.statements(joint, quantity)
            for other in rows[1:]:
                yield from _clash(facts, quantity, rows[0], other)
    for body in facts.bodies:
        yield from _clashing_inertia(facts, body)


def _clash(facts: StageFacts, quantity: str, first: _Statement, other: _Statement) -> UsdAdvice:
    here, there = first.value * first.factor, other.value * other.factor
    if math.isclose(here, there, rel_tol=SAME_FLOAT):
        return
    per = f" ({first.value:g} per degree)" if first.factor > 1 else ""
    expected = there / first.factor
    message = (
        f"the {quantity} of {quote(first.prim.GetName())} is {here:.6g}{per} by {first.name} and "
        f"{there:.6g} by {other.name} in {facts.line(other.prim, other.name)}: each engine reads "
        f"one of them. Write {expected:.6g} for the first, or {here / other.factor:.6g} for the "
        "second"
    )
    excess = abs(math.log(abs(here or 1e-9) / abs(there or 1e-9)))
    yield facts.advice(
        "clashing values", [first.prim], message, first.name, expected, first.value, excess
    )


def _clashing_inertia(facts: StageFacts, body: Any) -> UsdAdvice:
    tensor, moments = facts.stage.stated(body, "newton:inertia"), facts.stage.stated(body, MOMENTS)
    if not isinstance(tensor, tuple) or len(tensor) != 6 or not any(moments or ()):
        return
    turn = rotation_of(facts.stage.value(body, "physics:principalAxes", (0.0,) * 4))
    stated = (turn @ np.diag(moments) @ turn.T)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    apart = np.abs(stated - tensor)
    worst, share = int(np.argmax(apart)), float(apart.max() / max(map(abs, tensor)))
    if share > SAME_FLOAT:
        message = (
            f"newton:inertia and {MOMENTS} of {quote(body.GetName())}, along its principal axes, "
            f"differ by {100 * share:.3g} %: {tensor[worst]:.6g} and {stated[worst]:.6g} kg m^2 in "
            "one component. Correct one, or remove it"
        )
        yield facts.advice(
            "clashing values", [body], message, MOMENTS, tensor[worst], stated[worst], share
        )


def unread_efforts(facts: StageFacts) -> UsdAdvice:
    """Yield joints whose largest force is stated, but not as the maxForce of a drive."""
    by_name: dict[str, list[_Statement]] = {}
    for joint in facts.joints:
        rows = facts.statements(joint, FORCE)
        if rows and not any(row.name.endswith("maxForce") for row in rows):
            by_name.setdefault(rows[0].name, []).append(rows[0])
    for name, rows in by_name.items():
        prims, value = [row.prim for row in rows], rows[0].value
        message = (
            f"the largest force is stated only as {name}, such as {value:g}, for "
            f"{counted(len(rows), 'joint')}: {listed([one.GetName() for one in prims], NAMED)}. "
            "Engines that read UsdPhysics do not limit their drives. Apply PhysicsDriveAPI and "
            "write maxForce"
        )
        yield facts.advice("unread effort", prims, message, name, value, None, len(rows))


def quaternions(facts: StageFacts) -> UsdAdvice:
    """Yield quaternions that are not of unit length; zeros leave the principal axes unset."""
    rows = ((prim, attribute) for prim in facts.stage.prims for attribute in prim.GetAttributes())
    for prim, attribute in rows:
        name, kind = str(attribute.GetName()), str(attribute.GetTypeName())
        value = facts.stage.stated(prim, name) if kind in QUATERNIONS else None
        norm = 1.0 if value is None else math.hypot(*value)
        if not abs(norm - 1) <= UNIT_NORM and (norm or name != "physics:principalAxes"):
            message = (
                f"{name} of {quote(prim.GetName())} has the norm {norm:.6g}: engines scale by it, "
                "divide by it, or refuse it. Divide the quaternion by its norm"
            )
            excess = abs(norm - 1) / UNIT_NORM
            yield facts.advice("quaternion", [prim], message, name, 1.0, norm, excess)


def joint_frames(facts: StageFacts) -> UsdAdvice:
    """Yield joints whose two frames do not meet as drawn."""
    for joint in facts.joints:
        first, second = (
            frame if end is None else facts.stage.world(facts.stage.bodies[end])[0].compose(frame)
            for end, frame in zip(joint.ends, joint.frames, strict=True)
        )  # fmt: skip
        axis = np.eye(3)[joint.axis]
        apart = first.rotation.T @ (second.origin - first.origin)
        apart = apart - (axis @ apart) * axis if joint.kind == "slide" else apart
        relative = first.rotation.T @ second.rotation
        still = np.diag(axis if joint.kind == "hinge" else np.full(3, float(joint.kind != "ball")))
        # The sine of half the angle between the axes that the joint holds.
        turn = 2 * math.asin(min(1.0, float(np.linalg.norm((relative - np.eye(3)) @ still, 2)) / 2))
        gap = float(np.linalg.norm(apart))
        is_gap, excess = gap / MAX_GAP > turn / MAX_TURN, max(gap / MAX_GAP, turn / MAX_TURN)
        if excess > 1:
            what = f"{gap:.4g} m apart" if is_gap else f"turned by {turn / DEGREE:.4g} degrees"
            message = (
                f"the frames of {quote(joint.prim.GetName())} on its two bodies are {what} as "
                "drawn: engines move the child there, or pull both together. Correct localPos and "
                "localRot, body0, or the place of the child"
            )
            name = "physics:localPos0" if is_gap else "physics:localRot0"
            actual = gap if is_gap else turn
            yield facts.advice("joint frames", [joint.prim], message, name, 0.0, actual, excess)


def unset_frictions(facts: StageFacts) -> UsdAdvice:
    """Yield materials without a friction, and shapes without a material."""
    binding = facts.stage.pxr.UsdShade.MaterialBindingAPI
    bound = [binding(one).ComputeBoundMaterial("physics")[0].GetPrim() for one in facts.colliders]
    physical = [one if one and _has(one, "PhysicsMaterialAPI") else None for one in bound]
    for material in {str(one.GetPath()): one for one in physical if one}.values():
        names = [f"physics:{one}Friction" for one in ("static", "dynamic")]
        unset = [name for name in names if facts.stage.stated(material, name) is None]
        if unset:
            message = (
                f"material {quote(material.GetName())} does not state {listed(unset, NAMED)}: the "
                "schema's fallback is 0, so that its shapes slide like on ice. State it"
            )
            yield facts.advice("unset friction", [material], message, actual=0.0, excess=2.0)
    bare = [one for one, material in zip(facts.colliders, physical, strict=True) if not material]
    if bare and facts.bodies:
        message = (
            f"{counted(len(bare), 'shape')} without a physics material: "
            f"{listed([str(one.GetName()) for one in bare], NAMED)}. Each engine takes a friction "
            "of its own. Bind a material that states it"
        )
        yield facts.advice("unset friction", bare, message)


def scaled_bodies(facts: StageFacts) -> UsdAdvice:
    """Yield bodies with a scale, in one finding for each prim that states it."""
    scaled: dict[Any, list[Any]] = {}
    for body in facts.bodies:
        if np.abs(facts.stage.world(body)[1] - 1).max() > SAME_FLOAT:
            prim = body
            while prim and set(facts.stage.stated(prim, "xformOp:scale") or (1.0,)) == {1.0}:
                prim = prim.GetParent()
            scaled.setdefault(prim or body, []).append(body)
    for prim, bodies in scaled.items():
        scale = facts.stage.world(bodies[0])[1]
        name = "xformOp:scale" if facts.stage.stated(prim, "xformOp:scale") else ""
        message = (
            f"{prim.GetPath()} scales {counted(len(bodies), 'rigid body', 'rigid bodies')} by "
            f"{' '.join(f'{one:.6g}' for one in scale)}: "
            f"{listed([str(one.GetName()) for one in bodies], NAMED)}. Engines apply it to shapes,"
            " masses and joint frames in different ways. Scale the meshes, not the bodies"
        )
        worst = float(scale[np.argmax(np.abs(scale - 1))])
        yield facts.advice("scaled body", [prim], message, name, 1.0, worst, len(bodies))


def limits_like_radians(facts: StageFacts) -> UsdAdvice:
    """Yield limits of hinges, in degrees, of a file that states them like radians."""
    limits: dict[UsdJoint, float] = {}
    for joint in facts.joints:
        ends = [facts.stage.stated(joint.prim, name) for name in joint.limit if name]
        if joint.kind == "hinge" and None not in ends and all(map(math.isfinite, ends)):
            limits[joint] = max(map(abs, ends))
    parts = [value / (math.pi / 12) for value in limits.values()]
    is_like_radians = any(part > 1 and abs(part - round(part)) < 2e-3 for part in parts)
    if is_like_radians and max(limits.values()) <= 2 * math.pi + 0.01:
        for joint, value in limits.items():
            message = (
                f"joint {quote(joint.prim.GetName())} has limits up to {value:g} degrees, like "
                f"radians: as radians they are {value / DEGREE:.4g} degrees. Write degrees"
            )
            yield facts.advice(
                "implausible limit", [joint.prim], message, joint.limit[1], value / DEGREE, value
            )


JUDGES: Sequence[Callable[[StageFacts], UsdAdvice]] = (
    articulation_roots, unset_masses, gain_units, clashing_values, unread_efforts, quaternions,
    joint_frames, unset_frictions, scaled_bodies, limits_like_radians,
)  # fmt: skip
"""Functions that yield advice about a stage."""


def stage_advice(stage: UsdStage) -> UsdAdvice:
    """Yield advice about a stage."""
    facts = StageFacts(stage)
    for judge in JUDGES:
        yield from judge(facts)
