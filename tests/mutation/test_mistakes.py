"""Known mistakes: made where a model has a place for them, and nowhere else."""

import re
import shutil
from dataclasses import replace

import pytest
from harness.mutation.mistakes.soft import soft

from harness.engines.registry import engines
from harness.files.bindings import with_literals
from harness.files.folders import builtin
from harness.files.sidecar import read_sidecar
from harness.mutation.mistakes import Edit, Mistake, known_mistakes
from harness.mutation.mistakes.axes import axes
from harness.mutation.mistakes.degrees import degrees
from harness.mutation.mistakes.exchanges import exchanges
from harness.mutation.mistakes.gravity import gravity
from harness.mutation.mistakes.left_in import left_in
from harness.mutation.mistakes.rests import rests
from harness.mutation.mistakes.steps import steps
from harness.mutation.mutate import FAULTS, MutationError, MutationTask, mutate, mutated, survey
from harness.run import Options
from tests.mutation.conftest import inquiry, physics, rows, subject

MSD, PENDULUM, ROLLING = "mass_spring_damper", "simple_pendulum", "mujoco_rolling.xml"


def is_known(fault):
    return fault.name not in FAULTS


@pytest.fixture
def copied(tmp_path):
    """A copy of a built-in model with texts replaced, as a sidecar."""

    def make(system, model, *edits):
        folder = tmp_path / "copy"
        shutil.copytree(builtin() / system, folder, dirs_exist_ok=True)
        for name, old, new in edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return read_sidecar(folder / f"{model}.toml")

    return make


def edited(found, tmp_path):
    """The text of each mistake's copy."""
    return [
        (m, m.edit.made(s.task.sidecar, s.task.engine, tmp_path / str(i)).model.read_text())
        for i, (s, m) in enumerate(found)
    ]


@pytest.mark.parametrize(
    ("system", "names"),
    [
        (MSD, {"gravity along x", "a rest offset", "friction left in", "armature left in"}),
        (PENDULUM, {"gravity 9.8", "gravity 9.80665", "gravity off", "gravity along x",
                    "gravity along y", "friction left in", "damping left in",
                    "armature left in"}),
    ],
)  # fmt: skip
def test_known_mistakes_are_caught_and_named(system, names, few):
    found = rows(inquiry(system, "mujoco.xml"), is_known)
    assert {r.name for r in found if r.verdict == "named"} == names
    others = {(r.name, r.verdict) for r in found if r.verdict != "named"}
    # With its inputs on the joint, the mechanism in the mirror moves alike.
    assert others <= {
        ("axis flipped", "unseen"),
        ("gravity along y", "unseen"),
        ("another time step", "agrees"),
        ("another integrator", "agrees"),
    }
    assert all(0 < r.first_caught < 1e-3 for r in found if r.verdict == "named")


def test_another_step_or_integrator_agrees_and_is_told_by_its_raw_error(few):
    found = rows(inquiry(MSD, "mujoco.xml"), lambda fault: fault.sound)
    assert [(r.name, r.kind, r.verdict) for r in found] == [
        ("another time step", "no mistake", "agrees"),
        ("another integrator", "no mistake", "agrees"),
    ]
    before, after = (float(n) for n in re.findall(r"([\d.]+)%", found[0].told))
    assert 1.8 < after / before < 2.2  # of first order


def test_a_folder_is_tried_whole_literals_first_and_progress_ends_with_the_last():
    if engines()["pymunk"].version() is None:
        pytest.skip("pymunk is not installed")
    told = []
    options = Options(("pymunk",), jobs=2)
    found = mutate([builtin() / MSD], options, lambda *counts: told.append(counts[:2]))
    assert [r.place for r in found if r.kind == "literal"] == [
        name for name in ("MASS", "STIFFNESS", "DAMPING") for _ in FAULTS
    ]
    assert [r.name for r in found if r.kind != "literal"] == [
        "a rest offset",
        "Space.damping left in",
        "another time step",
    ]
    assert [done for done, _ in told] == list(range(1, len(found) + 1))
    assert told[-1] == (len(found), len(found))
    assert not any(r.verdict == "missed" for r in found)


def test_a_mistake_told_by_another_name_is_caught_but_not_named(few):
    task = inquiry(MSD, "mujoco.xml")
    known = survey(task)
    friction = next(f for f in known.faults if f.name == "friction left in")
    wrong = replace(friction, causes=frozenset({"damping on x"}))
    row = mutated(MutationTask(task, known, wrong))
    assert (row.verdict, row.told) == ("caught", "joint[x]@frictionloss")
    taken_for_sound = mutated(MutationTask(task, known, replace(friction, sound=True)))
    assert taken_for_sound.verdict != "agrees"


def test_what_changes_nothing_is_unseen(few):
    task = inquiry(MSD, "mujoco.xml")
    known = survey(task)
    row = mutated(MutationTask(task, known, Mistake("nothing", "x", Edit())))
    assert row.verdict == "unseen"


def test_a_model_that_is_wrong_to_begin_with_is_refused_by_its_name(few, copied):
    sidecar = copied(MSD, "mujoco.xml", ("mujoco.xml", 'damping="0.9"', 'damping="0.91"'))
    with pytest.raises(MutationError, match=r"mujoco.xml: it differs from its equations already"):
        survey(inquiry(MSD, "mujoco.xml", sidecar=sidecar))


def test_a_model_without_bindings_has_its_known_mistakes_all_the_same(few):
    task = inquiry(MSD, "mujoco.xml")
    bare = replace(task, sidecar=replace(task.sidecar, bindings={}))
    known = survey(bare)
    assert known.addresses == ()
    friction = next(f for f in known.faults if f.name == "friction left in")
    assert mutated(MutationTask(bare, known, friction)).verdict == "named"


def test_a_mass_that_hardly_moves_is_not_taken_for_a_wrong_one():
    task = inquiry("anchored_pair", "space.py", "pymunk")
    # Of 1e-15 of the scale, rounding of the positions alone makes its velocity.
    survey(replace(task, motions=physics("anchored_pair").motions))


def test_no_other_integrator_is_promised_where_equalities_need_euler():
    found = [m.name for m in steps(subject("drum_pendulum", ROLLING))]
    assert found == ["another time step"]


@pytest.mark.parametrize(
    ("family", "system", "model", "engine"),
    [
        (axes, MSD, "space.py", "pymunk"),
        (degrees, MSD, "mujoco.xml", "mujoco"),
        (exchanges, MSD, "mujoco.xml", "mujoco"),
        (gravity, MSD, "space.py", "pymunk"),
        (left_in, MSD, "space.py", "pymunk"),
        (rests, PENDULUM, "mujoco.xml", "mujoco"),
        (soft, MSD, "mujoco.xml", "mujoco"),
    ],
)
def test_a_family_that_does_not_apply_makes_nothing(family, system, model, engine):
    assert not list(family(subject(system, model, engine)))


def test_every_family_is_made_somewhere_and_each_mistake_once():
    models = (
        ("drum_pendulum", ROLLING, "mujoco"),
        ("drum_pendulum", "robot.urdf", "pybullet"),
        ("free_pair", "mujoco.xml", "mujoco"),
        ("free_pair", "robot.urdf", "mujoco"),
        ("drum_pendulum", "space.py", "pymunk"),
    )
    names = set()
    for model in models:
        found = known_mistakes(subject(*model))
        assert len({(m.name, m.place) for m in found}) == len(found)
        assert all(m.causes or m.sound for m in found)
        names |= {m.name for m in found}
    assert names >= {
        "axis flipped",
        "gravity 9.8",
        "gravity off",
        "gravity along x",
        "two constants exchanged",
        "a rest offset",
        "springlength left at -1",
        "friction left in",
        "armature left in",
        "soft equality, solref left out",
        "PyBullet's damping left on",
        "PyBullet's motors left on",
        "PyBullet's inertia flag forgotten",
        "Space.damping left in",
        "another time step",
        "another integrator",
    }


def test_a_setting_that_is_a_mistake_stays_in_copies_with_other_literals(tmp_path):
    task = inquiry(MSD, "robot.urdf", "pybullet")
    made = Edit(settings={"motors": True}).made(task.sidecar, "pybullet", tmp_path / "made")
    moved = with_literals(made, {"sidecar:settings.step": 0.001}, tmp_path / "moved")
    assert moved.spec("pybullet").settings["motors"] is True
    assert moved.spec("pybullet").settings["step"] == 0.001


def test_angles_without_their_unit_are_a_mistake_where_there_is_one(copied, tmp_path):
    sidecar = copied(
        "torsional_disc", "mujoco.xml", ("mujoco.xml", 'springref="0"', 'springref="0.4"')
    )
    s = subject("torsional_disc", "mujoco.xml", sidecar=sidecar)
    ((mistake, text),) = edited([(s, m) for m in degrees(s)], tmp_path)
    assert "offset force on theta" in mistake.causes
    assert text == sidecar.model.read_text().replace(' angle="radian"', "")


def test_a_soft_equality_loses_its_two_attributes_alone(tmp_path):
    s = subject("drum_pendulum", ROLLING)
    ((_, text),) = edited([(s, m) for m in soft(s)], tmp_path)
    before = s.task.sidecar.model.read_text()
    assert text == re.sub(r'\s+solref="1e-6 0.5" solimp="[\d. ]+"', "", before) != before


def test_constants_are_exchanged_in_every_literal(tmp_path):
    s = subject("anchored_pair", "mujoco.xml")
    texts = {m.place: text for m, text in edited([(s, m) for m in exchanges(s)], tmp_path)}
    assert set(texts) == {"m1, m2", "k1, k2"}
    assert re.findall(r'stiffness="([\d.]+)"', texts["k1, k2"]) == ["70.0", "55.0"]
    assert re.findall(r' mass="(0.9|1.6)"', texts["m1, m2"]) == ["0.9", "1.6"]


def test_gravity_is_changed_where_the_model_states_it():
    literal = next(m for m in gravity(subject(PENDULUM, "mujoco.xml")))
    assert literal.edit.literals == {"option@gravity[2]": -9.8}
    setting = next(m for m in gravity(subject(PENDULUM, "robot.urdf", "pybullet")))
    assert setting.edit.literals == {"sidecar:settings.gravity[2]": -9.8}
    named = next(m for m in gravity(subject(PENDULUM, "space.py", "pymunk")))
    assert named.edit.literals == {"GRAVITY": 9.8}


def test_an_armature_that_stands_for_a_constant_is_not_made_again():
    found = [m for m in left_in(subject("drum_pendulum", "mujoco.xml")) if "armature" in m.name]
    assert [m.place for m in found] == ["theta"]
