"""Audits report planted faults of models, and nothing in the built-in models."""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import numpy as np
import pytest

from physics_crosscheck.engine import Force, LoadedModel, StateForce
from physics_crosscheck.harness.checks.audit import audit_declared, declared_bindings
from physics_crosscheck.harness.checks.compiled_terms import Compiled
from physics_crosscheck.harness.checks.findings import source_line
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.harness.records.finding import BEYOND
from physics_crosscheck.harness.results.failure import audit_lines
from physics_crosscheck.records import AuditFinding
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.audit.models import MODELS, AuditCopy, audit, messages, severe
from tests.physics import physics as prepared

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


def test_rounded_literal_and_its_effect_are_notes(audit_copy: AuditCopy) -> None:
    findings = audit_copy(
        "drum_pendulum", "mujoco_rolling.xml", "mujoco", ("5.555555555555555", "5.55556")
    )
    assert severe(findings) == []
    assert "rounded (relative error" in messages(findings, "rounded", "note")
    assert "the rounded numbers of the file explain it" in messages(findings, "inertia", "note")


def test_missing_damper_is_reported(audit_copy: AuditCopy) -> None:
    findings = audit_copy("mass_spring_damper", "mujoco.xml", "mujoco", ("damping=", "margin="))
    assert "damping of x is 0 in the model and" in messages(findings, "damping")
    assert "the binding can't be read" in messages(findings, "binding")
    assert len(severe(findings)) == 2


def test_unwanted_armature_is_named_with_the_inertia(audit_copy: AuditCopy) -> None:
    change = ('name="theta" type="hinge"', 'name="theta" type="hinge" armature="0.001"')
    findings = audit_copy("simple_pendulum", "mujoco.xml", "mujoco", change)
    assert "inertia of theta" in messages(findings, "inertia")
    assert "armature of theta adds an inertia of 0.001" in messages(findings, "default")


def test_friction_is_distinguished_from_damping_and_inertia(audit_copy: AuditCopy) -> None:
    change = ('name="x" type="slide"', 'name="x" type="slide" frictionloss="0.3"')
    findings = audit_copy("mass_spring_damper", "mujoco.xml", "mujoco", change)
    assert "frictionloss of x is 0.3; dry friction is not smooth" in messages(
        findings, "dry friction"
    )
    assert "a friction of 0.3" in messages(findings, "friction")
    assert {f.kind for f in severe(findings)} <= {"dry friction", "friction"}


def test_joint_limit_within_the_motions_is_reported(audit_copy: AuditCopy) -> None:
    change = ('name="theta" type="hinge"', 'name="theta" type="hinge" range="-2 2"')
    findings = audit_copy("simple_pendulum", "mujoco.xml", "mujoco", change)
    assert "theta is limited to [-2, 2], and the motions reach" in messages(findings, "joint limit")
    wide = (change[0], change[0] + ' range="-90 90"')
    assert severe(audit_copy("simple_pendulum", "mujoco.xml", "mujoco", wide)) == []


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_urdf_limit_within_the_motions_is_reported(audit_copy: AuditCopy, engine: str) -> None:
    change = ('lower="-100" upper="100"', 'lower="-0.01" upper="100"')
    findings = audit_copy("mass_spring_damper", "robot.urdf", engine, change)
    assert "x is limited to [-0.01, 100]" in messages(findings, "joint limit")
    where = next(f.location for f in findings if "is limited to" in f.message)
    assert where is not None
    assert where.line


def test_friction_ignored_by_pybullet_is_reported(audit_copy: AuditCopy) -> None:
    change = ('friction="0"', 'friction="0.4"')
    findings = audit_copy("mass_spring_damper", "robot.urdf", "pybullet", change)
    assert "<dynamics friction> of x is 0.4; PyBullet ignores it" in messages(
        findings, "dry friction"
    )


def test_link_without_inertial_is_reported(audit_copy: AuditCopy) -> None:
    text = (MODELS / "mass_spring_damper" / "robot.urdf").read_text()
    first = text.index("<inertial>", text.index('<link name="mass"'))
    gone = text[first : text.index("</inertial>", first) + len("</inertial>")]
    sidecar = (MODELS / "mass_spring_damper" / "robot.urdf.toml").read_text()
    bound = sidecar[sidecar.index("[bindings]") :]
    findings = audit_copy(
        "mass_spring_damper",
        "robot.urdf",
        "pybullet",
        (text[first - 40 : first] + gone, text[first - 40 : first]),
        (bound, ""),
    )
    assert "link mass moves and has no <inertial>" in messages(findings, "inertial")


def test_tendon_without_springlength_is_reported_if_it_pulls(audit_copy: AuditCopy) -> None:
    shifted = ('springlength="0"', "")
    findings = audit_copy("free_pair", "mujoco.xml", "mujoco", shifted)
    assert severe(findings) == []  # its length there is the intended one
    assert "sets no springlength" in messages(findings, "default", "note")
    ref = ('name="x2" type="slide"', 'name="x2" type="slide" springref="0.1"')
    findings = audit_copy("free_pair", "mujoco.xml", "mujoco", shifted, ref)
    assert "a force of 3.8" in messages(findings, "rest")
    assert "sets no springlength: its spring rests at 0.1" in messages(findings, "default")


def test_spring_with_wrong_rest_position_is_reported(audit_copy: AuditCopy) -> None:
    change = ('springref="0"', 'springref="0.05"')
    findings = audit_copy("mass_spring_damper", "mujoco.xml", "mujoco", change)
    assert "at rest in equilibrium" in messages(findings, "rest")
    assert "the spring of x rests at 0.05" in messages(findings, "default")


def test_soft_equality_of_mujoco_default_is_reported(audit_copy: AuditCopy) -> None:
    findings = audit_copy(
        "drum_pendulum",
        "mujoco_rolling.xml",
        "mujoco",
        ('solref="1e-6 0.5" solimp="0.9999 0.9999 0.001 0.5 2"', ""),
    )
    assert "equality rolling is soft: solref is MuJoCo's default" in messages(
        findings, "constraint"
    )
    assert "inertia of x" in messages(findings, "inertia")


def test_tilted_gravity_is_reported(audit_copy: AuditCopy) -> None:
    change = ('gravity="0 0 -9.81"', 'gravity="0.1 0 -9.81"')
    findings = audit_copy("drum_pendulum", "mujoco.xml", "mujoco", change)
    assert "acts on x at rest" in messages(findings, "rest")
    assert "gravity is tilted: (0.1, 0, -9.81)" in messages(findings, "default")


def test_touching_geoms_are_reported(audit_copy: AuditCopy) -> None:
    change = ('contype="0" conaffinity="0" mass="0"', 'mass="0"')
    findings = audit_copy("drum_pendulum", "mujoco.xml", "mujoco", change)
    assert "touch during the motions" in messages(findings, "contact")


def test_damping_of_a_space_is_reported(audit_copy: AuditCopy) -> None:
    change = (
        "    space = pymunk.Space()\n",
        "    space = pymunk.Space()\n    space.damping = 0.99\n",
    )
    findings = audit_copy("simple_pendulum", "space.py", "pymunk", change)
    assert "Space.damping is 0.99" in messages(findings, "default")
    assert "damping of theta is 0.00" in messages(findings, "damping")


def test_default_error_bias_of_a_pymunk_joint_is_noted(audit_copy: AuditCopy) -> None:
    findings = audit_copy(
        "simple_pendulum", "space.py", "pymunk", ("rod.error_bias = 1e-10", "pass")
    )
    assert "error_bias of a PinJoint is pymunk's default" in messages(
        findings, "constraint", "note"
    )


def test_wrong_nonlinear_term_is_reported_at_random_states(tmp_path: Path) -> None:
    """Catch a fault that no linearization shows: a spring that stiffens far from rest."""

    class Stiffening(LoadedModel):
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

    sidecar = read_sidecar(MODELS / "simple_pendulum" / "mujoco.xml.toml")
    task = model_task(prepared("simple_pendulum"), "mujoco", sidecar)
    task = task.with_target(equilibria=task.target.equilibria[:1])
    model = Stiffening()
    findings = list(
        Compiled.prepare(
            task, model, coordinate_map(task.target.system, sidecar, ("theta",))
        ).findings()
    )
    assert [f.kind for f in severe(findings)] == ["acceleration"]


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


def test_much_too_stiff_model_is_measured_with_shorter_steps(audit_copy: AuditCopy) -> None:
    findings = audit_copy(
        "mass_spring_damper", "space.py", "pymunk", ("STIFFNESS = ", "STIFFNESS = 1000 * ")
    )
    assert "stiffness of x is" in messages(findings, "stiffness")


def test_accelerations_without_limit_are_unresolved() -> None:
    """Use an engine whose accelerations depend on the step."""

    class Stepwise(LoadedModel):
        coordinates, step, integrator = ("theta",), 0.002, "euler"

        def exponents(self, varying_input: bool) -> tuple[int, int]:
            return 1, 1

        def rollout(
            self, q: Array, v: Array, h: float, n: int, force: Force, every: int
        ) -> tuple[Array, Array]:
            assert not isinstance(force, StateForce)
            pushed = 0.0 if force is None else force[:, 0]
            rates = np.stack([v + (i + 1) * h * (np.sin(1 / h) + pushed) for i in range(n)], axis=1)
            return np.repeat(q[:, None], n, axis=1), rates

    sidecar = read_sidecar(MODELS / "simple_pendulum" / "mujoco.xml.toml")
    task = model_task(prepared("simple_pendulum"), "mujoco", sidecar)
    map_ = coordinate_map(task.target.system, sidecar, ("theta",))
    model = Stepwise()
    findings = list(Compiled.prepare(task, model, map_).findings())
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


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('body name="drum" pos="0 0 1"', 'body name="drum" pos="0 2 1"'),
         "drum (body:drum), rod (centre:rod): off by up to 2 m from the equations' pose"),
        (('axis="0 -1 0"', 'axis="1 0 0"'), "rod (centre:rod)"),
        (('rod = "centre:rod"', 'rod = "body:hand"'), "the model has no 'body:hand'; it has"),
    ],
)  # fmt: skip
def test_misplaced_body_is_a_finding(
    audit_copy: AuditCopy, change: tuple[str, str], words: str
) -> None:
    findings = audit_copy("drum_pendulum", "mujoco.xml", "mujoco", change)
    assert words in messages(findings, "pose") + messages(findings, "frames")


def test_joint_limit_beyond_the_motions_is_noted(audit_copy: AuditCopy) -> None:
    limit = 'name="theta" type="hinge" range="-30 30" limited="true"'
    findings = audit_copy(
        "drum_pendulum", "mujoco.xml", "mujoco", ('name="theta" type="hinge"', limit)
    )
    assert "theta is limited to [-30, 30], and the motions stay between" in messages(
        findings, BEYOND, "note"
    )
