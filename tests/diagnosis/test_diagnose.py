"""Causes are ranked by the discrepancy that remains; the motion that the best one corrects."""

import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.diagnosis.diagnose import Ranking, diagnose
from physics_crosscheck.harness.diagnosis.fit import Fit, Hypothesis
from physics_crosscheck.harness.diagnosis.task import correct_motion, diagnose_model, trial_model
from physics_crosscheck.harness.diagnosis.trial import TrialModel
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.cause import CauseKind
from physics_crosscheck.harness.records.finding import CorrectedMotion
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.records import CauseId, Diagnosis, SourceLine
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.physics import physics

N = 400
RNG = np.random.default_rng(5)
SHAPES = RNG.standard_normal((6, N))


@dataclass(frozen=True)
class Cause:
    hypothesis: Hypothesis
    shift: Callable[[float], Array]


def hypothesis(name: str, kind: CauseKind = "constant", rank: int = 2) -> Hypothesis:
    identity = CauseId(kind=kind, subject=(name,))
    return Hypothesis(id=identity, value=2.0, size=1.0, rank=rank)


def cause(
    index: int, kind: CauseKind = "constant", curve: float = 0.0, shape: Array | None = None
) -> Cause:
    """Return a cause with the effect b s + curve b^2 s', where s' is s rolled."""
    row = SHAPES[index] if shape is None else shape

    def shift(fault: float) -> Array:
        moved: Array = fault * row + curve * fault**2 * np.roll(row, 7)
        return moved

    return Cause(hypothesis(f"cause {index}", kind, 0 if kind == "literal" else 2), shift)


@dataclass(frozen=True)
class SyntheticProblem:
    """A problem whose faults add up."""

    whole: Array
    causes: list[Cause]
    meet: float = 0.0

    @property
    def hypotheses(self) -> list[Hypothesis]:
        return [c.hypothesis for c in self.causes]

    def defect(self, faults: Mapping[int, float]) -> Array:
        residual = self.whole.copy()
        for i, fault in faults.items():
            residual -= self.causes[i].shift(fault)
        return residual

    def slopes(self, faults: Mapping[int, float], indices: Sequence[int] | None = None) -> Array:
        step = 1e-6

        def shifted(i: int, delta: float) -> Array:
            return self.defect({**faults, i: faults.get(i, 0.0) + delta})

        return np.array(
            [
                (shifted(i, -step) - shifted(i, step)) / (2 * step)
                for i in (range(len(self.causes)) if indices is None else indices)
            ]
        )


def rank(defect: Array, causes: list[Cause], noise: float = 1e-10) -> Ranking:
    return diagnose(SyntheticProblem(defect, causes), np.full(N, noise))


def noisy(defect: Array, noise: float = 1e-11) -> Array:
    return defect + noise * RNG.standard_normal(N)


def names(fit: Fit) -> list[str]:
    return [str(one) for one in fit.causes]


@pytest.mark.parametrize("fault", [1e-6, 1e-3, 0.05, -0.5])
def test_single_wrong_number_is_ranked_first_with_its_value(fault: float) -> None:
    causes = [cause(i, curve=0.5) for i in range(6)]
    ranking = rank(noisy(causes[3].shift(fault)), causes)
    first = ranking.fits[0]
    assert ranking.explained
    assert names(first) == ["cause 3"]
    assert first.estimates[0] == pytest.approx(2.0 + fault, abs=abs(fault) * 1e-4)
    assert first.remaining < 1e-4
    assert first.tied_with == ()
    assert ranking.fits[1].remaining > 0.5


def test_standard_error_of_the_estimate_is_realistic() -> None:
    causes = [cause(i) for i in range(6)]
    misses = []
    for _ in range(40):
        ranking = rank(noisy(causes[1].shift(1e-3), noise=1e-6), causes, noise=1e-6)
        first = ranking.fits[0]
        misses.append((first.estimates[0] - 2.001) / first.standard_errors[0])
    assert 0.2 < np.std(misses) < 1.5


def test_indistinguishable_causes_are_tied_and_the_literal_is_first() -> None:
    causes = [cause(i) for i in range(5)]
    causes.append(cause(5, kind="literal", shape=3 * SHAPES[2]))
    ranking = rank(noisy(causes[2].shift(1e-3)), causes)
    first = ranking.fits[0]
    assert names(first) == ["cause 5"]
    assert [str(one) for one in first.tied_with] == ["cause 2"]
    assert first.causes[0] in ranking.fits[1].tied_with


@pytest.mark.parametrize("noise", [1e-12, 1e-11, 1e-10])
def test_tied_literals_are_in_file_order_for_any_rounding(noise: float) -> None:
    """Prevent that rounding, which differs between engines, decides the order."""
    shapes = [SHAPES[2], 2 * SHAPES[2], -3 * SHAPES[2]]
    causes = [cause(i, kind="literal", shape=shape) for i, shape in enumerate(shapes)]
    for _ in range(10):
        ranking = rank(noisy(1e-3 * SHAPES[2], noise), causes)
        assert [names(fit) for fit in ranking.fits] == [["cause 0"], ["cause 1"], ["cause 2"]]
        assert [str(one) for one in ranking.fits[0].tied_with] == ["cause 1", "cause 2"]


def test_tied_cause_with_an_estimate_at_its_bound_value_is_first() -> None:
    shapes = [SHAPES[2], 2 * SHAPES[2], -3 * SHAPES[2]]
    causes = [cause(i, kind="literal", shape=shape) for i, shape in enumerate(shapes)]
    for i, expected in enumerate((2.0, 2.0 + 0.5e-3, 2.1)):  # right, wrong, wrong by more
        bound = replace(causes[i].hypothesis, expected=expected)
        causes[i] = replace(causes[i], hypothesis=bound)
    ranking = rank(noisy(1e-3 * SHAPES[2]), causes)
    assert names(ranking.fits[0]) == ["cause 1"]
    assert ranking.fits[0].estimates[0] == pytest.approx(2.0005, abs=1e-9)


def test_nonlinear_cause_is_fitted_despite_a_tied_linear_cause() -> None:
    def nonlinear(fault: float) -> Array:
        moved: Array = fault * SHAPES[2] + fault * (fault - 0.01) * SHAPES[5]
        return moved

    causes = [cause(i) for i in range(5)]
    causes.append(Cause(hypothesis("bent", "literal", 0), nonlinear))
    ranking = rank(noisy(causes[2].shift(0.01)), causes)
    assert names(ranking.fits[0]) == ["bent"]
    assert all(f.remaining < 1e-6 for f in ranking.fits[:2])


def test_two_simultaneous_faults_are_named_as_a_pair() -> None:
    causes = [cause(i, curve=0.1) for i in range(6)]
    ranking = rank(noisy(causes[0].shift(1e-4) + causes[4].shift(1e-2)), causes)
    first = ranking.fits[0]
    assert ranking.explained
    assert set(names(first)) == {"cause 0", "cause 4"}
    values = dict(zip(names(first), first.estimates, strict=True))
    assert values["cause 0"] == pytest.approx(2.0001, abs=1e-6)
    assert values["cause 4"] == pytest.approx(2.01, abs=1e-6)


def test_unexplained_defect_is_reported_as_unexplained() -> None:
    causes = [cause(i) for i in range(5)]
    ranking = rank(noisy(1e-3 * SHAPES[5]), causes)
    assert not ranking.explained
    assert ranking.fits[0].remaining > 0.5


def test_cause_is_named_if_the_uncertainty_is_as_large_as_its_effect() -> None:
    causes = [cause(i) for i in range(4)]
    ranking = rank(noisy(1e-9 * SHAPES[2]), causes, noise=1e-9)
    assert ranking.floor == pytest.approx(1.0, rel=0.1)
    assert ranking.explained
    assert names(ranking.fits[0]) == ["cause 2"]
    assert not ranking.fits[0].tied_with
    nothing = rank(noisy(np.zeros(N), 1e-9), causes, noise=1e-9)
    assert not nothing.explained


@dataclass(frozen=True)
class CountingProblem(SyntheticProblem):
    """A problem that records the models that are tried."""

    tried: list[int] = field(default_factory=list)

    def defect(self, faults: Mapping[int, float]) -> Array:
        if any(faults.values()):
            self.tried.append(len(faults))
        return super().defect(faults)

    def slopes(self, faults: Mapping[int, float], indices: Sequence[int] | None = None) -> Array:
        return SyntheticProblem(self.whole, self.causes).slopes(faults, indices)


def test_fit_without_progress_stops() -> None:
    """Cover nonlinear causes, whose estimates would keep changing."""
    problem = CountingProblem(0.1 * RNG.standard_normal(N), [cause(i, curve=0.5) for i in range(6)])
    assert not diagnose(problem, np.full(N, 1e-10)).explained
    assert len(problem.tried) < 60


def test_causes_far_behind_a_full_explanation_are_not_tried() -> None:
    problem = CountingProblem(1e-3 * SHAPES[0], [cause(i) for i in range(6)])
    assert diagnose(problem, np.full(N, 1e-10)).explained
    assert len(problem.tried) <= 3


def test_cause_without_effect_is_never_named() -> None:
    causes = [cause(i) for i in range(5)]
    causes.append(cause(5, shape=np.zeros(N)))
    ranking = rank(noisy(causes[0].shift(1e-3)), causes)
    assert all("cause 5" not in names(fit) for fit in ranking.fits)


def test_saturating_cause_is_still_named() -> None:
    def saturated(fault: float) -> Array:
        moved: Array = min(fault, 1e-2) * SHAPES[0]  # no effect beyond 1e-2
        return moved

    causes = [Cause(hypothesis("saturated"), saturated), *(cause(i) for i in range(1, 6))]
    second_fault = np.sign(SHAPES[0] @ SHAPES[1]) * 1e-4  # the fit overshoots into saturation
    ranking = rank(noisy(causes[0].shift(1e-2) + causes[1].shift(second_fault)), causes)
    assert all(np.isfinite(fit.remaining) for fit in ranking.fits)
    assert set(names(ranking.fits[0])) >= {"saturated"}


def test_causes_with_equal_names_are_distinguished_by_kind() -> None:
    causes = [cause(i) for i in range(5)]
    causes[3] = Cause(hypothesis("nut and bolt"), causes[3].shift)
    causes.append(cause(5, kind="literal", shape=3 * SHAPES[3]))
    causes[5] = Cause(hypothesis("nut and bolt", "literal", 0), causes[5].shift)
    first = rank(noisy(causes[3].shift(1e-3)), causes).fits[0]
    assert first.causes == (CauseId(kind="literal", subject=("nut and bolt",)),)
    assert first.tied_with == (CauseId(kind="constant", subject=("nut and bolt",)),)


@dataclass(frozen=True)
class Linear:
    """A discrepancy, (N,), and the effects of unit faults, (H, N)."""

    discrepancy: Array
    rows: Array

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        return [
            Hypothesis(id=CauseId(kind="literal", subject=(f"{i}",)), value=1.0, size=1.0, rank=0)
            for i in range(len(self.rows))
        ]

    def defect(self, faults: Mapping[int, float]) -> Array:
        residual: Array = self.discrepancy - sum(by * self.rows[i] for i, by in faults.items())
        return residual

    def slopes(self, faults: Mapping[int, float], indices: Sequence[int] | None = None) -> Array:
        return self.rows if indices is None else self.rows[list(indices)]


def test_precise_ends_without_effect_do_not_decide_the_diagnosis() -> None:
    """Combine a precise component without effect with one of large uncertainty."""
    random = np.random.default_rng(2)
    precise, imprecise = slice(0, 30), slice(90, 120)
    rows = random.normal(size=(6, 120))
    rows[:, precise] = 1e-9 * random.normal(size=(6, 30))
    uncertainty = np.full(120, 2e-9)
    uncertainty[precise], uncertainty[imprecise] = 1e-12, 3e-6
    discrepancy = 1e-7 * rows[4] + 0.1 * uncertainty * random.normal(size=120)
    ranking = diagnose(Linear(discrepancy, rows), uncertainty)
    assert ranking.explained
    assert ranking.fits[0].members == (4,)
    assert abs(ranking.fits[0].faults[0] / 1e-7 - 1) < 1e-2


MASS = "body[nut and bolt]/inertial@mass"


def make_task(tmp_path: Path, mass: str) -> SystemTask:
    """Return a task of the mass on a spring whose body is called `nut and bolt`."""
    folder = tmp_path / "mass_spring_damper"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    for name, old, new in (
        ("mujoco.xml", '<body name="mass"', '<body name="nut and bolt"'),
        ("mujoco.xml", 'mass="1.3"', f'mass="{mass}"'),
        ("mujoco.xml.toml", "body[mass]", "body[nut and bolt]"),
    ):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    prepared = physics("mass_spring_damper")
    task = model_task(prepared, "mujoco", read_sidecar(folder / "mujoco.xml.toml"))
    motions = dict(list(prepared.motions.items())[:2])  # free and forced
    return task.with_target(motions=motions)


def test_body_with_and_in_its_name_is_one_cause(tmp_path: Path) -> None:
    task = make_task(tmp_path, "1.313")
    diagnosis = diagnose_model(task)
    assert diagnosis.explained
    assert not diagnosis.failure
    first = diagnosis.explanations[0]
    (cause,) = first.causes
    assert cause.id == CauseId(kind="literal", subject=(MASS,))
    text = task.declared.model.read_text()
    line = text[: text.index('mass="1.313"')].count("\n") + 1
    start = text.encode().index(b'mass="1.313"') + len(b'mass="')
    where = SourceLine(file="mujoco.xml", line=line, span=(start, start + 5), text="1.313")
    assert cause.locations == (where,)
    assert cause.replacement == "1.3"
    assert cause.estimate == pytest.approx(1.3, rel=1e-6)
    sentence, residual = cause_sentences(first)
    assert sentence.startswith(f"{MASS} (mujoco.xml:{line}) is 1.313; the motion implies 1.3")
    assert residual.startswith("residual ")
    assert diagnosis.corrected is not None
    assert len(diagnosis.corrected.causes) == 1
    assert msgspec.json.decode(msgspec.json.encode(diagnosis), type=Diagnosis) == diagnosis


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
