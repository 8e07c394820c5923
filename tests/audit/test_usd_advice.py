"""Advice about USD stages: one planted fault of each kind, and none on the sound arm."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.checks.plausibility.usd import repaired
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.usd import read
from physics_crosscheck.harness.planning.model_checks import faults_here
from physics_crosscheck.records import AuditFinding
from tests.robots.usd import edited, read_usd

pytest.importorskip("pxr")

SHAPE = """        def Capsule "shape"
        (prepend apiSchemas = ["PhysicsCollisionAPI", "MaterialBindingAPI"])
        {
            double height = 0.2
            double radius = 0.04
            double3 xformOp:translate = (0.0625, 0, 0.125)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            rel material:binding:physics = </arm/rubber>
        }
"""
MATERIAL = """    def Material "rubber" (prepend apiSchemas = ["PhysicsMaterialAPI"])
    {
        float physics:staticFriction = 0.8
        float physics:dynamicFriction = 0.8
    }
"""
LIMIT, LOWER = "        float physics:lowerLimit", "(0.0035, 0.003, 0.001)\n"
SOUND = edited(
    ("(0.98, 0.1, 0, 0.17)", "(1, 0, 0, 0)"), ("(0.9238795, 0, 0.3826834, 0)", "(1, 0, 0, 0)"),
    (LOWER, LOWER + SHAPE), ('    def PhysicsFixedJoint', f"{MATERIAL}    def PhysicsFixedJoint"),
    (LIMIT, "        float drive:angular:physics:maxForce = 50\n"
     "        float newton:damping = 0.0017453293\n"
     f"        uniform double mjc:damping = 0.1\n{LIMIT}"),
)  # fmt: skip
BINDING = "            rel material:binding:physics = </arm/rubber>\n"
TENSOR = "        double[] newton:inertia = [0.0035, 0.003, 0.0011, 0, 0, 0]\n"
ZERO = "        double[] newton:inertia = [0, 0, 0, 0, 0, 0]\n"
ROOT, BODY = '"PhysicsArticulationRootAPI"', ' "base" (prepend apiSchemas = ['
NESTED = f"(prepend apiSchemas = [{ROOT}, "
SCALED = """{
    double3 xformOp:scale = (1, 1, 2)
    uniform token[] xformOpOrder = ["xformOp:scale"]"""


def advice(folder: Path, *edits: tuple[str, str]) -> list[AuditFinding]:
    findings = plausibility_findings(read_usd(folder, edited(*edits, text=SOUND)))
    return [one for one in findings if one.severity == "advice"]


def test_a_freed_root_is_a_fault_where_an_installed_engine_frees_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_body = (f"[{ROOT}]", '["GeomModelAPI"]'), (BODY, f"{BODY}{ROOT}, ")
    findings = advice(tmp_path, *on_body)
    for engine, version, severity in (
        ("newton", "1.8", "advice"), ("physx", None, "advice"), ("physx", "0.7", "finding"),
    ):  # fmt: skip
        monkeypatch.setattr(type(engines()[engine]), "version", lambda self, one=version: one)
        assert faults_here(findings, engine)[0].severity == severity


def test_repairs_roots_and_quaternions_in_a_layer(tmp_path: Path) -> None:
    roots = f'{ROOT}, "NewtonArticulationRootAPI"'
    on_body = (f"[{ROOT}]", '["GeomModelAPI"]'), (BODY, f"{BODY}{roots}, ")
    findings = advice(tmp_path, *on_body, ("Axes = (1, 0", "Axes = (0.5, 0.5"))
    assert {one.code for one in findings} == {"XC187", "XC192"}
    layer = tmp_path / "arm.fixed.usda"
    layer.write_text(repaired(tmp_path / "arm.usda", findings))
    assert "@./arm.usda@" in layer.read_text()
    assert f"delete apiSchemas = [{roots}]" in layer.read_text()
    assert [*plausibility_findings(read(layer, {}))] == []


def test_says_nothing_about_a_sound_arm(tmp_path: Path) -> None:
    assert advice(tmp_path) == []


@pytest.mark.parametrize(
    ("code", "line", "expected", "actual", "edits"),
    [
        ("XC187", 14, None, None, [
            (f"[{ROOT}]", '["GeomModelAPI"]'), (BODY, f"{BODY}{ROOT}, ")]),
        ("XC187", 27, None, None, [(BODY.replace("base", "lower"), f' "lower" {NESTED}')]),
        ("XC188", 30, None, 0.0, [("mass = 0.75\n", "mass = 0\n")]),
        ("XC188", 32, None, 0.75, [(LOWER, "(0, 0, 0)\n" + ZERO)]),
        ("XC189", 61, 1.74533, 100, [("stiffness = 0.5", "stiffness = 100")]),
        ("XC190", 57, 0.00174533, 0.1, [("newton:damping = 0.0017453293", "newton:damping = 0.1")]),
        ("XC190", 32, 0.0011, 0.001, [(SHAPE, TENSOR + SHAPE)]),
        ("XC191", 56, 50, None, [("drive:angular:physics:maxForce", "urdf:limit:effort")]),
        ("XC192", 25, 1, 0.707107, [("Axes = (1, 0", "Axes = (0.5, 0.5")]),
        ("XC193", 55, 0, 0.05, [("localPos0 = (0, 0, 0.125)", "localPos0 = (0, 0, 0.075)")]),
        ("XC193", 70, 0, 0.2, [("Rot0 = (1, 0, 0", "Rot0 = (0.9950042, 0, 0.0998334")]),
        ("XC194", 43, None, 0, [("        float physics:dynamicFriction = 0.8\n", "")]),
        ("XC194", 33, None, None, [(BINDING, "")]),
        ("XC195", 14, 1, 2, [("API\"]\n) {", f"API\"]\n) {SCALED}")]),
        ("XC181", 60, 90, 1.5708, [("= -90", "= -1.5707964"), ("= 90", "= 1.5707964")]),
        ("XC162", 27, 0.10546875, 50.0005, [(LOWER, "(50, 50, 0.001)\n")]),
    ],
)  # fmt: skip
def test_names_a_planted_fault_with_its_line_and_numbers(
    tmp_path: Path, code: str, line: int, expected: float | None, actual: float | None,
    edits: list[tuple[str, str]],
) -> None:  # fmt: skip
    (finding,) = advice(tmp_path, *edits)
    assert finding.code == code
    assert finding.location is not None
    assert (Path(finding.location.file).name, finding.location.line) == ("arm.usda", line)
    assert finding.expected == (None if expected is None else pytest.approx(expected, rel=1e-5))
    assert finding.actual == (None if actual is None else pytest.approx(actual, rel=1e-5))
    assert "/arm" in finding.subject[0] or finding.subject == ("lower",)
