"""Hypotheses about a wrong model, and the effect of trying them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.task import trial_model
from physics_crosscheck.harness.diagnosis.trial import TrialModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.physics import physics

Open = Callable[..., AbstractContextManager[tuple[TrialModel, Array]]]

pytestmark = pytest.mark.skipif(
    engines()["mujoco"].version() is None, reason="mujoco is not installed"
)


@pytest.fixture
def opened(tmp_path: Path) -> Open:
    """Return a function that opens a trial model of the pendulum with texts replaced."""

    def open_(*edits: tuple[str, str]) -> AbstractContextManager[tuple[TrialModel, Array]]:
        folder = tmp_path / "copy"
        shutil.copytree(builtin() / "simple_pendulum", folder)
        text = (folder / "mujoco.xml").read_text()
        for old, new in edits:
            assert old in text
            text = text.replace(old, new)
        (folder / "mujoco.xml").write_text(text)
        sidecar = read_sidecar(folder / "mujoco.xml.toml")
        pendulum = physics("simple_pendulum")
        motions = {name: pendulum.motions[name] for name in ("free", "driven")}
        return trial_model(model_task(pendulum, "mujoco", sidecar).with_target(motions=motions))

    return open_


def index(trial: TrialModel, cause: str) -> int:
    return [str(h.id) for h in trial.hypotheses].index(cause)


def test_unbound_number_is_a_candidate_but_visual_geometry_is_not(opened: Open) -> None:
    with opened(('axis="0 -1 0"', 'axis="0 -1 0" armature="0.01"')) as (trial, _):
        candidate = trial.hypotheses[index(trial, "joint[theta]@armature")]
        assert candidate.id.kind == "unbound literal"
        assert candidate.value == 0.01
        assert [line.file for line in candidate.where] == ["mujoco.xml"]
        assert not any(word in str(h.id) for h in trial.hypotheses for word in ("geom", "rgba"))


def test_literals_of_one_expression_change_together(opened: Open) -> None:
    with opened() as (trial, _):
        both = index(trial, "body[pendulum]/inertial@mass")
        moved = trial.hypotheses[both].repair.literals
        assert moved == {"body[pendulum]/inertial@mass": -1.0}
        groups = [h for h in trial.hypotheses if h.id.kind == "literals"]
        assert all(len(h.id.subject) > 1 for h in groups)


def test_two_faults_are_repaired_exactly(opened: Open) -> None:
    edits = (('pos="0 0 -0.75"', 'pos="0 0 -0.9"'), ("-9.81", "-9.0"))
    with opened(*edits) as (trial, uncertainty):
        length = index(trial, "body[pendulum]/inertial@pos[2]")
        gravity = index(trial, "option@gravity[2]")
        single = trial.defect({length: -0.15})
        both = trial.defect({length: -0.15, gravity: 0.81})
        assert np.max(np.abs(single)) > 1e-3
        assert np.all(np.abs(both) <= np.maximum(uncertainty, 1e-11))


def test_slopes_match_finite_differences(opened: Open) -> None:
    with opened(("-9.81", "-9.5")) as (trial, _):
        gravity = index(trial, "option@gravity[2]")
        mass = index(trial, "m")
        for faults in ({}, {gravity: 0.31}):
            slopes = trial.slopes(faults, [gravity, mass])
            for row, cause in zip(slopes, (gravity, mass), strict=True):
                step = 1e-5
                perturbed = trial.defect({**faults, cause: faults.get(cause, 0.0) + step})
                expected = (trial.defect(faults) - perturbed) / step
                assert np.linalg.norm(row - expected) < 1e-3 * np.linalg.norm(expected)


def test_literal_does_not_change_its_sign(opened: Open) -> None:
    with opened() as (trial, _):
        mass = index(trial, "body[pendulum]/inertial@mass")
        assert np.min(np.abs(trial.defect({mass: 1.0}))) > 1e5
