"""Kinds of change to a system and its models: each has its own status and message."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from typing import Any

import msgspec
import pytest

from physics_crosscheck.harness.baseline.store import read_baseline, write_baseline
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.diff import Status
from tests.gate.conftest import SYSTEM, Repository
from tests.standing import keep_default_engines, shorten_scenarios, without

CHANGED, WITHIN, IMPROVED = Status.CHANGED, Status.WITHIN, Status.IMPROVED
NOT_RUN, NEW, GONE, SAME = Status.NOT_RUN, Status.NEW, Status.GONE, Status.SAME


def _absent(_: object) -> None:
    """The version of an engine that is not installed."""


def seen(found: GateResult, model: str) -> tuple[set[Status], set[str], str]:
    """Statuses and kinds of the cases of a model, and all their messages."""
    mine = [c for c in found.changes if c.id.model == model]
    sentences = " | ".join(sentence for c in mine for sentence in c.messages)
    return {c.status for c in mine}, {kind for c in mine for kind in c.kinds}, sentences


MODEL_CHANGES: list[tuple[str, str, str, str, Any, set[str], str]] = [
    # What moves nothing.
    ("a comment in MJCF", "mujoco.xml", "<worldbody>", "<!-- moved --><worldbody>",
     WITHIN, {"text"}, ""),
    ("a number written otherwise", "robot.urdf", ">47.0<", ">4.7e1<", WITHIN, {"text"}, ""),
    ("a comment in Python", "space.py", "MASS = 1.3  # kg", "MASS = 1.3  # kilograms",
     WITHIN, {"text"}, ""),
    ("a comment in a sidecar", "space.py.toml", "# A Space", "# Note that a Space",
     WITHIN, {"text"}, ""),
    ("a solver that has nothing to solve", "mujoco.xml", 'jacobian="dense"', 'iterations="7"',
     WITHIN, {"text"}, ""),
    # What moves the model.
    ("a constant by 1e-6 in MJCF", "mujoco.xml", '"47.0"', '"47.000047"',
     CHANGED, {"model"}, "the motion implies k 47 -> 47.000047"),
    ("a constant by 1 % in a URDF", "robot.urdf", 'mass value="1.3"', 'mass value="1.313"',
     CHANGED, {"model"}, "the motion implies m 1.3 -> 1.313"),
    ("a constant by 1e-6 in Python", "space.py", "DAMPING = 0.9 ", "DAMPING = 0.9000009 ",
     CHANGED, {"model"}, "the verdict changed from AGREES to DIFFERS"),
    ("an armature", "mujoco.xml", 'springref="0"', 'springref="0" armature="0.1"',
     CHANGED, {"model"}, "the model's motion changed"),
    # What no motion shows, and the audit does.
    ("a bound literal without effect", "mujoco.xml", 'diaginertia="0.0195', 'diaginertia="0.02',
     CHANGED, {"audit"}, "body[mass]/inertial@diaginertia[0] is 0.02, but"),
    ("a mirrored axis", "mujoco.xml", 'axis="1 0 0"', 'axis="-1 0 0"',
     CHANGED, {"audit"}, "an axis is flipped"),
    # What changes the numbers alone.
    ("a coarser step", "mujoco.xml", 'timestep="0.002"', 'timestep="0.004"',
     CHANGED, {"numbers"}, "step 0.002 s -> 0.004 s"),
    ("a finer step in a sidecar", "space.py.toml", "step = 0.002", "step = 0.001",
     IMPROVED, {"numbers"}, "error at dt"),
    # RK4 gains nothing where a force is held over each step: that one case is a little worse.
    ("an integrator of higher order", "mujoco.xml", '"Euler"', '"RK4"',
     {IMPROVED, CHANGED}, {"numbers"}, "claimed order 1 -> 4"),
    ("an integrator that is as good", "mujoco.xml", '"Euler"', '"implicitfast"',
     WITHIN, {"numbers"}, "integrator euler -> implicitfast"),
    # What can't run is no pass.
    ("an added joint", "mujoco.xml", "<inertial pos", '<joint name="y" axis="0 1 0"/><inertial pos',
     NOT_RUN, set(), "y: is not a coordinate"),
    ("a renamed joint", "mujoco.xml", 'joint name="x"', 'joint name="slide"',
     NOT_RUN, set(), "slide: is not a coordinate"),
    ("broken XML", "mujoco.xml", "<worldbody>", "<worldbody", NOT_RUN, set(), "FAILED"),
    ("an unknown key in a sidecar", "mujoco.xml.toml", "engines", "motors",
     NOT_RUN, set(), "unknown key 'motors'"),
]  # fmt: skip


def copied(index: int, name: str) -> str:
    """Name of the copy of a model file, or of its sidecar, that a row of the table changes."""
    return f"copy{index}_{name}"


@pytest.fixture(scope="module")
def changed(pristine: Repository, tmp_path_factory: pytest.TempPathFactory) -> GateResult:
    """Every row in a copy of its model, in one system, gated at once.

    What was accepted of a model is written down for its copies as it is: they are the same.
    """
    repository = Repository(tmp_path_factory.mktemp("changed"))
    repository.folder.mkdir(parents=True)
    shutil.copy(pristine.folder / "system.py", repository.folder)
    cases, texts = {}, {}
    accepted = read_baseline(pristine.baseline)[SYSTEM]
    for index, (_, name, *_) in enumerate(MODEL_CHANGES):
        model = name.removesuffix(".toml")
        for each in (model, f"{model}.toml"):
            shutil.copy(pristine.folder / each, repository.folder / copied(index, each))
            texts[SYSTEM, copied(index, each)] = (pristine.folder / each).read_bytes()
        for entry in accepted.cases.values():
            if entry.model == model:
                files = {
                    each if each == "system.py" else copied(index, each): value
                    for each, value in entry.files.items()
                }
                copy = msgspec.structs.replace(entry, model=copied(index, model), files=files)
                cases[copy.id] = copy
    write_baseline(repository.baseline, [replace(accepted, cases=cases)], texts)
    assert {c.status for c in repository.gate().changes} == {SAME}
    for index, (_, name, old, new, *_) in enumerate(MODEL_CHANGES):
        repository.edit(copied(index, name), old, new)
    return repository.gate()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("index", "name", "status", "kinds", "expected"),
    [(i, row[1], *row[4:]) for i, row in enumerate(MODEL_CHANGES)],
    ids=[row[0] for row in MODEL_CHANGES],
)
def test_a_change_of_a_model_file_is_told_for_what_it_is(
    changed: GateResult, index: int, name: str, status: Any, kinds: set[str], expected: str
) -> None:
    model = copied(index, name).removesuffix(".toml")
    statuses, seen_kinds, sentences = seen(changed, model)
    assert statuses == (status if isinstance(status, set) else {status}), sentences
    assert seen_kinds == kinds
    assert expected in sentences


def test_line_ends_are_no_change(repository: Repository) -> None:
    path = repository.folder / "mujoco.xml"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert {c.status for c in repository.gate().changes} == {SAME}


def test_changes_of_scenarios_are_told_by_what_they_change(repository: Repository) -> None:
    repository.edit("system.py", "q={x: 0.25}", "q={x: 0.3}")
    repository.edit("system.py", "duration=1.8125", "duration=2")
    repository.edit("system.py", "1.5 * sin(5.9 * t)", "1.4 * sin(5.9 * t)")
    found = repository.gate("pymunk")
    assert {(c.status, c.kinds) for c in found.changes} == {(CHANGED, ("scenario",))}
    free, resonance = sorted(found.changes, key=lambda change: change.id.scenario)
    assert "duration 1.8125 s -> 2 s" in free.messages[0]
    assert "input f = 1.5*sin(5.9*t) -> f = 1.4*sin(5.9*t)" in resonance.messages[0]


def test_a_constant_that_is_off_by_a_millionth_changes_the_equations(
    repository: Repository,
) -> None:
    repository.edit("system.py", '"k", 47.0', '"k", 47.000047')
    found = repository.gate("pymunk")
    assert {(c.status, c.kinds) for c in found.changes} == {(CHANGED, ("equations",))}
    for change in found.changes:
        assert "the verdict changed from AGREES to DIFFERS" in " | ".join(change.messages)


def test_a_renamed_scenario_is_gone_and_new_and_leaves_the_others(repository: Repository) -> None:
    repository.edit("system.py", 'Scenario("free"', 'Scenario("released"')
    found = repository.gate("pymunk")
    assert {(c.id.scenario, c.status, c.kinds) for c in found.changes} == {
        ("released", NEW, ()), ("free", GONE, ()), ("resonance", WITHIN, ("text",)),
    }  # fmt: skip


def test_a_declaration_that_can_t_be_loaded_runs_nothing(repository: Repository) -> None:
    repository.edit("system.py", "T=m * x.v", "T=m * y.v")
    found = repository.gate("pymunk")
    assert not found.passes
    assert "NameError: name 'y'" in " | ".join(*(c.messages for c in found.with_status(NOT_RUN)))


def test_model_and_equations_changed_alike_are_both_told_and_agree(repository: Repository) -> None:
    repository.edit("system.py", '"k", 47.0', '"k", 48.0')
    repository.edit("space.py", "STIFFNESS = 47.0", "STIFFNESS = 48.0")
    found = repository.gate("pymunk")
    _, kinds, sentences = seen(found, "space.py")
    assert kinds == {"model", "equations"}
    assert "model and equations changed alike, and agree" in sentences
    assert "the motion implies k 47 -> 48" in sentences
    assert "DIFFERS" not in sentences
    assert {c.status for c in found.changes} == {CHANGED}


def test_an_engine_that_is_not_installed_is_no_pass(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PymunkEngine, "version", _absent)
    found = repository.gate()
    assert seen(found, "space.py")[0] == {NOT_RUN}
    assert not found.passes


def test_files_that_go_or_come_are_told(repository: Repository) -> None:
    folder = repository.folder
    (folder / "space.py").unlink()
    (folder / "space.py.toml").unlink()
    (folder / "robot.urdf.toml").unlink()
    shutil.copy(folder / "mujoco.xml", folder / "second.xml")
    shutil.copy(folder / "mujoco.xml.toml", folder / "second.xml.toml")
    found = repository.gate()
    assert seen(found, "space.py")[0] == {GONE}
    assert seen(found, "second.xml")[0] == {NEW}
    assert seen(found, "robot.urdf")[0] == {NOT_RUN}
    assert seen(found, "mujoco.xml")[0] == {WITHIN}  # a file beside it came


def test_a_model_file_deleted_from_beside_its_sidecar_could_not_run(repository: Repository) -> None:
    (repository.folder / "space.py").unlink()
    found = repository.gate()
    assert seen(found, "space.py")[0] == {NOT_RUN}


def test_a_system_that_is_gone_is_told_unless_others_were_asked_for(repository: Repository) -> None:
    shutil.rmtree(repository.folder)
    found = repository.gate()
    assert {c.status for c in found.changes} == {GONE}
    assert len(found.changes) == 8
    parents = repository.gate(parents=(repository.root / "models",))
    assert {c.status for c in parents.changes} == {GONE}
    assert repository.gate(parents=()).changes == ()
    assert not repository.gate(parents=()).passes


@pytest.mark.slow
def test_solver_settings_that_soften_a_constraint_move_the_model(repository: Repository) -> None:
    folder = repository.root / "models" / "drum_pendulum"
    shutil.copytree(builtin() / "drum_pendulum", folder)
    for path in folder.iterdir():
        if path.name.startswith(("robot", "space", "mujoco.xml")):
            path.unlink() if path.is_file() else shutil.rmtree(path)
    keep_default_engines(folder)
    without(folder, "driven", "large")
    shorten_scenarios(folder, 8)
    repository.accept("first baseline")
    path = folder / "mujoco_rolling.xml"
    path.write_text(path.read_text().replace('solref="1e-6 0.5"', 'solref="0.02 1"'))
    found = repository.gate()
    statuses, kinds, _ = seen(found, "mujoco_rolling.xml")
    assert statuses == {CHANGED}
    assert "model" in kinds


@pytest.mark.slow
def test_a_file_that_a_model_includes_is_one_that_it_depends_on(repository: Repository) -> None:
    folder = repository.folder
    shared = repository.root / "shared"
    shared.mkdir()
    (shared / "size.xml").write_text("<mujoco><size memory='2M'/></mujoco>")
    repository.edit(
        "mujoco.xml", "<worldbody>", '<include file="../../shared/size.xml"/><worldbody>'
    )
    assert "could not run" not in {c.status for c in repository.gate().changes}
    repository.accept("with an include")
    assert {c.status for c in repository.gate().changes} == {SAME}
    (shared / "size.xml").write_text("<mujoco><size memory='3M'/></mujoco>")
    found = repository.gate()
    assert seen(found, "mujoco.xml")[0] == {WITHIN}
    assert seen(found, "robot.urdf")[0] == {SAME}
    assert any(os.path.basename(s.file) == "size.xml" for s in found.file_diffs)
    assert folder.is_dir()
