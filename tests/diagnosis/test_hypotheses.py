"""What might be wrong with a model, and what trying it does."""

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
    """A trial model of the pendulum's MJCF with texts replaced."""

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


def index(whole: TrialModel, cause: str) -> int:
    return [str(h.id) for h in whole.hypotheses].index(cause)


def test_a_number_left_in_is_a_candidate_with_its_line_and_looks_are_none(opened: Open) -> None:
    with opened(('axis="0 -1 0"', 'axis="0 -1 0" armature="0.01"')) as (whole, _):
        left_in = whole.hypotheses[index(whole, "joint[theta]@armature")]
        assert left_in.id.kind == "unbound literal"
        assert left_in.value == 0.01
        assert [line.file for line in left_in.where] == ["mujoco.xml"]
        assert not any(word in str(h.id) for h in whole.hypotheses for word in ("geom", "rgba"))


def test_literals_of_one_expression_move_together(opened: Open) -> None:
    with opened() as (whole, _):
        both = index(whole, "body[pendulum]/inertial@mass")
        moved = whole.candidates[both].perturbation.literals
        assert moved == {"body[pendulum]/inertial@mass": -1.0}
        groups = [h for h in whole.hypotheses if h.id.kind == "literals"]
        assert all(len(h.id.subject) > 1 for h in groups)


def test_faults_are_repaired_together_exactly(opened: Open) -> None:
    edits = (('pos="0 0 -0.75"', 'pos="0 0 -0.9"'), ("-9.81", "-9.0"))
    with opened(*edits) as (whole, uncertainty):
        length = index(whole, "body[pendulum]/inertial@pos[2]")
        gravity = index(whole, "option@gravity[2]")
        alone = whole.defect({length: -0.15})
        both = whole.defect({length: -0.15, gravity: 0.81})
        assert np.max(np.abs(alone)) > 1e-3
        assert np.all(np.abs(both) <= np.maximum(uncertainty, 1e-11))


def test_a_slope_is_the_change_of_the_defect_near_any_faults(opened: Open) -> None:
    with opened(("-9.81", "-9.5")) as (whole, _):
        gravity = index(whole, "option@gravity[2]")
        mass = index(whole, "m")
        for faults in ({}, {gravity: 0.31}):
            slopes = whole.slopes(faults, [gravity, mass])
            for row, cause in zip(slopes, (gravity, mass), strict=True):
                step = 1e-5
                ahead = whole.defect({**faults, cause: faults.get(cause, 0.0) + step})
                wanted = (whole.defect(faults) - ahead) / step
                assert np.linalg.norm(row - wanted) < 1e-3 * np.linalg.norm(wanted)


def test_a_literal_is_not_moved_across_zero(opened: Open) -> None:
    with opened() as (whole, _):
        mass = index(whole, "body[pendulum]/inertial@mass")
        assert np.min(np.abs(whole.defect({mass: 1.0}))) > 1e5
