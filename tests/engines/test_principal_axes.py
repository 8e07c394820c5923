"""PyBullet's rounding of principal axes: its size, its setting, and its distinction from faults."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks import case as cases
from physics_crosscheck.harness.checks.audit import audit_declared
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system, prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.diagnose import Ranking
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.diagnosis.task import ranked
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.bindings import with_literals
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.records.case import WholeStep
from physics_crosscheck.records import AuditFinding, Outcome
from tests.audit.models import messages, severe
from tests.models import written

pytest.importorskip("pybullet")

SYSTEM = '''
"""A body of any shape on a hinge that lies level."""

from sympy import cos

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System

theta = Coordinate("theta", "rad", "angle")
m, l, g = (Constant(n, v, u, n, "chosen")
           for n, v, u in (("m", 0.3, "kg"), ("l", 0.2, "m"), ("g", 9.81, "m/s^2")))
I = [Constant(n, v, "kg*m^2", n, "chosen")
     for n, v in (("Ixx", 0.07), ("Iyy", 0.06), ("Izz", 0.08),
                  ("Ixy", 0.011), ("Ixz", -0.007), ("Iyz", 0.005))]
tau = Input("tau", "N*m", "torque", on={theta: 1})
J = (9 * I[0] + 16 * I[1] + 24 * I[3]) / 25
system = System(
    name="hinge", title="Hinge", source="a test", coordinates=(theta,), constants=(m, l, g, *I),
    inputs=(tau,), outputs=(Output("theta", theta.q, "rad", "angle"),),
    T=(J + m * l**2) * theta.v**2 / 2, V=-m * g * l * cos(theta.q), D=0,
    equilibria=(Equilibrium("rest", {theta: 0}, False, "hanging"),),
    scenarios=(Scenario("free", "released", q={theta: 0.9}, v={theta: -0.4}, inputs={tau: 0},
                        duration=2.0),
               Scenario("pushed", "pushed", q={theta: 0.1}, v={theta: 0}, inputs={tau: 0.4},
                        duration=2.0)),
    published=(),
)
'''

URDF = """<robot name="hinge">
<link name="ground"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="body"><inertial><origin xyz="0 0 -0.2"/><mass value="0.3"/>
<inertia ixx="0.07" iyy="0.06" izz="0.08" ixy="0.011" ixz="-0.007" iyz="0.005"/></inertial></link>
<joint name="theta" type="continuous"><parent link="ground"/><child link="body"/>
<axis xyz="0.6 0.8 0"/></joint></robot>
"""

BODY = "robot/link[body]/inertial/"
KEYS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
SIDECAR = (
    'engines = ["pybullet"]\n[settings]\nstep = 0.002\ngravity = [0, 0, -9.81]\n[bindings]\n'
    f'"{BODY}mass@value" = "m"\n"{BODY}origin@xyz[2]" = "-l"\n'
    + "".join(f'"{BODY}inertia@{key}" = "I{key[1:]}"\n' for key in KEYS)
)
NAME = "PyBullet's own principal axes of body"


@pytest.fixture(scope="module")
def hinge(tmp_path_factory: pytest.TempPathFactory) -> PreparedSystem:
    folder = tmp_path_factory.mktemp("hinge")
    (folder / "system.py").write_text(SYSTEM)
    (folder / "body.urdf").write_text(URDF)
    (folder / "body.urdf.toml").write_text(SIDECAR)
    return prepare_system(folder, described=False)


@pytest.fixture(scope="module")
def right(hinge: PreparedSystem) -> Sidecar:
    return read_sidecar(hinge.place / "body.urdf.toml")


def exact(sidecar: Sidecar) -> Sidecar:
    return replace(sidecar, engine_settings={"pybullet": {"exact_axes": True}})


def wrong(sidecar: Sidecar, changes: Mapping[str, float], into: Path) -> Sidecar:
    return with_literals(sidecar, {f"{BODY}{key}": value for key, value in changes.items()}, into)


def audit(hinge: PreparedSystem, sidecar: Sidecar) -> tuple[AuditFinding, ...]:
    return audit_declared(model_task(hinge, "pybullet", sidecar)).findings


def diagnosis(hinge: PreparedSystem, sidecar: Sidecar) -> Ranking:
    return ranked(model_task(hinge, "pybullet", sidecar))


def test_only_a_correct_file_differs_within_the_engines_own_precision(
    hinge: PreparedSystem, right: Sidecar, tmp_path: Path
) -> None:
    faulty = wrong(right, {"mass@value": 0.3003}, tmp_path)
    small = wrong(right, {"mass@value": 0.3000000003}, tmp_path)
    for sidecar, outcome, within in (
        (right, Outcome.DIFFERS, True), (exact(right), Outcome.AGREES, False),
        (faulty, Outcome.DIFFERS, False), (small, Outcome.DIFFERS, False),
    ):  # fmt: skip
        case = run_case(model_task(hinge, "pybullet", sidecar, scenario="free", resolution=1e-11))
        assert case.outcome is outcome
        assert bool(case.accepted) is within
        assert not within or re.match(
            r"within PyBullet's own \d\.\de-\d+: principal axes of body", case.accepted
        )


def test_precision_excuses_no_other_difference(
    hinge: PreparedSystem, right: Sidecar, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catch a whole step that differs beside a motion within the engine's own precision."""
    record = WholeStep(outcome=Outcome.DIFFERS)
    part = SimpleNamespace(record=record, kind="whole step", combined=lambda verdict: verdict)
    monkeypatch.setitem(cases.PARTS, "whole_step", lambda *_: part)
    task = model_task(hinge, "pybullet", right, scenario="free", resolution=1e-11)
    assert run_case(task).accepted == ""


@pytest.mark.parametrize(("options", "code"), [
    ((), 0), (("--strict",), 1), (("--resolution", "1e-9"), 1), (("--floating",), 0),
])  # fmt: skip
def test_run_accepts_the_engines_own_precision_unless_it_is_strict(
    options: tuple[str, ...], code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    none = 'ixy="0" ixz="0" iyz="0"'
    split = str.split if "--floating" in options else str.rsplit  # of the root, or of the body
    parts = split(URDF.replace('ixy="0.011" ixz="-0.007" iyz="0.005"', none), none, 1)
    off = 'ixy="3e-5" ixz="1e-5" iyz="1.5e-7"'.join(parts)
    (tmp_path / "body.urdf").write_text(off)
    words = ["run", str(tmp_path / "body.urdf"), "--engine", "pybullet", *options]
    assert main([*words, "--out", str(tmp_path / "out")]) == code
    assert ("within PyBullet's own" in capsys.readouterr().out) is (code == 0)


@pytest.mark.slow
def test_cause_is_an_engine_default_with_its_size(hinge: PreparedSystem, right: Sidecar) -> None:
    ranking = diagnosis(hinge, right)
    assert ranking.explained
    (cause,) = ranking.fits[0].causes
    assert cause.kind == "default"
    assert cause.subject[0].startswith(NAME)
    assert "e-09 of its inertia off" in cause.subject[0]
    assert ranking.fits[0].remaining < 1e-2


@pytest.mark.slow
def test_fault_of_a_thousandth_is_named_as_the_cause(
    hinge: PreparedSystem, right: Sidecar, tmp_path: Path
) -> None:
    ranking = diagnosis(hinge, wrong(right, {"mass@value": 0.3003}, tmp_path))
    assert ranking.explained
    assert [cause.subject for cause in ranking.fits[0].causes] == [(f"{BODY}mass@value",)]


def test_audit_notes_the_rounding_without_findings(hinge: PreparedSystem, right: Sidecar) -> None:
    findings = audit(hinge, right)
    assert severe(list(findings)) == []
    (remark,) = [
        one for one in findings if one.message.startswith("PyBullet computes the principal axes")
    ]
    assert remark.severity == "note"
    assert remark.actual is not None
    assert 1e-13 < remark.actual < 1e-8
    assert remark.location is not None
    assert remark.location.line == 4
    assert "the engine's own rounding explains it" in messages(findings, "inertia", "note")
    assert "loss of digits" not in "".join(one.message for one in audit(hinge, exact(right)))


def test_audit_finds_a_fault_larger_than_the_rounding(
    hinge: PreparedSystem, right: Sidecar, tmp_path: Path
) -> None:
    findings = audit(hinge, wrong(right, {"inertia@iyy": 0.06006}, tmp_path))
    assert "inertia of theta" in messages(findings, "inertia")
    assert "loss of digits" not in messages(findings, "inertia")


def test_tensor_of_a_flat_body_satisfies_the_triangle_inequality(tmp_path: Path) -> None:
    flat = URDF
    for key, value in zip(KEYS, ("0.03", "0.05", "0.08", "0.01", "0", "0"), strict=True):
        old = flat.split('body"><inertial>')[1].split(f'{key}="')[1].split('"')[0]
        head, tail = flat.split('name="body"')
        flat = head + 'name="body"' + tail.replace(f'{key}="{old}"', f'{key}="{value}"')
    path = written(tmp_path, "flat.urdf", flat)
    settings = {"step": 0.002, "gravity": [0, 0, 0], "exact_axes": True}
    model = engines()["pybullet"].load(ModelSpec(path, settings=settings))
    assert not model.corrective_settings


@pytest.mark.parametrize("frame", ["0 0 3.1415926535897932", "0.4 1.5707963267948966 0.3"])
def test_axes_near_a_right_angle_are_computed(tmp_path: Path, frame: str) -> None:
    """Use a wheel whose ascending moments are about z, x and y: a pitch of 90 degrees."""
    wheel = (
        URDF.replace('<origin xyz="0 0 -0.2"/>', f'<origin xyz="0 0 -0.2" rpy="{frame}"/>')
        .replace('ixx="0.07" iyy="0.06" izz="0.08"', 'ixx="0.00470985" iyy="0.00616" izz="0.0047"')
        .replace('ixy="0.011" ixz="-0.007" iyz="0.005"', 'ixy="-2.5e-7" ixz="0" iyz="0"')
    )
    (tmp_path / "wheel.urdf").write_text(wheel)
    prepared = prepare_tree(tmp_path / "wheel.urdf", states=8)
    task = model_task(prepared, "pybullet", resolution=1e-12)
    case = run_case(task.with_settings(exact_axes=True))
    assert case.outcome is not Outcome.DIFFERS, case.reason
    assert case.verdict is not None
    assert (case.verdict.discrepancy or 0) < 1e-12


def test_a_default_explains_beside_axes_that_only_its_correction_shows(tmp_path: Path) -> None:
    """Report PyBullet's own kilogram, not the inertia that both links have together."""
    lines = (
        '<robot name="gripper"><link name="body"><inertial><origin xyz="0 0 0.03"/>',
        '<mass value="0.6"/><inertia ixx="4.7106e-4" ixy="3.9292e-7" ixz="2.6537e-6"',
        ' iyy="3.3072e-4" iyz="-1.0975e-5" izz="2.5642e-4"/></inertial></link><link name="tip"/>',
        '<joint name="j" type="fixed"><parent link="body"/><child link="tip"/>',
        '<origin xyz="0 0 0.1"/></joint></robot>',
    )
    task = model_task(prepare_tree(written(tmp_path, "gripper.urdf", "\n".join(lines))), "pybullet")
    (explanation,) = diagnose_robot(task, is_reference=True).explanations
    (cause,) = explanation.causes
    assert (
        str(cause) == "PyBullet's own 1 kg and 1 kg m^2 of a link without <inertial> (tip, line 3)"
    )


HEAVY = """<robot name="heavy"><link name="world"/><link name="arm"><inertial>
<origin xyz="0 -1.5 0" rpy="1 3 4"/><mass value="200"/>
<inertia ixx="5" ixy="0" ixz="0" iyy="6" iyz="0" izz="7"/></inertial></link>
<joint name="j" type="continuous"><parent link="world"/><child link="arm"/><axis xyz="1 0 0"/>
</joint></robot>"""


def test_a_heavy_link_whose_frame_is_turned_runs(tmp_path: Path) -> None:
    """Bullet's own mass matrix refuses inertias whose halves differ by rounding."""
    file = written(tmp_path, "heavy.urdf", HEAVY)
    case = run_case(model_task(prepare_tree(file, states=8), "pybullet"))
    assert case.outcome is Outcome.AGREES, case.reason
