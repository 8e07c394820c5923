"""Audits report planted faults of models, terms and contacts, and nothing in built-in models."""

import time
from pathlib import Path

import msgspec
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.engine import Force, LoadedModel, StateForce
from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.checks.audit import (
    audit_acting,
    audit_declared,
    audit_terms,
    declared_bindings,
)
from physics_crosscheck.harness.checks.compiled_terms import Compiled
from physics_crosscheck.harness.checks.findings import source_line
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.harness.records.finding import BEYOND
from physics_crosscheck.harness.records.survey import ActingQuantity
from physics_crosscheck.harness.results.failure import audit_lines
from physics_crosscheck.harness.run import Options
from physics_crosscheck.records import AuditFinding
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.audit.models import MODELS, AuditCopy, audit, messages, severe
from tests.cases.test_dynamics import ARM
from tests.models import written
from tests.physics import physics as prepared
from tests.robots.files import TIPPED

DRUM = "drum_pendulum"


@pytest.mark.slow
def test_built_in_model_has_no_finding() -> None:
    """Catch unresolved accelerations; findings of other models fail `pytest --crosscheck`."""
    name, engine = "mujoco_rolling.xml", "mujoco"
    findings = audit(prepared(DRUM), read_sidecar(MODELS / DRUM / f"{name}.toml"), engine)
    assert severe(findings) == []
    assert messages(findings, "unresolved", "note") == ""


@pytest.mark.parametrize(
    ("system", "name", "engine", "address", "message"),
    [
        ("drum_pendulum", "mujoco.xml", "mujoco", "body[rod]/inertial@diaginertia[1]",
         "inertia of theta is 0.096000024 in the model and 0.096 in the equations"),
        ("drum_pendulum", "space.py", "pymunk", "STIFFNESS", "stiffness of x is 65.00006"),
        ("drum_pendulum", "robot.urdf", "pybullet", "sidecar:settings.gravity[2]",
         "stiffness of theta is 2.3544"),
    ],
)  # fmt: skip
def test_literal_off_by_a_millionth_is_read_and_measured(
    system: str, name: str, engine: str, address: str, message: str, tmp_path: Path
) -> None:
    sidecar = read_sidecar(MODELS / system / f"{name}.toml")
    place = next(b for b in bindings(prepared(system).system, sidecar) if b.address == address)
    wrong = with_literals(sidecar, {address: place.value * (1 + 1e-6)}, tmp_path)
    findings = audit(prepared(system), wrong, engine)
    literal = next(f for f in findings if f.kind == "literal")
    assert literal.severity == "finding"
    assert f"{address} is" in literal.message
    assert "relative error 1.0e-06" in literal.message
    file = tmp_path / place.place.file.name
    there = bindings(prepared(system).system, wrong)
    assert literal.location == next(source_line(b.place) for b in there if b.address == address)
    assert (literal.location.file, literal.location.line) == (str(file), place.place.line)
    assert literal.replacement == repr(place.correction)
    assert literal.expected == pytest.approx(place.value, rel=1e-12)
    assert literal.actual == pytest.approx(place.value * (1 + 1e-6), rel=1e-12)
    compiled = [f for f in severe(findings) if f.kind in ("inertia", "damping", "stiffness")]
    assert any(message in f.message for f in compiled), compiled


def test_literal_without_effect_on_motion_is_a_finding(tmp_path: Path) -> None:
    sidecar = read_sidecar(MODELS / "mass_spring_damper" / "mujoco.xml.toml")
    address = next(a for a in sidecar.bindings if a.endswith("diaginertia[0]"))
    value = next(
        b.value
        for b in bindings(prepared("mass_spring_damper").system, sidecar)
        if b.address == address
    )
    wrong = with_literals(sidecar, {address: value * 1.01}, tmp_path)
    findings = audit(prepared("mass_spring_damper"), wrong, "mujoco")
    assert [f.kind for f in severe(findings)] == ["literal"]


MASS, PENDULUM, PAIR = "mass_spring_damper", "simple_pendulum", "free_pair"
URDF = (MODELS / MASS / "robot.urdf").read_text()
INERTIAL = '<link name="mass">' + URDF.split('<link name="mass">')[1].split("</inertial>")[0]
BINDINGS = (MODELS / MASS / "robot.urdf.toml").read_text().partition("[bindings]")[2]
HINGE, SLIDE = 'name="theta" type="hinge"', 'name="x" type="slide"'
NO_LENGTH = ('springlength="0"', "")
LIMIT = ('lower="-100" upper="100"', 'lower="-0.01" upper="100"')
SPACE = "    space = pymunk.Space()\n"


@pytest.mark.parametrize(("file", "engine", "edits", "expected"), [
    (f"{DRUM}/mujoco_rolling.xml", "mujoco", [("5.555555555555555", "5.55556")],
     ["note rounded: rounded (relative error",
      "note inertia: the rounded numbers of the file explain it"]),
    (f"{DRUM}/mujoco_rolling.xml", "mujoco",
     [('solref="1e-6 0.5" solimp="0.9999 0.9999 0.001 0.5 2"', "")],
     ["constraint: equality rolling is soft: solref is MuJoCo's default",
      "inertia: inertia of x", "freedom: "]),
    (f"{DRUM}/mujoco.xml", "mujoco", [('gravity="0 0 -9.81"', 'gravity="0.1 0 -9.81"')],
     ["rest: acts on x at rest", "default: gravity is tilted: (0.1, 0, -9.81)"]),
    (f"{DRUM}/mujoco.xml", "mujoco", [('contype="0" conaffinity="0" mass="0"', 'mass="0"')],
     ["contact: touch during the motions", "default: ", *(f"{kind}: " for kind in
      ("stiffness", "damping", "inertia"))]),
    (f"{DRUM}/mujoco.xml", "mujoco", [('name="drum" pos="0 0 1"', 'name="drum" pos="0 2 1"')],
     ["pose: drum (body:drum), rod (centre:rod): off by up to 2 m from the equations' pose"]),
    (f"{DRUM}/mujoco.xml", "mujoco", [('axis="0 -1 0"', 'axis="1 0 0"')],
     ["pose: rod (centre:rod)", "default: ", "inertia: "]),
    (f"{DRUM}/mujoco.xml", "mujoco", [('rod = "centre:rod"', 'rod = "body:hand"')],
     ["frames: the model has no 'body:hand'; it has"]),
    (f"{DRUM}/mujoco.xml", "mujoco", [(HINGE, f'{HINGE} range="-30 30" limited="true"')],
     [f"note {BEYOND}: theta is limited to [-30, 30], and the motions stay between"]),
    (f"{MASS}/mujoco.xml", "mujoco", [("damping=", "margin=")],
     ["damping: damping of x is 0 in the model and", "binding: the binding can't be read"]),
    (f"{MASS}/mujoco.xml", "mujoco", [(SLIDE, f'{SLIDE} frictionloss="0.3"')],
     ["dry friction: frictionloss of x is 0.3; dry friction is not smooth",
      "friction: a friction of 0.3"]),
    (f"{MASS}/mujoco.xml", "mujoco", [('springref="0"', 'springref="0.05"')],
     ["rest: at rest in equilibrium", "default: the spring of x rests at 0.05"]),
    (f"{MASS}/robot.urdf", "mujoco", [LIMIT],
     ["joint limit: x is limited to [-0.01, 100]", "acceleration: "]),
    (f"{MASS}/robot.urdf", "pybullet", [LIMIT], ["joint limit: x is limited to [-0.01, 100]"]),
    (f"{MASS}/robot.urdf", "pybullet", [('friction="0"', 'friction="0.4"')],
     ["dry friction: <dynamics friction> of x is 0.4; PyBullet ignores it"]),
    (f"{MASS}/robot.urdf", "pybullet",
     [(f"{INERTIAL}</inertial>", '<link name="mass">'), (BINDINGS, "")],
     ["inertial: link mass moves and has no <inertial>", "inertia: "]),
    (f"{MASS}/space.py", "pymunk", [("STIFFNESS = ", "STIFFNESS = 1000 * ")],
     ["stiffness: stiffness of x is", "binding: "]),
    (f"{PENDULUM}/mujoco.xml", "mujoco", [(HINGE, f'{HINGE} armature="0.001"')],
     ["inertia: inertia of theta", "default: armature of theta adds an inertia of 0.001"]),
    (f"{PENDULUM}/mujoco.xml", "mujoco", [(HINGE, f'{HINGE} range="-2 2"')],
     ["joint limit: theta is limited to [-2, 2], and the motions reach", "acceleration: "]),
    (f"{PENDULUM}/mujoco.xml", "mujoco", [(HINGE, f'{HINGE} range="-90 90"')], []),
    (f"{PENDULUM}/space.py", "pymunk", [(SPACE, f"{SPACE}    space.damping = 0.99\n")],
     ["default: Space.damping is 0.99", "damping: damping of theta is 0.00"]),
    (f"{PENDULUM}/space.py", "pymunk", [("rod.error_bias = 1e-10", "pass")],
     ["note constraint: error_bias of a PinJoint is pymunk's default"]),
    # Without a length, the tendon's own is the intended one, unless a spring moves the joint.
    (f"{PAIR}/mujoco.xml", "mujoco", [NO_LENGTH], ["note default: sets no springlength"]),
    (f"{PAIR}/mujoco.xml", "mujoco",
     [NO_LENGTH, ('name="x2" type="slide"', 'name="x2" type="slide" springref="0.1"')],
     ["rest: a force of 3.8", "default: sets no springlength: its spring rests at 0.1"]),
])  # fmt: skip
def test_edit_is_reported_by_its_kinds(
    audit_copy: AuditCopy, file: str, engine: str, edits: list[tuple[str, str]], expected: list[str]
) -> None:
    findings = audit_copy(*file.split("/"), engine, *edits)
    lines = [f"{'note ' * (f.severity == 'note')}{f.kind}: {f.message}" for f in findings]
    kinds = [line.split(": ")[0] for line in expected]
    for kind, line in zip(kinds, expected, strict=True):
        text = line.removeprefix(f"{kind}: ")
        assert any(each.startswith(f"{kind}: ") and text in each for each in lines), lines
    assert {f.kind for f in severe(findings)} <= set(kinds)
    limits = [f.location for f in findings if f.kind == "joint limit"]
    assert all(place is not None and place.line for place in limits)


class Stiffening(LoadedModel):
    """The pendulum with a spring that stiffens far from rest."""

    coordinates, step, integrator = ("theta",), 0.002, "euler"

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return 1, 1

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        places, speeds = [], []
        for i in range(n):
            assert not isinstance(force, StateForce)
            push = 0.0 if force is None else force[:, i]
            far = np.where(np.abs(q) > 0.8, 0.1, 0.0)
            v = v + h * (-(9.81 / 0.75) * np.sin(q) - far + push / (0.45 * 0.75**2))
            q = q + h * v
            places.append(q)
            speeds.append(v)
        return np.stack(places, axis=1), np.stack(speeds, axis=1)


class Stepwise(Stiffening):
    """An engine whose accelerations depend on the step."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        assert not isinstance(force, StateForce)
        pushed = 0.0 if force is None else force[:, 0]
        rates = np.stack([v + (i + 1) * h * (np.sin(1 / h) + pushed) for i in range(n)], axis=1)
        return np.repeat(q[:, None], n, axis=1), rates


def compiled_findings(model: LoadedModel) -> list[AuditFinding]:
    """Return the findings of a model of the pendulum, about its first equilibrium."""
    sidecar = read_sidecar(MODELS / "simple_pendulum" / "mujoco.xml.toml")
    task = model_task(prepared("simple_pendulum"), "mujoco", sidecar)
    task = task.with_target(equilibria=task.target.equilibria[:1])
    map_ = coordinate_map(task.target.system, sidecar, ("theta",))
    return list(Compiled.prepare(task, model, map_).findings())


def test_wrong_nonlinear_term_is_reported_at_random_states() -> None:
    """Catch a fault that no linearization shows."""
    assert [f.kind for f in severe(compiled_findings(Stiffening()))] == ["acceleration"]


def test_findings_survive_json_and_print_as_lines(audit_copy: AuditCopy, tmp_path: Path) -> None:
    audit_copy("mass_spring_damper", "robot.urdf", "mujoco", ('damping="', 'damping="1'))
    sidecar = read_sidecar(tmp_path / "robot.urdf.toml")
    task = model_task(prepared("mass_spring_damper"), "mujoco", sidecar)
    records = audit_declared(task).findings
    read = msgspec.json.decode(msgspec.json.encode(records), type=tuple[AuditFinding, ...])
    assert read == records
    lines = audit_lines(records)
    assert any(one.startswith("finding  XC122 damping of x is 10.9 in the model") for one in lines)
    assert lines[-1].startswith("note")
    assert audit_lines([]) == ["ok: literals and compiled terms match the equations"]


def test_accelerations_without_limit_are_unresolved() -> None:
    findings = compiled_findings(Stepwise())
    assert "can't resolve the accelerations at" in messages(findings, "unresolved", "note")
    assert messages(findings, "acceleration") == ""


def test_thousands_of_invalid_bindings_are_summarized(tmp_path: Path) -> None:
    system = load_system(builtin() / "mass_spring_damper")
    (tmp_path / "m.py").write_text("MASS = 1.3\n")
    lines = [f'NO_{i} = "m"' for i in range(3000)]
    head = ['engines = ["pymunk"]', "[bindings]", 'MASS = "m"']
    (tmp_path / "m.py.toml").write_text("\n".join([*head, *lines]))
    began = time.process_time()
    valid, problems = declared_bindings(system, read_sidecar(tmp_path / "m.py.toml"))
    assert time.process_time() - began < 10
    assert [binding.address for binding in valid] == ["MASS"]
    assert len(problems) == 11
    assert problems[-1].message == (
        "2990 more bindings were not checked, after 10 unreadable ones; fix these first"
    )


DATA = Path(pybullet_data.getDataPath())


@pytest.mark.parametrize(("old", "new", "expected"), [
    ('damping="0.7"', 'damping="0.75"', "damping of lift is 0.75 in the model and 0.7 in the"),
    ('iyy="0.018"', 'iyy="0.02"', "inertia of lift is 0.1375 in the model and 0.1355 in the"),
    ("0.02 0 -0.3", "0.12 0 -0.3", "a force of -1.67832 acts on lift at rest where lift = 0.8"),
])  # fmt: skip
def test_wrong_number_is_reported_by_its_term(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(ARM)
    copy.write_text(ARM.replace(old, new))
    task = model_task(prepare_tree(file, states=8), "mujoco")
    assert not [one for one in audit_terms(task).findings if one.severity == "finding"]
    findings = audit_terms(task.with_file(copy)).findings
    messages = [one.message for one in findings if one.severity == "finding"]
    assert any(message.startswith(expected) for message in messages), messages


def test_audit_command_reports_massless_inertia_in_mujoco(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, "arm.urdf", TIPPED)
    assert main(["audit", str(file), "--engine", "mujoco", "--jobs", "1"]) == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "inertia of hinge is" in out
    assert "in the model and" in out


@pytest.mark.slow
def test_large_robot_is_compared_by_accelerations_only() -> None:
    (note,) = audit_terms(
        model_task(prepare_tree(DATA / "a1" / "a1.urdf", floating=True, states=4), "mujoco")
    ).findings
    assert note.severity == "note"
    assert "18 coordinates are not compared one by one" in note.message


def test_file_rejected_by_an_engine_keeps_its_reading_findings(tmp_path: Path) -> None:
    """Use an inertia that no body can have, which MuJoCo rejects."""
    file = written(tmp_path, "arm.urdf", ARM.replace('iyy="0.018"', 'iyy="0.028"'))
    (result,) = audits([file], Options(engines=("mujoco",)))
    assert not result.failure
    inertia, note = (row for row in result.findings if row.severity != "advice")
    assert inertia.code == "XC107"
    assert note.severity == "note"
    assert note.message.startswith("its compiled terms are not compared: ")


ROBOT = """<mujoco><compiler angle="radian"/><option cone="{cone}"/><worldbody>
<geom name="floor" type="plane" size="5 5 1" friction="0.4"/>
<body name="base" pos="0 0 0.3"><freejoint/><geom name="pad" size="0.1" mass="2" friction="0.9"/>
<geom name="shell" size="0.2" mass="0" contype="0" conaffinity="0"/>
<body name="arm" pos="0 0 0.2"><joint name="lift" axis="0 1 0" range="-1 1" solreflimit="0.02 0.3"/>
<geom name="bar" type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1" priority="1"
 friction="0.2"/></body></body></worldbody>
<actuator><position name="servo" joint="lift" kp="50" kv="1" forcerange="-4 4"/></actuator>
</mujoco>"""


def acting(folder: Path, cone: str = "pyramidal") -> dict[tuple[str, str], ActingQuantity]:
    file = folder / "robot.xml"
    file.write_text(ROBOT.format(cone=cone))
    result = audit_acting(model_task(prepare_tree(file), "mujoco"))
    return {(one.subject, one.quantity): one for one in result.acting}


def test_each_pair_has_its_friction_and_its_rule(tmp_path: Path) -> None:
    """Catch a lost rule: the larger of two, a higher priority, no contact, a pyramid."""
    rows = acting(tmp_path)
    pad, bar = rows["floor with pad", "friction"], rows["floor with bar", "friction"]
    assert (pad.value, pad.rule) == (0.9, "the larger of 0.4 and 0.9")
    assert (bar.value, bar.rule) == (0.2, "of the higher priority, of 0.4 and 0.2")
    assert not [one for one in rows if "shell" in one[0]]
    across = rows["floor with pad", "friction at 45 degrees"].value
    assert across == pytest.approx(0.9 / 2**0.5)
    elliptic = acting(tmp_path, "elliptic")
    assert ("floor with pad", "friction at 45 degrees") not in elliptic
    assert elliptic["floor with pad", "restitution"].value == pytest.approx(0.135335, rel=1e-4)


def test_limits_and_drives_report_their_dynamics(tmp_path: Path) -> None:
    rows = acting(tmp_path)
    assert rows["limits of lift", "damping ratio"].value == pytest.approx(0.3)
    assert rows["limits of lift", "time constant"].value == pytest.approx(0.02)
    weight = rows["drive of lift", "share of force for weight"].value
    assert weight == pytest.approx(9.81 * 0.2 / 4)
    assert rows["drive of lift", "sag"].value == pytest.approx(9.81 * 0.2 / 50)
    assert (rows["drive of lift", "gain over unstable gain"].value or 1) < 1e-2


def test_limit_without_damping_has_no_time_constant(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    text = ROBOT.format(cone="elliptic")
    file.write_text(text.replace('solreflimit="0.02 0.3"', 'solreflimit="-400 0"'))
    result = audit_acting(model_task(prepare_tree(file), "mujoco"))
    rows = {(one.subject, one.quantity): one.value for one in result.acting}
    assert rows["limits of lift", "damping ratio"] == 0
    assert ("limits of lift", "time constant") not in rows


def test_command_prints_a_line_for_each_subject(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    acting(tmp_path)
    assert main(["audit", str(tmp_path / "robot.xml"), "--engine", "mujoco"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "acts as floor with pad: friction 0.9 (the larger of 0.4 and 0.9)," in out
    assert "acts as drive of lift: largest force 4 N m (the drive is clamped, before" in out
    assert " share of force for weight 0.4905 (as drawn)," in out
