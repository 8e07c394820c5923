"""Hypotheses on a model, and the motion that the best one corrects."""

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.diagnose import Ranking
from physics_crosscheck.harness.diagnosis.fit import Fit
from physics_crosscheck.harness.diagnosis.task import correct_motion, trial_model
from physics_crosscheck.harness.diagnosis.trial import TrialModel
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.finding import CorrectedMotion
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.physics import physics


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TrialModel]:
    """Yield a mass on a spring that is one percent too stiff in its file."""
    folder = tmp_path_factory.mktemp("planted") / "mass_spring_damper"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    path = folder / "mujoco.xml"
    text, count = re.subn('stiffness="47.0"', 'stiffness="47.47"', path.read_text())
    assert count == 1
    path.write_text(text)
    prepared = physics("mass_spring_damper")
    sidecar = read_sidecar(folder / "mujoco.xml.toml")
    motions = {name: prepared.motions[name] for name in ("free", "step")}
    task = model_task(prepared, "mujoco", sidecar).with_target(motions=motions)
    with trial_model(task) as (trial, _):
        yield trial


def correct(
    trial: TrialModel, cause: str, fault: float, explained: bool = True
) -> CorrectedMotion | None:
    """Correct the motion as if a diagnosis had named one cause with its fault."""
    (index,) = (i for i, h in enumerate(trial.hypotheses) if str(h.id) == cause)
    hypothesis = trial.hypotheses[index]
    estimate = hypothesis.value + hypothesis.correction * fault
    fit = Fit(
        members=(index,),
        hypotheses=(hypothesis,),
        faults=(fault,),
        estimates=(estimate,),
        standard_errors=(1e-9,),
        remaining=1e-10,
    )
    return correct_motion(trial, trial.task.target.motions, Ranking((fit,), explained, 1e-9))


def required(motion: CorrectedMotion | None) -> CorrectedMotion:
    assert motion is not None
    return motion


@pytest.mark.parametrize(("cause", "estimate", "changed"), [
    ("k", 47.47, "equations"),
    ("joint[x]@stiffness", 47.0, "file"),
])  # fmt: skip
def test_correct_value_explains_the_motion_in_every_scenario(
    trial: TrialModel, cause: str, estimate: float, changed: str
) -> None:
    motion = required(correct(trial, cause, 0.47))
    assert [one.estimate for one in motion.causes] == [pytest.approx(estimate)]
    assert [str(one) for one in motion.causes] == [cause]
    assert motion.put_into == changed
    assert [one.scenario for one in motion.scenarios] == list(trial.task.target.motions)
    for scenario in motion.scenarios:
        assert np.max(np.abs(np.array(scenario.before))) > 1e-3
        assert np.max(np.abs(np.array(scenario.after))) < 1e-9
        # Corrected equations have the file's spring, so their motion differs from the reference.
        # A corrected file has the equations' spring, so only the time step makes a difference.
        reference = trial.task.target.motions[scenario.scenario].states_at(np.array(scenario.t))
        gap = np.array(scenario.corrected).T - reference
        gap = np.max(np.abs(gap)) / np.max(np.abs(reference))
        assert 0.005 < gap < 0.3 if changed == "equations" else gap < 0.02


def test_wrong_value_does_not_explain_the_motion(trial: TrialModel) -> None:
    motion = required(correct(trial, "k", -1.0))
    assert all(np.max(np.abs(np.array(one.after))) > 1e-3 for one in motion.scenarios)


def test_corrected_motion_follows_steps_of_the_input(trial: TrialModel) -> None:
    """Expect the reference, with a step of force, when no value changes."""
    motion = required(correct(trial, "k", 0.0))
    for scenario in motion.scenarios:
        reference = trial.task.target.motions[scenario.scenario].states_at(np.array(scenario.t)).T
        # Times have six digits: rounded by 5e-5 s, at up to 6 rad/s.
        states = np.array(scenario.corrected, dtype=float)
        np.testing.assert_allclose(states, reference, atol=3e-4 * np.max(np.abs(reference)))
        assert len(scenario.t) == 240


def test_corrected_motion_shifts_the_zero_of_a_joint(trial: TrialModel) -> None:
    motion = required(correct(trial, "zero of x", 0.02))
    assert motion.put_into == "file"
    free = next(one for one in motion.scenarios if one.scenario == "free")
    assert abs(float(np.array(free.corrected)[0, -1])) == pytest.approx(0.02, rel=0.1)


def test_unexplained_motion_is_not_corrected(trial: TrialModel) -> None:
    assert correct(trial, "k", 0.47, explained=False) is None


Open = Callable[..., AbstractContextManager[tuple[TrialModel, Array]]]


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
