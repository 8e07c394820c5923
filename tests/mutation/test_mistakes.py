"""Known mistakes: planted in every model that allows them, and in no other."""

import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.commands.mutation.mistakes import (
    Edit,
    Mistake,
    Subject,
    known_mistakes,
)
from physics_crosscheck.harness.commands.mutation.mutate import faults_of, mutate, mutated
from physics_crosscheck.harness.commands.mutation.survey import FAULTS, MutationError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict
from physics_crosscheck.harness.run import Options
from physics_crosscheck.records import CauseId
from tests.mutation.conftest import make_task, rows, subject
from tests.physics import physics
from tests.standing import keep_default_engines, shorten_scenarios

CopyModel = Callable[..., Sidecar]

MSD, PENDULUM, ROLLING = "mass_spring_damper", "simple_pendulum", "mujoco_rolling.xml"


@pytest.fixture
def copy_model(tmp_path: Path) -> CopyModel:
    """Return a function that copies a built-in model with texts replaced."""

    def make(system: str, model: str, *edits: tuple[str, str, str]) -> Sidecar:
        folder = tmp_path / "copy"
        shutil.copytree(builtin() / system, folder, dirs_exist_ok=True)
        keep_default_engines(folder)
        shorten_scenarios(folder)
        for name, old, new in edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return read_sidecar(folder / f"{model}.toml")

    return make


def mistakes_named(words: str, *given: Any, **more: Any) -> list[tuple[Subject, Mistake]]:
    """Return the mistakes of a model whose names match a pattern."""
    model = subject(*given, **more)
    return [(model, m) for m in known_mistakes(model) if re.search(words, m.name)]


def texts_of(pairs: Sequence[tuple[Subject, Mistake]], tmp_path: Path) -> list[tuple[Mistake, str]]:
    return [
        (m, m.edit.plant(s.task, tmp_path / str(i)).file.read_text())
        for i, (s, m) in enumerate(pairs)
    ]


@pytest.mark.slow
def test_known_mistakes_are_caught_and_named(few_segments: None) -> None:
    alike = {*FAULTS, "gravity 9.80665", "gravity off", "gravity along x"}
    results = rows(make_task(PENDULUM, "mujoco.xml"), lambda fault: fault.name not in alike)
    assert {r.name for r in results if r.verdict is FaultVerdict.NAMED} == {
        "axis flipped", "base moved", "plane of motion turned", "gravity 9.8", "gravity along y",
        "friction left in", "damping left in", "armature left in",
    }  # fmt: skip
    others = {(r.name, str(r.verdict)) for r in results if r.verdict is not FaultVerdict.NAMED}
    # With inputs on the joint, the mirrored mechanism moves alike; only its frames differ.
    assert others <= {
        ("gravity along y", "untested"),
        ("another time step", "agrees"),
        ("another integrator", "agrees"),
    }
    assert all(0 < (r.first_caught or 0) < 1e-3 for r in results if r.verdict is FaultVerdict.NAMED)


def test_changed_step_or_integrator_agrees_with_another_global_error(few_segments: None) -> None:
    results = rows(make_task(MSD, "mujoco.xml"), lambda fault: fault.sound)
    assert [(r.name, r.kind, r.verdict) for r in results] == [
        ("another time step", FaultKind.NONE, FaultVerdict.AGREES),
        ("another integrator", FaultKind.NONE, FaultVerdict.AGREES),
    ]
    before, after = (float(n) for n in re.findall(r"([\d.]+) %", results[0].message))
    assert 1.8 < after / before < 2.2  # of first order


@pytest.mark.slow
def test_all_faults_of_a_folder_are_tried_with_literals_first(copy_model: CopyModel) -> None:
    if engines()["pymunk"].version() is None:
        pytest.skip("pymunk is not installed")
    reported: list[tuple[int, int]] = []

    def progress(done: int, total: int, _: object) -> None:
        reported.append((done, total))

    names = ("STIFFNESS", "DAMPING")
    unbound = (("space.py.toml", f'{name} = "', f'# {name} = "') for name in names)
    folder = copy_model(MSD, "space.py", *unbound).model.parent
    results = mutate([folder], Options(engines=("pymunk",), jobs=2), progress)
    assert [r.location for r in results if r.kind is FaultKind.LITERAL] == ["MASS"] * len(FAULTS)
    assert [r.name for r in results if r.kind is not FaultKind.LITERAL] == [
        "a rest offset",
        "Space.damping left in",
        "another time step",
    ]
    assert [done for done, _ in reported] == list(range(1, len(results) + 1))
    assert reported[-1] == (len(results), len(results))
    assert not any(r.verdict is FaultVerdict.MISSED for r in results)
    assert {r.verdict for r in results if r.name == "1e-6"} == {FaultVerdict.NAMED}


@pytest.mark.slow
def test_mistake_with_an_unexpected_cause_is_caught_but_not_named(few_segments: None) -> None:
    task = make_task(MSD, "mujoco.xml")
    friction = next(f for f in faults_of(task) if f.mistake.name == "friction left in")
    causes = frozenset({CauseId(kind="damping", subject=("x",))})
    row = mutated(replace(friction, mistake=replace(friction.mistake, causes=causes)))
    assert (row.verdict, row.message) == (FaultVerdict.CAUGHT, "joint[x]@frictionloss")
    sound = replace(friction, mistake=replace(friction.mistake, sound=True))
    assert mutated(sound).verdict is not FaultVerdict.AGREES
    unchanged = mutated(replace(friction, mistake=Mistake("nothing", "x", Edit())))
    assert unchanged.verdict is FaultVerdict.UNTESTED


def test_wrong_model_is_refused_with_its_name(few_segments: None, copy_model: CopyModel) -> None:
    sidecar = copy_model(MSD, "mujoco.xml", ("mujoco.xml", 'damping="0.9"', 'damping="0.91"'))
    with pytest.raises(MutationError, match=r"mujoco.xml: it differs from its equations already"):
        faults_of(make_task(MSD, "mujoco.xml", sidecar=sidecar))


@pytest.mark.slow
def test_model_without_bindings_still_has_known_mistakes(few_segments: None) -> None:
    task = make_task(MSD, "mujoco.xml")
    unbound_task = task.with_sidecar(replace(task.declared, bindings={}))
    faults = faults_of(unbound_task)
    assert all(fault.values is None for fault in faults)
    friction = next(f for f in faults if f.mistake.name == "friction left in")
    assert mutated(friction).verdict is FaultVerdict.NAMED


@pytest.mark.slow
def test_mass_that_hardly_moves_is_accepted() -> None:
    task = make_task("anchored_pair", "space.py", "pymunk")
    # Its velocity is only rounding of the positions, 1e-15 of the scale.
    faults_of(task.with_target(motions=physics("anchored_pair").motions))


def test_model_with_equalities_gets_no_change_of_the_integrator() -> None:
    mistakes = mistakes_named("^another", "drum_pendulum", ROLLING)
    assert [m.name for _, m in mistakes] == ["another time step"]


@pytest.mark.parametrize(
    ("words", "system", "model", "engine"),
    [
        ("axis|base|plane", MSD, "space.py", "pymunk"),
        ("degrees", MSD, "mujoco.xml", "mujoco"),
        ("exchanged", MSD, "mujoco.xml", "mujoco"),
        ("gravity", MSD, "space.py", "pymunk"),
        ("armature|friction|slop", MSD, "space.py", "pymunk"),
        ("rest offset|springlength", PENDULUM, "mujoco.xml", "mujoco"),
        ("left (out|on)|forgotten", MSD, "mujoco.xml", "mujoco"),
    ],
)
def test_family_that_does_not_apply_has_no_mistakes(
    words: str, system: str, model: str, engine: str
) -> None:
    assert not mistakes_named(words, system, model, engine)


def test_every_family_is_used_and_its_mistakes_are_unique() -> None:
    models = (
        ("drum_pendulum", ROLLING, "mujoco"),
        ("drum_pendulum", "robot.urdf", "pybullet"),
        ("free_pair", "mujoco.xml", "mujoco"),
        ("free_pair", "robot.urdf", "mujoco"),
        ("drum_pendulum", "space.py", "pymunk"),
    )
    names: set[str] = set()
    for model in models:
        mistakes = known_mistakes(subject(*model))
        assert len({(m.name, m.location) for m in mistakes}) == len(mistakes)
        assert all(m.causes or m.sound or m.audit_words for m in mistakes)
        names |= {m.name for m in mistakes}
    assert names >= {
        "axis flipped", "base moved", "plane of motion turned", "gravity 9.8", "gravity off",
        "gravity along x", "two constants exchanged", "a rest offset", "springlength left at -1",
        "friction left in", "armature left in", "soft equality, solref left out",
        "PyBullet's damping left on", "PyBullet's motors left on",
        "PyBullet's inertia flag forgotten", "Space.damping left in", "another time step",
        "another integrator",
    }  # fmt: skip


def test_wrong_setting_is_kept_in_copies_with_other_literals(tmp_path: Path) -> None:
    task = make_task(MSD, "robot.urdf", "pybullet")
    wrong = Edit(settings={"motors": True}).plant(task, tmp_path / "made").declared
    moved = with_literals(wrong, {"sidecar:settings.step": 0.001}, tmp_path / "moved")
    assert moved.spec("pybullet").settings["motors"] is True
    assert moved.spec("pybullet").settings["step"] == 0.001


def test_missing_angle_unit_is_a_mistake(copy_model: CopyModel, tmp_path: Path) -> None:
    sidecar = copy_model(
        "torsional_disc", "mujoco.xml", ("mujoco.xml", 'springref="0"', 'springref="0.4"')
    )
    mistakes = mistakes_named("degrees", "torsional_disc", "mujoco.xml", sidecar=sidecar)
    ((mistake, text),) = texts_of(mistakes, tmp_path)
    assert "offset force on theta" in map(str, mistake.causes)
    assert text == sidecar.model.read_text().replace(' angle="radian"', "")


def test_soft_equality_loses_only_its_two_attributes(tmp_path: Path) -> None:
    mistakes = mistakes_named("left out", "drum_pendulum", ROLLING)
    ((_, text),) = texts_of(mistakes, tmp_path)
    before = mistakes[0][0].task.declared.model.read_text()
    assert text == re.sub(r'\s+solref="1e-6 0.5" solimp="[\d. ]+"', "", before) != before


def test_constants_are_exchanged_in_every_literal(tmp_path: Path) -> None:
    mistakes = mistakes_named("exchanged", "anchored_pair", "mujoco.xml")
    texts = {m.location: text for m, text in texts_of(mistakes, tmp_path)}
    assert set(texts) == {"m1, m2", "k1, k2"}
    assert re.findall(r'stiffness="([\d.]+)"', texts["k1, k2"]) == ["70.0", "55.0"]
    assert re.findall(r' mass="(0.9|1.6)"', texts["m1, m2"]) == ["0.9", "1.6"]


@pytest.mark.parametrize(
    ("model", "engine", "literals"),
    [
        ("mujoco.xml", "mujoco", {"option@gravity[2]": -9.8}),
        ("robot.urdf", "pybullet", {"sidecar:settings.gravity[2]": -9.8}),
        ("space.py", "pymunk", {"GRAVITY": 9.8}),
    ],
)
def test_gravity_is_changed_where_the_model_states_it(
    model: str, engine: str, literals: dict[str, float]
) -> None:
    ((_, mistake),) = mistakes_named(r"gravity 9\.8$", PENDULUM, model, engine)
    assert mistake.edit.literals == literals


def test_bound_armature_is_not_added_again() -> None:
    mistakes = mistakes_named("armature", "drum_pendulum", "mujoco.xml")
    assert [m.location for _, m in mistakes] == ["theta"]


FLOOR = """space.gravity = (0, 0)
    space.collision_slop = 0.001
    ball = pymunk.Body(1, 0.1)
    ball.position = (5, 0.1)
    floor = pymunk.Segment(space.static_body, (4, 0), (6, 0), 0)
    space.add(ball, pymunk.Circle(ball, 0.1), floor)
"""


def test_large_slop_is_named_if_shapes_touch(copy_model: CopyModel, few_segments: None) -> None:
    """Catch a default that no motion shows, and that whole steps show."""
    sidecar = copy_model(MSD, "space.py", ("space.py", "space.gravity = (0, 0)\n", FLOOR))
    [row] = rows(
        make_task(MSD, "space.py", "pymunk", sidecar), lambda fault: fault.name == "slop of 0.1 m"
    )
    assert row.verdict is FaultVerdict.NAMED
    assert row.message == "Space.collision_slop is 0.1; the file states 0.001"
    assert not mistakes_named("slop", MSD, "space.py", "pymunk")
