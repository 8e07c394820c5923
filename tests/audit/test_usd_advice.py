"""Advice about USD stages: one planted fault of each kind, and none on the sound arm."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.records import AuditFinding
from tests.robots.usd import edited

pytest.importorskip("pxr")

ARM = """#usda 1.0
(
    defaultPrim = "arm"
    metersPerUnit = 1
    upAxis = "Z"
)
def Material "rubber" (prepend apiSchemas = ["PhysicsMaterialAPI"]) {
    float physics:staticFriction = 0.8
    float physics:dynamicFriction = 0.8
}
def Xform "arm" (prepend apiSchemas = ["PhysicsArticulationRootAPI"]) {
    def Xform "base" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {
        float physics:mass = 2
        float3 physics:diagonalInertia = (0.01, 0.01, 0.01)
    }
    def Xform "link" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]) {
        double3 xformOp:translate = (0, 0, 0.5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        float physics:mass = 1
        point3f physics:centerOfMass = (0.2, 0, 0)
        float3 physics:diagonalInertia = (0.0005, 0.015, 0.015)
        quatf physics:principalAxes = (1, 0, 0, 0)
        def Capsule "shape" (prepend apiSchemas = ["PhysicsCollisionAPI", "MaterialBindingAPI"]) {
            uniform token axis = "X"
            double height = 0.4
            double radius = 0.03
            double3 xformOp:translate = (0.2, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            rel material:binding:physics = </rubber>
        }
    }
    def PhysicsFixedJoint "anchor" {
        rel physics:body1 = </arm/base>
    }
    def PhysicsRevoluteJoint "hinge" (prepend apiSchemas = ["PhysicsDriveAPI:angular"]) {
        uniform token physics:axis = "Y"
        rel physics:body0 = </arm/base>
        rel physics:body1 = </arm/link>
        point3f physics:localPos0 = (0, 0, 0.5)
        quatf physics:localRot0 = (1, 0, 0, 0)
        float physics:lowerLimit = -90
        float physics:upperLimit = 90
        float drive:angular:physics:stiffness = 1.7453293
        float drive:angular:physics:maxForce = 50
        float newton:damping = 0.0017453293
        uniform double mjc:damping = 0.1
    }
}
"""

ROOT, BODY = '["PhysicsArticulationRootAPI"]', ' "base" (prepend apiSchemas = ['
MOMENTS = "        quatf physics:pr"
BINDING = "            rel material:binding:physics = </rubber>\n"
TENSOR = "        double[] newton:inertia = [0.0005, 0.015, 0.016, 0, 0, 0]\n"
SCALED = """{
    double3 xformOp:scale = (1, 1, 2)
    uniform token[] xformOpOrder = ["xformOp:scale"]"""


def advice(folder: Path, *edits: tuple[str, str]) -> list[AuditFinding]:
    file = folder / "arm.usda"
    file.write_text(edited(*edits, text=ARM))
    findings = plausibility_findings(read_robot(file))
    return [one for one in findings if one.severity == "advice"]


def test_says_nothing_about_a_sound_arm(tmp_path: Path) -> None:
    assert advice(tmp_path) == []


@pytest.mark.parametrize(
    ("code", "line", "expected", "actual", "edits"),
    [
        ("XC187", 12, None, None, [(ROOT, '["GeomModelAPI"]'), (BODY, f"{BODY}{ROOT[1:-1]}, ")]),
        ("XC188", 19, None, 0.0, [("mass = 1\n", "mass = 0\n")]),
        ("XC189", 43, 1.74533, 100, [("stiffness = 1.7453293", "stiffness = 100")]),
        ("XC190", 45, 0.00174533, 0.1, [("newton:damping = 0.0017453293", "newton:damping = 0.1")]),
        ("XC190", 21, 0.016, 0.015, [(MOMENTS, f"{TENSOR}{MOMENTS}")]),
        ("XC191", 44, 50, None, [("drive:angular:physics:maxForce", "urdf:limit:effort")]),
        ("XC192", 22, 1, 0.707107, [("Axes = (1, 0", "Axes = (0.5, 0.5")]),
        ("XC193", 39, 0, 0.05, [("localPos0 = (0, 0, 0.5)", "localPos0 = (0, 0, 0.45)")]),
        ("XC193", 40, 0, 0.2, [("Rot0 = (1, 0,", "Rot0 = (0.9950042, 0.0998334,")]),
        ("XC194", 7, None, 0, [("    float physics:dynamicFriction = 0.8\n", "")]),
        ("XC194", 23, None, None, [(BINDING, "")]),
        ("XC195", 12, 1, 2, [(f"{ROOT}) {{", f"{ROOT}) {SCALED}")]),
        ("XC181", 42, 90, 1.5708, [("= -90", "= -1.5707964"), ("= 90", "= 1.5707964")]),
    ],
)  # fmt: skip
def test_names_a_planted_fault_with_its_line_and_numbers(
    tmp_path: Path,
    code: str,
    line: int,
    expected: float | None,
    actual: float | None,
    edits: list[tuple[str, str]],
) -> None:
    (finding,) = advice(tmp_path, *edits)
    assert finding.code == code
    assert finding.location is not None
    assert (Path(finding.location.file).name, finding.location.line) == ("arm.usda", line)
    assert finding.expected == (None if expected is None else pytest.approx(expected, rel=1e-5))
    assert finding.actual == (None if actual is None else pytest.approx(actual, rel=1e-5))
    assert "/arm" in finding.subject[0] or finding.subject == ("/rubber",)


def test_advice_about_a_tensor_has_the_line_of_the_body(tmp_path: Path) -> None:
    (finding,) = advice(
        tmp_path, ("Inertia = (0.0005,", "Inertia = (50, 50,"), ("(50, 50, 0.015, ", "(50, 50, ")
    )
    assert (finding.code, finding.location and finding.location.line) == ("XC162", 16)
