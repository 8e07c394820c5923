"""Diagnoses of faults in built-in models and of random draws, and phrases that name causes."""

import json
import re
import shutil
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from campaigns import random_pairs
from campaigns.random_draws import Pairing, campaign, judge_at, pairings
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.diagnosis.hypotheses import everything
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.records import Outcome, read_results
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.variants import variants
from tests.commands import crosscheck
from tests.standing import keep_default_engines, shorten_scenarios


@pytest.mark.slow
def test_no_model_differs_at_random_constants() -> None:
    """Take a third of the models; `campaigns.random_draws` takes all."""
    results = campaign(9, 11)
    for judged, draw in results:
        verdict = judged.verdict
        assert verdict.outcome in (Outcome.AGREES, Outcome.UNRESOLVED), (draw, verdict.reason)
        if verdict.outcome is Outcome.UNRESOLVED:
            assert verdict.discrepancy <= verdict.uncertainty, draw
        for place, ratios in judged.ratios.items():
            assert np.all(ratios <= 1), (place, draw)
    agree = sum(judged.verdict.outcome is Outcome.AGREES for judged, _ in results)
    assert agree >= 8


@pytest.mark.slow
def test_both_of_two_faults_are_named() -> None:
    trials = random_pairs.campaign(3, seed=11)
    assert all(t.named and t.explained for t in trials), [t for t in trials if not t.named]


def pairing(system: str, file: str) -> Pairing:
    return next(
        p for p in pairings() if (p[0].name, p[1].model.name, p[2]) == (system, file, "mujoco")
    )


@pytest.mark.slow
def test_rounding_by_a_soft_equality_agrees(tmp_path: Path) -> None:
    """Repeat a draw that was once a false alarm."""
    constants = {
        "M": 5.025847260289418, "r": 0.3277818917406811, "m": 0.34242181644830977,
        "l": 1.7176538454649595, "k": 63.93883253127701, "g": 8.22086977310767,
    }  # fmt: skip
    judged = judge_at(pairing("drum_pendulum", "mujoco_rolling.xml"), constants, "driven", tmp_path)
    assert judged.verdict.outcome is Outcome.AGREES, judged.verdict.reason
    for place, ratios in judged.ratios.items():
        assert np.max(ratios) < 0.5, place


def test_pendulum_after_nineteen_turns_agrees(tmp_path: Path) -> None:
    # The angle and its velocity are large, but the rounding of the angle affects no force.
    constants = {"m": 0.21712384607983154, "l": 0.41014006587510676, "g": 6.854633582428014}
    chosen = pairing("simple_pendulum", "robot.urdf")
    judged = judge_at(chosen, constants, "driven", tmp_path)
    assert judged.motion.amplitude[0] > 2 * np.pi * 19
    assert judged.verdict.outcome is Outcome.AGREES, judged.verdict.reason
    assert np.all(judged.ratios["verdict"] <= 1)


PHRASES: dict[str, dict[str, list[str]]] = json.loads(
    (Path(__file__).parent / "phrases.json").read_text()
)
"""Phrases by system and kind, of all models in all engines."""

MISSING_TERMS = {
    "inertia": "inertia on {}",
    "damping": "damping on {}",
    "quadratic damping": "quadratic damping on {}",
    "friction": "friction on {}",
    "spring": "spring on {}",
    "offset force": "offset force on {}",
}
"""Phrases of terms that the equations may lack, for each coordinate of a system."""


@pytest.mark.parametrize("name", PHRASES)
def test_every_hypothesis_of_a_builtin_system_has_its_phrase(name: str) -> None:
    system = load_system(builtin() / name)
    free = variants(derive(system), np.ones(2 * len(system.coordinates)))
    actual: dict[str, set[str]] = defaultdict(set)
    for sidecar in model_files(builtin() / name):
        assert isinstance(sidecar, Sidecar)
        for engine in (one for one in sidecar.engines if not engines()[one].extra):
            candidates = everything(system, sidecar, *load(system, sidecar, engine), free)
            names = [candidate.id for candidate in candidates]
            assert len(set(names)) == len(names)
            for identity in names:
                actual[identity.kind].add(str(identity))
    expected = {kind: set(phrases) for kind, phrases in PHRASES[name].items()}
    for kind, phrase in MISSING_TERMS.items():
        expected[kind] = {phrase.format(c.name) for c in system.coordinates}
    assert actual == expected


@pytest.fixture
def folder(tmp_path: Path) -> Callable[[str], Path]:
    def copy(name: str) -> Path:
        shutil.copytree(builtin() / name, tmp_path / name)
        keep_default_engines(tmp_path / name)
        shorten_scenarios(tmp_path / name)
        return tmp_path / name

    return copy


@pytest.mark.slow
@pytest.mark.parametrize(("name", "file", "engine", "old", "new", "cause", "expected"), [
    ("anchored_pair", "robot.urdf.toml", "mujoco", "damping = 1.1", "damping = 1.16",
     "sidecar:spring[0].damping", 1.1),
])  # fmt: skip
def test_wrong_literal_is_named_with_file_line_and_value(
    folder: Callable[[str], Path],
    tmp_path: Path,
    name: str,
    file: str,
    engine: str,
    old: str,
    new: str,
    cause: str,
    expected: float,
) -> None:
    path = folder(name) / file
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    line = text[: text.index(old)].count("\n") + 1
    words = "run", path.parent, "--engine", engine, "-k", "free", "--out", "out"
    done = crosscheck(*words, cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    model = file.removesuffix(".toml")
    results = read_results(tmp_path / "out" / "results.json")
    diagnosis = next(m.diagnosis for m in results.models if m.model == model)
    assert diagnosis is not None
    first = diagnosis.explanations[0]
    assert diagnosis.explained
    assert cause in [str(one) for one in (*first.causes, *first.tied_with)]
    (named,) = next(
        e.causes for e in diagnosis.explanations if [str(c) for c in e.causes] == [cause]
    )
    assert [(one.file, one.line) for one in named.locations] == [(file, line)]
    assert named.estimate == pytest.approx(expected, abs=0.01 * abs(float_of(new) - expected))
    top = " ".join(" ".join(done.stdout.splitlines()[:8]).split())
    assert f"FAIL {name}/{model} [{engine}]" in top
    assert "cause: " in top
    assert f"{file}:{line} from" in top
    # The audit reads the same literal; it is reported once.
    assert "the audit finds" not in done.stdout


def float_of(text: str) -> float:
    """Return the last number of a replacement."""
    return float(re.findall(r"-?\d+\.\d+", text)[-1])
