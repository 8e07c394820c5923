"""Faults planted in a USD robot by layers over it: is each named by prim and line, and none else?

`python -m campaigns.usd_faults ROBOT.usda... [--compare ENGINE]` plants each fault in a body and a
joint in the middle of each robot. The layers are written beside the robot, and removed. A fault is
named if new advice names its prim, or with `--compare`, if the first lines of `crosscheck compare`
do. `invented` counts new advice of another kind about other prims, or other rows of `compare`.
"""

from __future__ import annotations

import argparse
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf, Usd, UsdPhysics
from rich.console import Console

from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.commands.compare.candidate import FailureError, candidates
from physics_crosscheck.harness.commands.compare.compare import (
    CompareOptions,
    compare,
    failed_comparison,
)
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.render.terminal.comparison import print_comparison

MOMENTS, AXES = "physics:diagonalInertia", "physics:principalAxes"


def scaled(name: str, factor: float) -> Callable[[Any], None]:
    """Return an edit that multiplies a number or a vector."""

    def edit(prim: Any) -> None:
        attribute = prim.GetAttribute(name)
        attribute.Set(attribute.Get() * factor)

    return edit


def written(name: str, value: object, kind: Any = None) -> Callable[[Any], None]:
    """Return an edit that writes a value, in an attribute of a kind if it is new."""

    def edit(prim: Any) -> None:
        (prim.GetAttribute(name) if kind is None else prim.CreateAttribute(name, kind)).Set(value)

    return edit


def turned(name: str) -> Callable[[Any], None]:
    """Return an edit that conjugates a quaternion."""

    def edit(prim: Any) -> None:
        attribute = prim.GetAttribute(name)
        attribute.Set(attribute.Get().GetInverse())

    return edit


def drive(stiffness: float) -> Callable[[Any], None]:
    """Return an edit that adds a drive with a gain per degree."""

    def edit(prim: Any) -> None:
        motor = UsdPhysics.DriveAPI.Apply(prim, "angular")
        motor.CreateStiffnessAttr(stiffness)
        motor.CreateMaxForceAttr(87.0)

    return edit


def moved_shift(prim: Any) -> None:
    """Move a joint's frame by 1 mm."""
    attribute = prim.GetAttribute("physics:localPos0")
    attribute.Set(attribute.Get() + Gf.Vec3f(0, 0.001, 0))


def other_axis(prim: Any) -> None:
    """Turn a joint about another axis."""
    attribute = prim.GetAttribute("physics:axis")
    attribute.Set({"X": "Y", "Y": "Z", "Z": "X"}[attribute.Get()])


def swapped(prim: Any) -> None:
    """Exchange the two bodies of a joint, without its frames."""
    ends = [prim.GetRelationship(f"physics:body{i}") for i in (0, 1)]
    targets = [end.GetTargets() for end in ends]
    for end, paths in zip(ends, targets[::-1], strict=True):
        end.SetTargets(paths)


def scene_of(prim: Any) -> UsdPhysics.Scene:
    """Return the scene of a prim's stage, or a new one."""
    stage = prim.GetStage()
    scenes = (one for one in stage.Traverse() if one.IsA(UsdPhysics.Scene))
    return UsdPhysics.Scene(next(scenes, None) or stage.DefinePrim("/scene", "PhysicsScene"))


def other_up(prim: Any) -> None:
    """State another up axis, along which gravity acts."""
    prim.GetStage().SetMetadata("upAxis", "Y")
    scene_of(prim).CreateGravityDirectionAttr(Gf.Vec3f(0))


def wrong_parent(prim: Any) -> None:
    """Name the parent's parent as the first body."""
    relation = prim.GetRelationship("physics:body0")
    path = relation.GetTargets()[0].GetParentPath()
    stage = prim.GetStage()
    while path.pathString != "/" and not stage.GetPrimAtPath(path).HasAPI(UsdPhysics.RigidBodyAPI):
        path = path.GetParentPath()
    relation.SetTargets([] if path.pathString == "/" else [path])


def limits_in_radians(prim: Any) -> None:
    """Write the limits of all hinges in radians."""
    for joint in prim.GetStage().Traverse():
        for end in ("lower", "upper") if joint.IsA(UsdPhysics.RevoluteJoint) else ():
            scaled(f"physics:{end}Limit", math.pi / 180)(joint)


def namespaces(prim: Any) -> None:
    """State one damping per degree and per radian with one number."""
    for name in ("newton:damping", "mjc:damping"):
        prim.CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(0.1)


def density(prim: Any) -> None:
    """Take the mass away, and state a density."""
    prim.GetAttribute("physics:mass").Set(0.0)
    UsdPhysics.MassAPI(prim).CreateDensityAttr(2700.0)


def variant(prim: Any) -> None:
    """Select a variant with another mass."""
    loads = prim.GetVariantSets().AddVariantSet("load")
    loads.AddVariant("full")
    loads.SetVariantSelection("full")
    with loads.GetVariantEditContext():
        prim.GetAttribute("physics:mass").Set(99.0)
    prim.GetAttribute("physics:mass").Clear()


BODY: Mapping[str, Callable[[Any], None]] = {
    "mass 1e-4": scaled("physics:mass", 1.0001), "mass 1 %": scaled("physics:mass", 1.01),
    "mass in g": scaled("physics:mass", 1000.0), "mass 0": scaled("physics:mass", 0.0),
    "density": density, "variant": variant, "center in mm": scaled("physics:centerOfMass", 1000.0),
    "center 1e-3": scaled("physics:centerOfMass", 1.001), "conjugated axes": turned(AXES),
    "moments in g m^2": scaled(MOMENTS, 1000.0), "moments 1 %": scaled(MOMENTS, 1.01),
    "axes not of unit length": written(AXES, Gf.Quatf(0.7, 0, 0, 0.7)),
    "second root": UsdPhysics.ArticulationRootAPI.Apply,
    "scale": written("xformOp:scale", Gf.Vec3f(1, 1, 2), Sdf.ValueTypeNames.Float3),
}  # fmt: skip
JOINT: Mapping[str, Callable[[Any], None]] = {
    "limits in radians": limits_in_radians, "wrong body0": wrong_parent, "frame 1 mm": moved_shift,
    "conjugated localRot0": turned("physics:localRot0"), "axis": other_axis,
    "gain per radian": drive(100.0), "gain per degree": drive(1.7453293),
    "localRot0 not of unit length": written("physics:localRot0", Gf.Quatf(2, 0, 0, 0)),
    "namespaces": namespaces, "swapped bodies": swapped, "up axis": other_up,
    "damping per radian": written("newton:damping", 0.0573, Sdf.ValueTypeNames.Float),
    "armature": written("newton:armature", 0.01, Sdf.ValueTypeNames.Float),
    "gravity in cm": lambda prim: scene_of(prim).CreateGravityMagnitudeAttr(981.0) and None,
    "unit": lambda prim: prim.GetStage().SetMetadata("metersPerUnit", 0.01) and None,
    "unit of mass": lambda prim: prim.GetStage().SetMetadata("kilogramsPerUnit", 0.001) and None,
}  # fmt: skip


def planted(file: Path, kind: str, layer_file: Path) -> str:
    """Write a layer with a fault over a robot, and return the path of the prim that has it."""
    original = Usd.Stage.Open(str(file))
    layer = Sdf.Layer.CreateNew(str(layer_file))
    layer.subLayerPaths.append(file.name)
    layer.defaultPrim = original.GetDefaultPrim().GetName()
    for key in ("upAxis", "metersPerUnit", "kilogramsPerUnit"):
        layer.pseudoRoot.SetInfo(key, original.GetMetadata(key))
    stage = Usd.Stage.Open(layer)
    joints = [one for one in stage.Traverse() if one.IsA(UsdPhysics.RevoluteJoint)]
    joint = joints[len(joints) // 2]
    body = stage.GetPrimAtPath(joint.GetRelationship("physics:body1").GetTargets()[0])
    prim = body if kind in BODY else joint
    {**BODY, **JOINT}[kind](prim)
    layer.Save()
    return str(prim.GetPath())


WHOLE = {
    "up axis": "gravity", "gravity in cm": "gravity", "unit": "metersPerUnit",
    "unit of mass": "kilogramsPerUnit", "limits in radians": "range",
}  # fmt: skip
"""Words that name faults of a whole stage."""


def compared(file: Path, other: Path, word: str, engine: str) -> tuple[list[str], int]:
    """Return the first line of `crosscheck compare` that has a word and a line, and other rows.

    The number of other rows is that of differing properties about something else.
    """
    rest = 0
    with InThisProcess() as executor:
        pair = candidates((file, other), (engine, engine))
        options = CompareOptions(a=pair[0], b=pair[1])
        try:
            record = compare(options, executor)
            rows = record.compared.properties if record.compared else ()
            large = (row for row in rows if row.relative is None or row.relative > 5e-7)
            rest = sum(not re.search(word, f"{row.about} {row.message}") for row in large)
        except FailureError as error:
            record = failed_comparison(options, error.failure)
    output = io.StringIO()
    print_comparison(Console(file=output, width=240), record, details=False)
    lines = output.getvalue().splitlines()[:8]
    pattern = rf"^(?=.*\b{word}\b).*(usd\w?|[AB]):\d"
    return [line.strip() for line in lines if re.search(pattern, line)][:1], rest


def advice(file: Path) -> list[AuditFinding]:
    """Return the advice about a file."""
    return [one for one in plausibility_findings(read_robot(file)) if one.severity == "advice"]


def main(given: Sequence[str] | None = None) -> None:
    """Print a row for each fault."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.usd_faults", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("robots", type=Path, nargs="+", metavar="ROBOT.usda")
    parser.add_argument("--compare", default="", help="engine that compares what advice leaves")
    parser.add_argument("--only", default="", help="pattern of faults")
    chosen = parser.parse_args(given)
    print("| robot | fault | named | by | invented |\n|---|---|---|---|---|", flush=True)
    for file in chosen.robots:
        usual: dict[str, set[str]] = {}
        for finding in advice(file):
            usual.setdefault(finding.kind, set()).update(finding.subject)
        kinds = [one for one in (*BODY, *JOINT) if re.search(chosen.only, one)]
        for number, kind in enumerate(kinds):
            layer_file = file.with_name(f"planted_{number}.usda")
            layer_file.unlink(missing_ok=True)
            path = planted(file, kind, layer_file)
            rows = advice(layer_file)
            new = [one for one in rows if not usual.get(one.kind, set()) >= {*one.subject}]
            mine = [one for one in new if any(path.endswith(name) for name in one.subject)]
            others = [one for one in new if one.kind not in {named.kind for named in mine}]
            by = [f"{one.code} {one.location}".replace(f"{file.parent}/", "") for one in mine]
            rest = len(others)
            if chosen.compare and not by:
                word = WHOLE.get(kind, re.escape(path.rpartition("/")[2]))
                by, rest = compared(file, layer_file, word, chosen.compare)
            cells = file.stem, kind, "yes" if by else "no", ", ".join(by), str(rest)
            print(f"| {' | '.join(cells)} |", flush=True)
            layer_file.unlink()


if __name__ == "__main__":
    main()
