"""One case from its files to its record, in this process, with the known-answer engine."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks import audit as audit_run
from physics_crosscheck.harness.checks import case as case_module
from physics_crosscheck.harness.checks.by_steps import suffices
from physics_crosscheck.harness.checks.case import StepError, run_case, stepped_model
from physics_crosscheck.harness.checks.compiled_terms import run_linearizations
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.full_run import traced_run
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.numerics.stepping import compare_run
from physics_crosscheck.records import Case
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.solving.solve import solve
from tests.faults.known_folder import KNOWN_ANSWER, KNOWN_MODEL, SYSTEM, known_folder

sys.path.insert(0, str(KNOWN_ANSWER))  # the engine's entry point

EXTRA_COORDINATE = """
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


@pytest.fixture(scope="module")
def oscillator(tmp_path_factory: pytest.TempPathFactory) -> PreparedSystem:
    return prepare_system(
        known_folder(tmp_path_factory.mktemp("known") / "oscillator", {}), described=False
    )


def write_model(place: Path, text: str, sidecar: str = 'engines = ["known"]\n') -> Sidecar:
    (place / "one.known").write_text(text)
    (place / "one.known.toml").write_text(sidecar)
    return read_sidecar(place / "one.known.toml")


def run(prepared: PreparedSystem, sidecar: Sidecar, resolution: float = 1e-9) -> Case:
    return run_case(model_task(prepared, "known", sidecar, scenario="free", resolution=resolution))


def test_error_of_a_diverging_motion_names_the_file(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = write_model(tmp_path, KNOWN_MODEL.replace("47.0", "1e308"))
    with pytest.raises(BlownUpError, match=r"^.*one\.known: values that are not finite"):
        run(oscillator, sidecar)


@pytest.mark.parametrize("step", ["3.0", "1e30", "1e-9", "1e-300", "inf", "nan", "0.0", "-0.005"])
def test_unusable_step_fails_and_names_the_file(
    oscillator: PreparedSystem, tmp_path: Path, step: str
) -> None:
    sidecar = write_model(tmp_path, KNOWN_MODEL.replace("0.005", step))
    with pytest.raises(StepError, match=r"one\.known: .*(step|dt).* set (one|a)") as error:
        run(oscillator, sidecar)
    if step == "1e-9":
        assert "1e+09 steps" in str(error.value)


def test_step_too_coarse_for_the_motion_fails(oscillator: PreparedSystem, tmp_path: Path) -> None:
    free = replace(oscillator.system.scenario("free"), duration=5.0)
    motion = solve(derive(oscillator.system), free)
    motion = replace(motion, scale=oscillator.motions["free"].scale)
    sidecar = write_model(tmp_path, KNOWN_MODEL.replace("0.005", "2.0"))
    task = model_task(oscillator, "known", sidecar, scenario="free")
    result = run_case(task.with_target(motions={"free": motion}))
    assert result.outcome == "FAILED"
    assert "too coarse" in result.reason


def test_place_of_a_step_set_in_the_sidecar_is_its_line(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = write_model(tmp_path, KNOWN_MODEL, 'engines = ["known"]\n\n[settings]\nstep = 9\n')
    assert str(case_module._place_of_step(model_task(oscillator, "known", sidecar))).endswith(
        "one.known.toml:4"
    )


def test_extra_degree_of_freedom_differs_and_is_named(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = write_model(tmp_path, EXTRA_COORDINATE.format(pull=12.0, hold=0.0), HELD)
    result = run(oscillator, sidecar)
    assert result.outcome == "DIFFERS"
    assert "engine coordinate fall" in result.reason
    assert "degree of freedom that the equations lack" in result.reason
    assert result.verdict is not None
    assert result.verdict.map_residual is not None
    assert result.verdict.map_residual > 1e-3
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


def test_extra_coordinate_differs_if_it_moves_and_agrees_at_rest(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    little = run(
        oscillator, write_model(tmp_path, EXTRA_COORDINATE.format(pull=1e-6, hold=0.0), HELD)
    )
    assert little.outcome == "DIFFERS"
    still = run(
        oscillator, write_model(tmp_path, EXTRA_COORDINATE.format(pull=0.0, hold=5.0), HELD)
    )
    assert still.outcome == "AGREES"
    assert still.verdict is not None
    assert still.verdict.map_residual == 0.0


@pytest.mark.parametrize(("resolution", "outcome"), [(1e-9, "AGREES"), (1e-12, "DIFFERS")])
def test_difference_below_the_resolution_agrees_with_a_remark(
    oscillator: PreparedSystem, tmp_path: Path, resolution: float, outcome: str
) -> None:
    sidecar = write_model(tmp_path, KNOWN_MODEL + "[fault]\noff = 1e-10\n")
    result = run(oscillator, sidecar, resolution)
    assert result.outcome == outcome
    assert result.passes is (outcome == "AGREES")
    assert ("below the requested resolution" in result.reason) is (outcome == "AGREES")


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


def test_unmoved_coordinate_is_scaled_like_the_others(tmp_path: Path) -> None:
    (tmp_path / "system.py").write_text(TWO)
    prepared = prepare_system(tmp_path, described=False)
    assert prepared.amplitude[1] == prepared.amplitude[0] > 0
    sound = EXTRA_COORDINATE.format(pull=0.0, hold=47.0).replace("fall", "y").replace("0.7", "1.3")
    text = sound.replace("C = [[0.9, 0.0], [0.0, 0.0]]", "C = [[0.9, 0.0], [0.0, 0.9]]")
    result = run(prepared, write_model(tmp_path, text))
    assert (result.outcome, result.reason) == ("AGREES", "")
    assert result.full_run is not None
    assert result.full_run.global_error is not None
    assert 0 < result.full_run.global_error < 1
    task = model_task(prepared, "known", read_sidecar(tmp_path / "one.known.toml"))
    (linear,) = run_linearizations(task)
    assert linear.a_error is not None
    assert linear.a_error < 1e-9
    assert not linear.differs


def test_single_steps_decide_a_correct_case_and_skipped_checks_are_listed(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    sidecar = write_model(tmp_path, KNOWN_MODEL)
    result = run(oscillator, sidecar)
    assert (result.outcome, result.reason) == ("AGREES", "")
    assert result.verdict is not None
    assert result.series is not None
    assert (result.verdict.decided_by, result.verdict.rungs, result.verdict.order) == (
        "single steps", (), None,
    )  # fmt: skip
    assert result.verdict.steps == 100 + 200  # states of the motion, and each step of 1 s
    assert (result.verdict.largest_uncertainty or 1) < 1e-12
    assert result.series.convergence is None
    assert {one.check for one in result.skipped} == {
        "segments", "1000 steps", "finer full runs", "predicted time step",
    }  # fmt: skip
    whole = run_case(model_task(oscillator, "known", sidecar, scenario="free", thorough=True))
    assert whole.verdict is not None
    assert whole.full_run is not None
    assert (whole.verdict.decided_by, whole.skipped) == ("segments", ())
    assert whole.full_run.checked_step is not None
    assert whole.series is not None
    assert 0.0025 in whole.series.full_runs.h
    assert result.full_run is not None
    steps = [[one.step for one in run.steps_for] for run in (result.full_run, whole.full_run)]
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
def test_doubtful_single_steps_are_decided_by_segments(
    oscillator: PreparedSystem, tmp_path: Path, fault: str, outcome: str
) -> None:
    result = run(oscillator, write_model(tmp_path, f"{KNOWN_MODEL}[fault]\n{fault}\n"))
    assert result.verdict is not None
    assert result.verdict.decided_by == "segments"
    assert result.outcome == outcome, result.reason
    assert "segments" not in {one.check for one in result.skipped}


def test_one_wrong_step_of_a_full_run_is_detected(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    task = model_task(oscillator, "known", write_model(tmp_path, KNOWN_MODEL), scenario="free")
    (model, coordinates), motion = task.load(), oscillator.motions["free"]
    power = oscillator.power()
    _, states, residuals = traced_run(model, coordinates, motion, power, model.step)
    states[113, 1] += 1e-10 * np.max(np.abs(np.diff(states[:, 1])))
    equations, held = oscillator.stepped, np.zeros((200, 1))
    assert equations is not None
    comparison = compare_run(model, coordinates, equations, states, residuals, held, np.zeros(2))
    assert np.flatnonzero(np.max(comparison.defect, axis=1) > 1e-11).tolist() == [112, 113]
    assert residuals.size == 0


def test_implicit_rule_needs_accelerations_to_decide(
    oscillator: PreparedSystem, tmp_path: Path
) -> None:
    """Rule out that a wrong mass and wrong forces cancel at one step length."""
    task = model_task(oscillator, "known", write_model(tmp_path, KNOWN_MODEL), scenario="free")
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
