"""Known mistakes: each is caught, and its cause is named from the motions alone."""

import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.checks.verdict import judge
from physics_crosscheck.harness.diagnosis.task import ranked
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.records import FullRun, Outcome
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.solving.solve import solve
from tests.mutation.mistakes.mistakes import (
    MISTAKES,
    NO_MISTAKES,
    OTHER_STEP,
    REFUSED,
    URDF,
    Edits,
    Mistake,
)
from tests.physics import physics
from tests.standing import keep_default_engines

CopyModel = Callable[[Mistake, Edits], Sidecar]

SEGMENTS = 8
"""Segments of each scenario; few are enough here."""

SCENARIOS = 2
"""The first two scenarios: one is free, one is forced."""


def cases(mistakes: Iterable[Mistake]) -> list[ParameterSet]:
    absent = {name for name, engine in engines().items() if engine.version() is None}
    return [
        pytest.param(
            m,
            id=f"{m.name}-{m.system}-{m.engine}",
            marks=[
                pytest.mark.skipif(m.engine in absent, reason=f"{m.engine} is not installed"),
                *([pytest.mark.slow] if m.system.endswith("pendulum") else ()),
            ],
        )
        for m in mistakes
    ]


@pytest.fixture
def copy_model(tmp_path: Path) -> CopyModel:
    """Return a function that copies a built-in folder with texts replaced."""

    def make(mistake: Mistake, edits: Edits) -> Sidecar:
        folder = tmp_path / f"copy{len(list(tmp_path.iterdir()))}"
        shutil.copytree(builtin() / mistake.system, folder)
        keep_default_engines(folder)
        for name, old, new in edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return read_sidecar(folder / f"{mistake.model}.toml")

    return make


def outcome(mistake: Mistake, sidecar: Sidecar) -> Outcome:
    """Return the outcome of the second scenario, which has a known force."""
    prepared = physics(mistake.system)
    name = list(prepared.motions)[1]
    motion = prepared.motions[name]
    model, coordinates = load(prepared.system, sidecar, mistake.engine)
    claimed, _ = model.exponents(motion.varying)
    segments = motion.pick(motion.informative(SEGMENTS))
    result = extrapolate(model, coordinates, segments, resolution=1e-9)
    return judge(result.limit, segments, prepared.components, claimed, 1e-9).outcome


@pytest.mark.parametrize("mistake", cases(MISTAKES))
def test_mistake_is_caught_and_named(
    mistake: Mistake, copy_model: CopyModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.diagnosis.samples.SEGMENTS_PICKED", SEGMENTS)
    sidecar = copy_model(mistake, (*mistake.needs, *mistake.edits))
    prepared = physics(mistake.system)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    motions = dict(list(prepared.motions.items())[:SCENARIOS])
    task = model_task(prepared, mistake.engine, sidecar).with_target(motions=motions)
    ranking = ranked(task)
    first = ranking.fits[0]
    named = {str(cause) for cause in (*first.causes, *first.tied_with)}
    assert named & set(mistake.causes), (named, first.remaining)
    assert first.remaining < 1e-3
    assert ranking.explained


@pytest.mark.parametrize("mistake", cases([m for m in MISTAKES if m.needs]))
def test_model_before_a_mistake_agrees(mistake: Mistake, copy_model: CopyModel) -> None:
    assert outcome(mistake, copy_model(mistake, mistake.needs)) is Outcome.AGREES


@pytest.mark.parametrize("change", cases(NO_MISTAKES))
def test_change_that_the_engine_ignores_agrees(change: Mistake, copy_model: CopyModel) -> None:
    assert outcome(change, copy_model(change, change.edits)) is Outcome.AGREES


def run_two_seconds(mistake: Mistake, sidecar: Sidecar) -> tuple[Outcome, FullRun]:
    prepared = physics(mistake.system)
    scenario = prepared.system.scenarios[1]
    short = replace(scenario, duration=min(scenario.duration, 2.0))
    motion = replace(
        solve(derive(prepared.system), short), scale=prepared.motions[scenario.name].scale
    )
    task = model_task(prepared, mistake.engine, sidecar, scenario=scenario.name)
    case = run_case(task.with_target(motions={scenario.name: motion}))
    assert case.full_run is not None
    return case.outcome, case.full_run


def test_default_that_changes_steps_agrees_with_another_global_error(copy_model: CopyModel) -> None:
    outcome_before, before = run_two_seconds(OTHER_STEP, copy_model(OTHER_STEP, ()))
    outcome_after, after = run_two_seconds(OTHER_STEP, copy_model(OTHER_STEP, OTHER_STEP.edits))
    assert (outcome_before, outcome_after) == (Outcome.AGREES, Outcome.AGREES)
    assert before.global_error is not None
    assert after.global_error is not None
    assert abs(after.global_error / before.global_error - 1) > 0.01


@pytest.mark.parametrize("mistake", cases(REFUSED))
def test_mistake_that_an_engine_would_repair_silently_is_refused(
    mistake: Mistake, copy_model: CopyModel
) -> None:
    sidecar = copy_model(mistake, mistake.edits)
    with pytest.raises(EngineError) as error:
        engines()[mistake.engine].load(sidecar.spec(mistake.engine))
    assert all(word in str(error.value) for word in mistake.causes)


def test_pybullet_reloads_a_rewritten_file(copy_model: CopyModel) -> None:
    if engines()["pybullet"].version() is None:
        pytest.skip("pybullet is not installed")
    mistake = next(m for m in MISTAKES if m.engine == "pybullet" and m.edits[0][0] == URDF)
    sidecar = copy_model(mistake, mistake.edits)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    shutil.copy(builtin() / mistake.system / mistake.model, sidecar.model)
    assert outcome(mistake, sidecar) is Outcome.AGREES
