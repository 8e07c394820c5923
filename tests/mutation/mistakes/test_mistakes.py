"""Known mistakes: each is caught, and its cause is named from the motions alone."""

import shutil
from dataclasses import replace
from functools import cache

import pytest

from harness.cases.case import CaseTask, load, run_case
from harness.cases.prepare import prepare
from harness.cases.verdict import judge
from harness.diagnosis.task import DiagnosisTask, diagnosed
from harness.engines.protocol import EngineError
from harness.engines.registry import engines
from harness.files.folders import builtin
from harness.files.sidecar import read_sidecar
from harness.numerics.segments import Batch, extrapolate
from harness.records.outcome import Outcome
from reference.derive import derive
from reference.solve import solve
from tests.mutation.mistakes.mistakes import (
    MISTAKES,
    NO_MISTAKES,
    OTHER_STEPS,
    REFUSED,
    SYSTEM,
    URDF,
)

FEW = 8
"""Segments a scenario: enough for these, and soon done."""

SCENARIOS = 2
"""The first two: one is free, one is forced."""


def cases(mistakes):
    return [
        pytest.param(
            m,
            id=f"{m.name}-{m.system}-{m.engine}",
            marks=pytest.mark.skipif(
                engines()[m.engine].version() is None, reason=f"{m.engine} is not installed"
            ),
        )
        for m in mistakes
    ]


@cache
def prepared(folder):
    return prepare(folder)


def physics_of(mistake, sidecar):
    """The built-in folder's, or that of the copy where its equations are edited too."""
    files = {file for file, _, _ in (*mistake.needs, *mistake.edits)}
    folder = sidecar.model.parent if SYSTEM in files else builtin() / mistake.system
    return prepared(folder)


@pytest.fixture
def edited(tmp_path):
    """A copy of a built-in folder with texts replaced; returns the model's sidecar."""

    def make(mistake, edits):
        folder = tmp_path / f"copy{len(list(tmp_path.iterdir()))}"
        shutil.copytree(builtin() / mistake.system, folder)
        for name, old, new in edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return read_sidecar(folder / f"{mistake.model}.toml")

    return make


def outcome(mistake, sidecar):
    """Of the second scenario, which has a known force."""
    physics = physics_of(mistake, sidecar)
    name = list(physics.motions)[1]
    motion, scale = physics.motions[name], physics.scales[name]
    model, coordinates = load(physics.system, sidecar, mistake.engine)
    claimed, _ = model.exponents(motion.varying)
    found = extrapolate(model, coordinates, Batch.of(motion, scale), resolution=1e-9)
    return judge(found.limit, motion, scale, physics.components, claimed, 1e-9).outcome


@pytest.mark.parametrize("mistake", cases(MISTAKES))
def test_a_mistake_is_caught_and_named(mistake, edited, monkeypatch):
    monkeypatch.setattr("harness.diagnosis.samples.SEGMENTS_PICKED", FEW)
    sidecar = edited(mistake, (*mistake.needs, *mistake.edits))
    physics = physics_of(mistake, sidecar)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    motions = dict(list(physics.motions.items())[:SCENARIOS])
    diagnosis = diagnosed(
        DiagnosisTask(
            physics.system, sidecar, mistake.engine, motions, physics.scales, physics.variants
        )
    )
    first = diagnosis.findings[0]
    named = {*(cause.cause for cause in first.causes), *first.tied_with}
    assert named & set(mistake.causes), (named, first.remaining)
    assert first.remaining < 1e-3
    assert diagnosis.explained


@pytest.mark.parametrize("mistake", cases([m for m in MISTAKES if m.needs]))
def test_what_a_mistake_is_made_on_top_of_is_none(mistake, edited):
    assert outcome(mistake, edited(mistake, mistake.needs)) is Outcome.AGREES


@pytest.mark.parametrize("change", cases(NO_MISTAKES))
def test_what_an_engine_leaves_out_still_agrees(change, edited):
    assert outcome(change, edited(change, change.edits)) is Outcome.AGREES


def lived(mistake, sidecar):
    """The second scenario as `run` tells it, in short: two seconds."""
    physics = physics_of(mistake, sidecar)
    scenario = physics.system.scenarios[1]
    short = replace(scenario, duration=min(scenario.duration, 2.0))
    motion = solve(derive(physics.system), short)
    return run_case(
        CaseTask(
            physics.system,
            sidecar,
            mistake.engine,
            scenario.name,
            motion,
            physics.scales[scenario.name],
            physics.amplitude,
            physics.power,
            physics.components,
            1e-9,
        )
    )


@pytest.mark.parametrize("change", cases(OTHER_STEPS))
def test_another_step_or_integrator_agrees_and_is_told_by_its_raw_error(change, edited):
    before = lived(change, edited(change, ()))
    after = lived(change, edited(change, change.edits))
    assert before["outcome"] == after["outcome"] == "AGREES"
    assert abs(after["raw_error"] / before["raw_error"] - 1) > 0.01
    told = [(r["shipped_step"], r["integrator"], r["raw_error"]) for r in (before, after)]
    assert told[0][:2] != told[1][:2] or "error_bias" in change.name


@pytest.mark.parametrize("mistake", cases(REFUSED))
def test_a_mistake_that_an_engine_would_repair_in_silence_is_refused(mistake, edited):
    sidecar = edited(mistake, mistake.edits)
    with pytest.raises(EngineError) as refusal:
        engines()[mistake.engine].load(sidecar.spec(mistake.engine))
    assert all(word in str(refusal.value) for word in mistake.causes)


def test_a_file_rewritten_under_its_name_is_read_again_by_pybullet(edited):
    if engines()["pybullet"].version() is None:
        pytest.skip("pybullet is not installed")
    mistake = next(m for m in MISTAKES if m.engine == "pybullet" and m.edits[0][0] == URDF)
    sidecar = edited(mistake, mistake.edits)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    shutil.copy(builtin() / mistake.system / mistake.model, sidecar.model)
    assert outcome(mistake, sidecar) is Outcome.AGREES
