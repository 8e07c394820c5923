"""What might be wrong with a model, and what trying it does."""

import shutil

import numpy as np
import pytest

from harness.cases.prepare import prepare
from harness.diagnosis.task import DiagnosisTask, trial_model
from harness.engines.registry import engines
from harness.files.folders import builtin
from harness.files.sidecar import read_sidecar

pytestmark = pytest.mark.skipif(
    engines()["mujoco"].version() is None, reason="mujoco is not installed"
)


@pytest.fixture(scope="module")
def physics():
    return prepare(builtin() / "simple_pendulum")


@pytest.fixture
def opened(physics, tmp_path):
    """A bench for the pendulum's MJCF with texts replaced."""

    def open_(*edits):
        folder = tmp_path / "copy"
        shutil.copytree(builtin() / "simple_pendulum", folder)
        text = (folder / "mujoco.xml").read_text()
        for old, new in edits:
            assert old in text
            text = text.replace(old, new)
        (folder / "mujoco.xml").write_text(text)
        sidecar = read_sidecar(folder / "mujoco.xml.toml")
        motions = {name: physics.motions[name] for name in ("free", "driven")}
        return trial_model(
            DiagnosisTask(
                physics.system, sidecar, "mujoco", motions, physics.scales, physics.variants
            )
        )

    return open_


def index(whole, cause):
    return [h.cause for h in whole.hypotheses].index(cause)


def test_a_number_left_in_is_a_suspect_with_its_line_and_looks_are_none(opened):
    with opened(('axis="0 -1 0"', 'axis="0 -1 0" armature="0.01"')) as (whole, _):
        left_in = whole.hypotheses[index(whole, "joint[theta]@armature")]
        assert left_in.kind == "unbound literal"
        assert left_in.value == 0.01
        assert left_in.where.startswith("mujoco.xml:")
        assert not any("geom" in h.cause or "rgba" in h.cause for h in whole.hypotheses)


def test_literals_of_one_expression_move_together(opened):
    with opened() as (whole, _):
        both = index(whole, "body[pendulum]/inertial@mass")
        moved = whole.candidates[both].change.literals
        assert moved == {"body[pendulum]/inertial@mass": -1.0}
        groups = [h for h in whole.hypotheses if h.kind == "literals"]
        assert all(", " in h.cause for h in groups)


def test_faults_are_repaired_together_exactly(opened):
    edits = (('pos="0 0 -0.75"', 'pos="0 0 -0.9"'), ("-9.81", "-9.0"))
    with opened(*edits) as (whole, uncertainty):
        length = index(whole, "body[pendulum]/inertial@pos[2]")
        gravity = index(whole, "option@gravity[2]")
        alone = whole.defect({length: -0.15})
        both = whole.defect({length: -0.15, gravity: 0.81})
        assert np.max(np.abs(alone)) > 1e-3
        assert np.all(np.abs(both) <= np.maximum(uncertainty, 1e-11))


def test_a_slope_is_the_change_of_the_defect_near_any_faults(opened):
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


def test_a_literal_is_not_moved_across_zero(opened):
    with opened() as (whole, _):
        mass = index(whole, "body[pendulum]/inertial@mass")
        assert np.min(np.abs(whole.defect({mass: 1.0}))) > 1e5
