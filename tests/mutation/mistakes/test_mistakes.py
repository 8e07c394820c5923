"""Known mistakes: each is caught, and its cause is named from the motions alone."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.checks.verdict import judge
from physics_crosscheck.harness.diagnosis.task import ranked
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.harness.records.case import FullRun
from physics_crosscheck.harness.records.outcome import Outcome
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
from tests.standing import standing_only

Edited = Callable[[Mistake, Edits], Sidecar]

FEW = 8
"""Segments a scenario: enough for these, and soon done."""

SCENARIOS = 2
"""The first two: one is free, one is forced."""


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
def edited(tmp_path: Path) -> Edited:
    """A copy of a built-in folder with texts replaced; returns the model's sidecar."""

    def make(mistake: Mistake, edits: Edits) -> Sidecar:
        folder = tmp_path / f"copy{len(list(tmp_path.iterdir()))}"
        shutil.copytree(builtin() / mistake.system, folder)
        standing_only(folder)
        for name, old, new in edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return read_sidecar(folder / f"{mistake.model}.toml")

    return make


def outcome(mistake: Mistake, sidecar: Sidecar) -> Outcome:
    """Of the second scenario, which has a known force."""
    prepared = physics(mistake.system)
    name = list(prepared.motions)[1]
    motion = prepared.motions[name]
    model, coordinates = load(prepared.system, sidecar, mistake.engine)
    claimed, _ = model.exponents(motion.varying)
    some = motion.pick(motion.informative(FEW))
    found = extrapolate(model, coordinates, some, resolution=1e-9)
    return judge(found.limit, some, prepared.components, claimed, 1e-9).outcome


@pytest.mark.parametrize("mistake", cases(MISTAKES))
def test_a_mistake_is_caught_and_named(
    mistake: Mistake, edited: Edited, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.diagnosis.samples.SEGMENTS_PICKED", FEW)
    sidecar = edited(mistake, (*mistake.needs, *mistake.edits))
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
def test_what_a_mistake_is_made_on_top_of_is_none(mistake: Mistake, edited: Edited) -> None:
    assert outcome(mistake, edited(mistake, mistake.needs)) is Outcome.AGREES


@pytest.mark.parametrize("change", cases(NO_MISTAKES))
def test_what_an_engine_leaves_out_still_agrees(change: Mistake, edited: Edited) -> None:
    assert outcome(change, edited(change, change.edits)) is Outcome.AGREES


def run_in_short(mistake: Mistake, sidecar: Sidecar) -> tuple[Outcome, FullRun]:
    """The second scenario as `run` tells it, in short: two seconds."""
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


def test_a_default_that_shifts_a_step_agrees_and_is_told_by_its_global_error(
    edited: Edited,
) -> None:
    was, before = run_in_short(OTHER_STEP, edited(OTHER_STEP, ()))
    became, after = run_in_short(OTHER_STEP, edited(OTHER_STEP, OTHER_STEP.edits))
    assert (was, became) == (Outcome.AGREES, Outcome.AGREES)
    assert before.global_error is not None
    assert after.global_error is not None
    assert abs(after.global_error / before.global_error - 1) > 0.01


@pytest.mark.parametrize("mistake", cases(REFUSED))
def test_a_mistake_that_an_engine_would_repair_in_silence_is_refused(
    mistake: Mistake, edited: Edited
) -> None:
    sidecar = edited(mistake, mistake.edits)
    with pytest.raises(EngineError) as refusal:
        engines()[mistake.engine].load(sidecar.spec(mistake.engine))
    assert all(word in str(refusal.value) for word in mistake.causes)


def test_a_file_rewritten_under_its_name_is_read_again_by_pybullet(edited: Edited) -> None:
    if engines()["pybullet"].version() is None:
        pytest.skip("pybullet is not installed")
    mistake = next(m for m in MISTAKES if m.engine == "pybullet" and m.edits[0][0] == URDF)
    sidecar = edited(mistake, mistake.edits)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    shutil.copy(builtin() / mistake.system / mistake.model, sidecar.model)
    assert outcome(mistake, sidecar) is Outcome.AGREES
