"""One case from its files to its record, in this process, with the known-answer engine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks import acting_impulses as impulse_room
from physics_crosscheck.harness.checks import audit as audit_run
from physics_crosscheck.harness.checks import case as case_room
from physics_crosscheck.harness.checks import planar_step as planar_room
from physics_crosscheck.harness.checks import task as task_room
from physics_crosscheck.harness.checks.by_steps import suffices
from physics_crosscheck.harness.checks.case import StepError, run_case, stepped_model
from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.verdict import nonzero_scale
from physics_crosscheck.harness.diagnosis import trial as diagnosis_room
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.engines.known_answer import KnownEngine
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.full_run import traced_run
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.numerics.stepping import compare_run
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.solving.solve import solve
from tests.faults.known_folder import KNOWN_MODEL, SYSTEM, known_folder

FREED = """
names = ["x", "fall"]
M = [[1.3, 0.0], [0.0, 0.7]]
C = [[0.9, 0.0], [0.0, 0.0]]
K = [[47.0, 0.0], [{pull}, {hold}]]
W = [0.0, 0.0]
step = 0.005
method = "euler"
claims = 1
"""
HELD = 'engines = ["known"]\n[coordinates]\nfall = 0\n'


@pytest.fixture(autouse=True)
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The known-answer engine is the one that there is."""

    def engines() -> dict[str, Engine]:
        return {"known": KnownEngine()}

    for room in (task_room, planar_room, impulse_room, audit_run, diagnosis_room):
        monkeypatch.setattr(room, "engines", engines)


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory: pytest.TempPathFactory) -> PreparedSystem:
    return prepare_system(
        known_folder(tmp_path_factory.mktemp("known") / "oscillator", {}), described=False
    )


def written(place: Path, text: str, sidecar: str = 'engines = ["known"]\n') -> Sidecar:
    (place / "one.known").write_text(text)
    (place / "one.known.toml").write_text(sidecar)
    return read_sidecar(place / "one.known.toml")


def ran(prepared: PreparedSystem, sidecar: Sidecar, resolution: float = 1e-9) -> Case:
    return run_case(model_task(prepared, "known", sidecar, scenario="free", resolution=resolution))


def test_a_motion_that_is_not_finite_names_the_file(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = written(tmp_path, KNOWN_MODEL.replace("47.0", "1e308"))
    with pytest.raises(BlownUpError, match=r"^.*one\.known: values that are not finite"):
        ran(oscillator, sidecar)


@pytest.mark.parametrize("step", ["3.0", "1e30", "1e-9", "1e-300", "inf", "nan", "0.0", "-0.005"])
def test_a_step_at_which_nothing_can_be_run_fails_and_names_the_file(
    oscillator: PreparedSystem, tmp_path: Path, step: str
) -> None:
    sidecar = written(tmp_path, KNOWN_MODEL.replace("0.005", step))
    with pytest.raises(StepError, match=r"one\.known: .*(step|dt).* set (one|a)") as told:
        ran(oscillator, sidecar)
    if step == "1e-9":
        assert "1e+09 steps" in str(told.value)


def test_a_step_that_follows_nothing_of_the_motion_fails(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    free = replace(oscillator.system.scenario("free"), duration=5.0)
    motion = solve(derive(oscillator.system), free)
    motion = replace(motion, scale=oscillator.motions["free"].scale)
    sidecar = written(tmp_path, KNOWN_MODEL.replace("0.005", "2.0"))
    task = model_task(oscillator, "known", sidecar, scenario="free")
    found = run_case(task.with_target(motions={"free": motion}))
    assert found.outcome == "FAILED"
    assert "too coarse" in found.reason


def test_the_line_of_the_sidecar_is_named_where_the_step_stands_there(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = written(tmp_path, KNOWN_MODEL, 'engines = ["known"]\n\n[settings]\nstep = 9\n')
    assert str(case_room._place_of_step(model_task(oscillator, "known", sidecar))).endswith(
        "one.known.toml:4"
    )


def test_one_freedom_too_many_differs_and_is_named(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = written(tmp_path, FREED.format(pull=12.0, hold=0.0), HELD)
    found = ran(oscillator, sidecar)
    assert found.outcome == "DIFFERS"
    assert "engine coordinate fall" in found.reason
    assert "degree of freedom that the equations lack" in found.reason
    assert found.verdict is not None
    assert found.verdict.map_residual is not None
    assert found.verdict.map_residual > 1e-3
    (audited,) = (
        one
        for one in audit_run.audit_declared(model_task(oscillator, "known", sidecar)).findings
        if one.severity == "finding"
    )
    assert audited.kind == "freedom"
    assert audited.message.startswith("fall accelerates away from the coordinate map with ")
    diagnosis = diagnose_model(model_task(oscillator, "known", sidecar))
    assert not diagnosis.explained
    assert diagnosis.failure.endswith(": fall")


def test_a_freedom_of_a_millionth_differs_and_one_that_nothing_moves_agrees(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    little = ran(oscillator, written(tmp_path, FREED.format(pull=1e-6, hold=0.0), HELD))
    assert little.outcome == "DIFFERS"
    still = ran(oscillator, written(tmp_path, FREED.format(pull=0.0, hold=5.0), HELD))
    assert still.outcome == "AGREES"
    assert still.verdict is not None
    assert still.verdict.map_residual == 0.0


@pytest.mark.parametrize(("resolution", "outcome"), [(1e-9, "AGREES"), (1e-12, "DIFFERS")])
def test_what_differs_below_the_resolution_asked_agrees_and_says_so(
    oscillator: PreparedSystem, tmp_path: Path, resolution: float, outcome: str
) -> None:
    sidecar = written(tmp_path, KNOWN_MODEL + "[fault]\noff = 1e-10\n")
    found = ran(oscillator, sidecar, resolution)
    assert found.outcome == outcome
    assert found.passes is (outcome == "AGREES")
    assert ("below the requested resolution" in found.reason) is (outcome == "AGREES")


TWO = SYSTEM.replace(
    'x = Coordinate("x", "m", "displacement")',
    'x = Coordinate("x", "m", "displacement")\ny = Coordinate("y", "m", "another")',
).replace("(x,)", "(x, y)").replace("{x: 0}", "{x: 0, y: 0}").replace(
    "m * x.v**2 / 2", "m * (x.v**2 + y.v**2) / 2"
).replace("k * x.q**2 / 2", "k * (x.q**2 + y.q**2) / 2").replace(
    "c * x.v**2 / 2", "c * (x.v**2 + y.v**2) / 2"
).replace("q={x: 0.25}, v={x: -0.4}", "q={x: 0.25, y: 0}, v={x: -0.4, y: 0}").replace(
    "q={x: 0.1}, v={x: 0.2}", "q={x: 0.1, y: 0}, v={x: 0.2, y: 0}"
)  # fmt: skip


def test_a_coordinate_that_no_scenario_moves_is_measured_against_its_like(tmp_path: Path) -> None:
    (tmp_path / "system.py").write_text(TWO)
    prepared = prepare_system(tmp_path, described=False)
    assert prepared.amplitude[1] == prepared.amplitude[0] > 0
    sound = FREED.format(pull=0.0, hold=47.0).replace("fall", "y").replace("0.7", "1.3")
    text = sound.replace("C = [[0.9, 0.0], [0.0, 0.0]]", "C = [[0.9, 0.0], [0.0, 0.9]]")
    found = ran(prepared, written(tmp_path, text))
    assert (found.outcome, found.reason) == ("AGREES", "")
    assert found.full_run is not None
    assert found.full_run.global_error is not None
    assert 0 < found.full_run.global_error < 1
    task = model_task(prepared, "known", read_sidecar(tmp_path / "one.known.toml"))
    (linear,) = run_linearizations(task)
    assert linear.a_error is not None
    assert linear.a_error < 1e-9
    assert not linear.differs


@pytest.mark.parametrize(
    ("sizes", "whole"),
    [
        ([0.3, 0.0, 2.0, 0.1], [0.3, 0.3, 2.0, 0.1]),
        ([0.3, 1e-17, 2.0, 3e-17], [0.3, 0.3, 2.0, 2.0]),
        ([0.0, 0.0, 2.0, 0.1], [1.0, 1.0, 2.0, 0.1]),
        ([0.3, 1e-9, 2.0, 0.1], [0.3, 1e-9, 2.0, 0.1]),
    ],
)
def test_what_rounding_alone_moves_has_no_size_of_its_own(
    sizes: list[float], whole: list[float]
) -> None:
    assert nonzero_scale(np.array(sizes)) == pytest.approx(whole, rel=1e-15)


def test_single_steps_decide_a_sound_case_and_the_rest_is_listed_as_skipped(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = written(tmp_path, KNOWN_MODEL)
    found = ran(oscillator, sidecar)
    assert (found.outcome, found.reason) == ("AGREES", "")
    assert found.verdict is not None
    assert found.series is not None
    assert (found.verdict.decided_by, found.verdict.rungs, found.verdict.order) == (
        "single steps", (), None,
    )  # fmt: skip
    assert found.verdict.steps == 100 + 200  # states of the motion, and each step of 1 s
    assert (found.verdict.largest_uncertainty or 1) < 1e-12
    assert found.series.convergence is None
    assert {one.check for one in found.skipped} == {
        "segments", "1000 steps", "finer full runs", "predicted time step",
    }  # fmt: skip
    whole = run_case(model_task(oscillator, "known", sidecar, scenario="free", thorough=True))
    assert whole.verdict is not None
    assert whole.full_run is not None
    assert (whole.verdict.decided_by, whole.skipped) == ("segments", ())
    assert whole.full_run.checked_step is not None
    assert whole.series is not None
    assert 0.0025 in whole.series.full_runs.h
    assert found.full_run is not None
    steps = [[one.step for one in run.steps_for] for run in (found.full_run, whole.full_run)]
    assert steps[0] == pytest.approx(steps[1], rel=0.03)


@pytest.mark.parametrize(
    ("fault", "outcome"),
    [
        ("off = 3e-10", "AGREES"),  # below the resolution, above a hundredth of it
        ("off = 3e-8", "DIFFERS"),
        ("drags_after_steps = 9", "DIFFERS"),
        ("drags_after_steps = 150", "UNRESOLVED"),  # a state that only a full run carries
        ("limit = 0.2477", "UNRESOLVED"),  # the first of 200 steps reaches it
        ("friction = 1e-7", "DIFFERS"),
    ],
)
def test_single_steps_leave_a_doubt_to_segments_and_full_runs(
    oscillator: PreparedSystem, tmp_path: Path, fault: str, outcome: str
) -> None:
    found = ran(oscillator, written(tmp_path, f"{KNOWN_MODEL}[fault]\n{fault}\n"))
    assert found.verdict is not None
    assert found.verdict.decided_by == "segments"
    assert found.outcome == outcome, found.reason
    assert "segments" not in {one.check for one in found.skipped}


def test_one_step_of_a_full_run_that_breaks_the_rule_shows(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    task = model_task(oscillator, "known", written(tmp_path, KNOWN_MODEL), scenario="free")
    (model, coordinates), motion = task.load(), oscillator.motions["free"]
    power = oscillator.power()
    _, states, residuals = traced_run(model, coordinates, motion, power, model.step)
    states[113, 1] += 1e-10 * np.max(np.abs(np.diff(states[:, 1])))
    equations, held = oscillator.stepped, np.zeros((200, 1))
    assert equations is not None
    found = compare_run(model, coordinates, equations, states, residuals, held, np.zeros(2))
    assert np.flatnonzero(np.max(found.defect, axis=1) > 1e-11).tolist() == [112, 113]
    assert residuals.size == 0


def test_a_rule_with_implicit_forces_decides_only_with_accelerations(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    """A wrong mass and wrong forces could cancel in such a step at one length."""
    task = model_task(oscillator, "known", written(tmp_path, KNOWN_MODEL), scenario="free")
    compared = stepped_model(task, *task.load())
    assert compared is not None
    fastest = oscillator.segments("free").fastest
    stepping = compared.single_steps(*oscillator.states("free"), fastest=fastest)
    assert stepping is not None
    implicit = replace(stepping, rule=replace(stepping.rule, damping=np.eye(1)))
    assert suffices(stepping, None, 1e-9)
    assert not suffices(implicit, None, 1e-9)
    assert not suffices(replace(stepping, rule=replace(stepping.rule, besides="?")), None, 1e-9)
    assert not suffices(stepping, None, 1e-13)
