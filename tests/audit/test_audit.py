"""The audit finds what is wrong in a model without a motion, and nothing in the built-in ones."""

from __future__ import annotations

import time
from pathlib import Path

import msgspec
import numpy as np
import pytest

from physics_crosscheck.harness.checks.audit import audit_declared, declared_bindings
from physics_crosscheck.harness.checks.compiled_terms import Compiled
from physics_crosscheck.harness.checks.findings import source_line
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.protocol import Force, LoadedModel, StateForce
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.harness.records.finding import BEYOND, AuditFinding
from physics_crosscheck.harness.results.failure import audit_lines
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.audit.models import MODELS, Look, audit, grave, said
from tests.physics import physics as prepared

DRUM = "drum_pendulum"


@pytest.mark.slow
def test_a_built_in_model_has_no_finding() -> None:
    """Catch unresolved accelerations; findings of other models fail `pytest --crosscheck`."""
    name, engine = "mujoco_rolling.xml", "mujoco"
    found = audit(prepared(DRUM), read_sidecar(MODELS / DRUM / f"{name}.toml"), engine)
    assert grave(found) == []
    assert said(found, "unresolved", "note") == ""


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
def test_a_literal_off_by_a_millionth_is_read_and_measured(
    system: str, name: str, engine: str, address: str, message: str, tmp_path: Path
) -> None:
    sidecar = read_sidecar(MODELS / system / f"{name}.toml")
    place = next(b for b in bindings(prepared(system).system, sidecar) if b.address == address)
    wrong = with_literals(sidecar, {address: place.value * (1 + 1e-6)}, tmp_path)
    found = audit(prepared(system), wrong, engine)
    literal = next(f for f in found if f.kind == "literal")
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
    compiled = [f for f in grave(found) if f.kind in ("inertia", "damping", "stiffness")]
    assert any(message in f.message for f in compiled), compiled


def test_a_literal_that_no_motion_depends_on_is_a_finding_all_the_same(tmp_path: Path) -> None:
    sidecar = read_sidecar(MODELS / "mass_spring_damper" / "mujoco.xml.toml")
    address = next(a for a in sidecar.bindings if a.endswith("diaginertia[0]"))
    value = next(
        b.value
        for b in bindings(prepared("mass_spring_damper").system, sidecar)
        if b.address == address
    )
    wrong = with_literals(sidecar, {address: value * 1.01}, tmp_path)
    found = audit(prepared("mass_spring_damper"), wrong, "mujoco")
    assert [f.kind for f in grave(found)] == ["literal"]


def test_a_rounded_literal_is_a_note_and_so_is_what_it_does(look: Look) -> None:
    found = look("drum_pendulum", "mujoco_rolling.xml", "mujoco", ("5.555555555555555", "5.55556"))
    assert grave(found) == []
    assert "rounded (relative error" in said(found, "rounded", "note")
    assert "the rounded numbers of the file explain it" in said(found, "inertia", "note")


def test_a_missing_damper(look: Look) -> None:
    found = look("mass_spring_damper", "mujoco.xml", "mujoco", ("damping=", "margin="))
    assert "damping of x is 0 in the model and" in said(found, "damping")
    assert "the binding can't be read" in said(found, "binding")
    assert len(grave(found)) == 2


def test_an_armature_that_should_not_be_is_named_beside_the_inertia(look: Look) -> None:
    change = ('name="theta" type="hinge"', 'name="theta" type="hinge" armature="0.001"')
    found = look("simple_pendulum", "mujoco.xml", "mujoco", change)
    assert "inertia of theta" in said(found, "inertia")
    assert "armature of theta adds an inertia of 0.001" in said(found, "default")


def test_friction_is_told_from_damping_and_inertia(look: Look) -> None:
    change = ('name="x" type="slide"', 'name="x" type="slide" frictionloss="0.3"')
    found = look("mass_spring_damper", "mujoco.xml", "mujoco", change)
    assert "frictionloss of x is 0.3; dry friction is not smooth" in said(found, "dry friction")
    assert "a friction of 0.3" in said(found, "friction")
    assert {f.kind for f in grave(found)} <= {"dry friction", "friction"}


def test_a_joint_limit_that_the_motions_reach(look: Look) -> None:
    change = ('name="theta" type="hinge"', 'name="theta" type="hinge" range="-2 2"')
    found = look("simple_pendulum", "mujoco.xml", "mujoco", change)
    assert "theta is limited to [-2, 2], and the motions reach" in said(found, "joint limit")
    wide = (change[0], change[0] + ' range="-90 90"')
    assert grave(look("simple_pendulum", "mujoco.xml", "mujoco", wide)) == []


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_urdf_limit_that_the_motions_reach(look: Look, engine: str) -> None:
    change = ('lower="-100" upper="100"', 'lower="-0.01" upper="100"')
    found = look("mass_spring_damper", "robot.urdf", engine, change)
    assert "x is limited to [-0.01, 100]" in said(found, "joint limit")
    where = next(f.location for f in found if "is limited to" in f.message)
    assert where is not None
    assert where.line


def test_friction_that_pybullet_ignores(look: Look) -> None:
    change = ('friction="0"', 'friction="0.4"')
    found = look("mass_spring_damper", "robot.urdf", "pybullet", change)
    assert "<dynamics friction> of x is 0.4; PyBullet ignores it" in said(found, "dry friction")


def test_a_link_without_inertial(look: Look) -> None:
    text = (MODELS / "mass_spring_damper" / "robot.urdf").read_text()
    first = text.index("<inertial>", text.index('<link name="mass"'))
    gone = text[first : text.index("</inertial>", first) + len("</inertial>")]
    sidecar = (MODELS / "mass_spring_damper" / "robot.urdf.toml").read_text()
    bound = sidecar[sidecar.index("[bindings]") :]
    found = look(
        "mass_spring_damper",
        "robot.urdf",
        "pybullet",
        (text[first - 40 : first] + gone, text[first - 40 : first]),
        (bound, ""),
    )
    assert "link mass moves and has no <inertial>" in said(found, "inertial")


def test_a_tendon_without_springlength_is_named_where_it_pulls(look: Look) -> None:
    shifted = ('springlength="0"', "")
    found = look("free_pair", "mujoco.xml", "mujoco", shifted)
    assert grave(found) == []  # its length there is the one meant
    assert "sets no springlength" in said(found, "default", "note")
    ref = ('name="x2" type="slide"', 'name="x2" type="slide" springref="0.1"')
    found = look("free_pair", "mujoco.xml", "mujoco", shifted, ref)
    assert "a force of 3.8" in said(found, "rest")
    assert "sets no springlength: its spring rests at 0.1" in said(found, "default")


def test_a_spring_that_rests_elsewhere(look: Look) -> None:
    change = ('springref="0"', 'springref="0.05"')
    found = look("mass_spring_damper", "mujoco.xml", "mujoco", change)
    assert "at rest in equilibrium" in said(found, "rest")
    assert "the spring of x rests at 0.05" in said(found, "default")


def test_the_soft_equality_of_mujocos_default(look: Look) -> None:
    found = look(
        "drum_pendulum",
        "mujoco_rolling.xml",
        "mujoco",
        ('solref="1e-6 0.5" solimp="0.9999 0.9999 0.001 0.5 2"', ""),
    )
    assert "equality rolling is soft: solref is MuJoCo's default" in said(found, "constraint")
    assert "inertia of x" in said(found, "inertia")


def test_gravity_that_is_tilted(look: Look) -> None:
    change = ('gravity="0 0 -9.81"', 'gravity="0.1 0 -9.81"')
    found = look("drum_pendulum", "mujoco.xml", "mujoco", change)
    assert "acts on x at rest" in said(found, "rest")
    assert "gravity is tilted: (0.1, 0, -9.81)" in said(found, "default")


def test_geoms_that_touch(look: Look) -> None:
    change = ('contype="0" conaffinity="0" mass="0"', 'mass="0"')
    found = look("drum_pendulum", "mujoco.xml", "mujoco", change)
    assert "touch during the motions" in said(found, "contact")


def test_a_space_that_damps(look: Look) -> None:
    change = (
        "    space = pymunk.Space()\n",
        "    space = pymunk.Space()\n    space.damping = 0.99\n",
    )
    found = look("simple_pendulum", "space.py", "pymunk", change)
    assert "Space.damping is 0.99" in said(found, "default")
    assert "damping of theta is 0.00" in said(found, "damping")


def test_a_joint_with_pymunks_own_error_bias(look: Look) -> None:
    found = look("simple_pendulum", "space.py", "pymunk", ("rod.error_bias = 1e-10", "pass"))
    assert "error_bias of a PinJoint is pymunk's default" in said(found, "constraint", "note")


def test_a_wrong_nonlinear_term_shows_at_random_states(tmp_path: Path) -> None:
    """A spring that is stiff far out alone, which no linearization has."""

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
    found = list(
        Compiled.prepare(
            task, model, coordinate_map(task.target.system, sidecar, ("theta",))
        ).findings()
    )
    assert [f.kind for f in grave(found)] == ["acceleration"]


def test_records_are_json_and_lines_are_read(look: Look, tmp_path: Path) -> None:
    look("mass_spring_damper", "robot.urdf", "mujoco", ('damping="', 'damping="1'))
    sidecar = read_sidecar(tmp_path / "robot.urdf.toml")
    task = model_task(prepared("mass_spring_damper"), "mujoco", sidecar)
    records = audit_declared(task).findings
    read = msgspec.json.decode(msgspec.json.encode(records), type=tuple[AuditFinding, ...])
    assert read == records
    lines = audit_lines(records)
    assert any(one.startswith("finding  XC122 damping of x is 10.9 in the model") for one in lines)
    assert lines[-1].startswith("note")
    assert audit_lines([]) == ["ok: literals and compiled terms match the equations"]


def test_a_model_far_stiffer_than_meant_is_measured_with_shorter_steps(look: Look) -> None:
    found = look(
        "mass_spring_damper", "space.py", "pymunk", ("STIFFNESS = ", "STIFFNESS = 1000 * ")
    )
    assert "stiffness of x is" in said(found, "stiffness")


def test_what_has_no_limit_is_said_to_be_unresolved() -> None:
    """An engine whose accelerations depend on the step."""

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
    found = list(Compiled.prepare(task, model, map_).findings())
    assert "can't resolve the accelerations at" in said(found, "unresolved", "note")
    assert said(found, "acceleration") == ""


def test_thousands_of_bindings_that_mean_nothing_are_summed_up(tmp_path: Path) -> None:
    system = load_system(builtin() / "mass_spring_damper")
    (tmp_path / "m.py").write_text("MASS = 1.3\n")
    lines = [f'NO_{i} = "m"' for i in range(3000)]
    head = ['engines = ["pymunk"]', "[bindings]", 'MASS = "m"']
    (tmp_path / "m.py.toml").write_text("\n".join([*head, *lines]))
    began = time.process_time()
    found, lost = declared_bindings(system, read_sidecar(tmp_path / "m.py.toml"))
    assert time.process_time() - began < 10
    assert [binding.address for binding in found] == ["MASS"]
    assert len(lost) == 11
    assert lost[-1].message == (
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
def test_a_body_that_is_elsewhere_is_a_finding(
    look: Look, change: tuple[str, str], words: str
) -> None:
    found = look("drum_pendulum", "mujoco.xml", "mujoco", change)
    assert words in said(found, "pose") + said(found, "frames")


def test_a_stop_beyond_the_motions_is_noted(look: Look) -> None:
    stop = 'name="theta" type="hinge" range="-30 30" limited="true"'
    found = look("drum_pendulum", "mujoco.xml", "mujoco", ('name="theta" type="hinge"', stop))
    assert "theta is limited to [-30, 30], and the motions stay between" in said(
        found, BEYOND, "note"
    )
