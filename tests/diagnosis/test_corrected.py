"""The motion corrected with the value that a diagnosis found."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator

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
from tests.physics import physics


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TrialModel]:
    """A mass on a spring that is one per cent too stiff in its file."""
    pytest.importorskip("mujoco")
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


def corrected(
    whole: TrialModel, cause: str, fault: float, explained: bool = True
) -> CorrectedMotion | None:
    """The motion corrected as if a diagnosis had named one cause and its fault."""
    (index,) = (i for i, h in enumerate(whole.hypotheses) if str(h.id) == cause)
    hypothesis = whole.hypotheses[index]
    estimate = hypothesis.value + hypothesis.correction * fault
    fit = Fit(
        members=(index,),
        hypotheses=(hypothesis,),
        faults=(fault,),
        estimates=(estimate,),
        standard_errors=(1e-9,),
        remaining=1e-10,
    )
    return correct_motion(whole, whole.task.target.motions, Ranking((fit,), explained, 1e-9))


def found_in(motion: CorrectedMotion | None) -> CorrectedMotion:
    assert motion is not None
    return motion


@pytest.mark.parametrize(("cause", "estimate", "what"), [
    ("k", 47.47, "equations"),
    ("joint[x]@stiffness", 47.0, "file"),
])  # fmt: skip
def test_the_right_value_explains_the_motion_in_every_scenario(
    whole: TrialModel, cause: str, estimate: float, what: str
) -> None:
    found = found_in(corrected(whole, cause, 0.47))
    assert [one.estimate for one in found.causes] == [pytest.approx(estimate)]
    assert [str(one) for one in found.causes] == [cause]
    assert found.put_into == what
    assert [one.scenario for one in found.scenarios] == list(whole.task.target.motions)
    for one in found.scenarios:
        assert np.max(np.abs(np.array(one.before))) > 1e-3
        assert np.max(np.abs(np.array(one.after))) < 1e-9
        # The equations with the file's spring: another motion. The file with the equations' spring:
        # theirs, but for the step.
        reference = whole.task.target.motions[one.scenario].states_at(np.array(one.t))
        apart = np.max(np.abs(np.array(one.corrected).T - reference)) / np.max(np.abs(reference))
        assert 0.005 < apart < 0.3 if what == "equations" else apart < 0.02


def test_a_wrong_value_does_not(whole: TrialModel) -> None:
    found = found_in(corrected(whole, "k", -1.0))
    assert all(np.max(np.abs(np.array(one.after))) > 1e-3 for one in found.scenarios)


def test_the_corrected_motion_obeys_the_equations_with_breaks_of_the_input(
    whole: TrialModel,
) -> None:
    """Nothing moved: the reference comes back, a step of force in it."""
    found = found_in(corrected(whole, "k", 0.0))
    for one in found.scenarios:
        reference = whole.task.target.motions[one.scenario].states_at(np.array(one.t)).T
        # Times have six digits: rounded by 5e-5 s, at up to 6 rad/s.
        states = np.array(one.corrected, dtype=float)
        np.testing.assert_allclose(states, reference, atol=3e-4 * np.max(np.abs(reference)))
        assert len(one.t) == 240


def test_the_zero_of_a_joint_is_moved_in_the_corrected_motion(whole: TrialModel) -> None:
    found = found_in(corrected(whole, "zero of x", 0.02))
    assert found.put_into == "file"
    free = next(one for one in found.scenarios if one.scenario == "free")
    assert abs(float(np.array(free.corrected)[0, -1])) == pytest.approx(0.02, rel=0.1)


def test_what_nothing_explains_is_not_corrected(whole: TrialModel) -> None:
    assert corrected(whole, "k", 0.47, explained=False) is None
