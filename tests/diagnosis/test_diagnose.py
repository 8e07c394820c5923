"""The ranking of causes, on made-up sensitivities where the truth is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from physics_crosscheck.harness.diagnosis.diagnose import Ranking, diagnose
from physics_crosscheck.harness.diagnosis.fit import Fit, Hypothesis
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.reference.mechanism.numeric import Array

N = 400
RNG = np.random.default_rng(5)
SHAPES = RNG.standard_normal((6, N))


@dataclass(frozen=True)
class Cause:
    hypothesis: Hypothesis
    shift: Callable[[float], Array]


def named(name: str, kind: CauseKind = "constant", rank: int = 2) -> Hypothesis:
    one = CauseId(kind=kind, subject=(name,))
    return Hypothesis(id=one, value=2.0, size=1.0, rank=rank)


def cause(
    index: int, kind: CauseKind = "constant", curve: float = 0.0, shape: Array | None = None
) -> Cause:
    """A cause whose effect is b s + curve b^2 s', with s' another shape."""
    row = SHAPES[index] if shape is None else shape

    def shift(fault: float) -> Array:
        moved: Array = fault * row + curve * fault**2 * np.roll(row, 7)
        return moved

    return Cause(named(f"cause {index}", kind, 0 if kind == "literal" else 2), shift)


@dataclass(frozen=True)
class MadeUp:
    """A problem whose faults add up, but for a bend where two meet."""

    whole: Array
    causes: list[Cause]
    meet: float = 0.0

    @property
    def hypotheses(self) -> list[Hypothesis]:
        return [c.hypothesis for c in self.causes]

    def defect(self, faults: Mapping[int, float]) -> Array:
        left = self.whole.copy()
        for i, fault in faults.items():
            left -= self.causes[i].shift(fault)
        return left

    def slopes(self, faults: Mapping[int, float], of: Sequence[int] | None = None) -> Array:
        step = 1e-6

        def at(i: int, delta: float) -> Array:
            return self.defect({**faults, i: faults.get(i, 0.0) + delta})

        return np.array(
            [
                (at(i, -step) - at(i, step)) / (2 * step)
                for i in (range(len(self.causes)) if of is None else of)
            ]
        )


def ask(defect: Array, causes: list[Cause], noise: float = 1e-10) -> Ranking:
    return diagnose(MadeUp(defect, causes), np.full(N, noise))


def noisy(defect: Array, noise: float = 1e-11) -> Array:
    return defect + noise * RNG.standard_normal(N)


def names(fit: Fit) -> list[str]:
    return [str(one) for one in fit.causes]


@pytest.mark.parametrize("fault", [1e-6, 1e-3, 0.05, -0.5])
def test_the_one_wrong_number_is_first_with_its_value(fault: float) -> None:
    causes = [cause(i, curve=0.5) for i in range(6)]
    found = ask(noisy(causes[3].shift(fault)), causes)
    first = found.fits[0]
    assert found.explained
    assert names(first) == ["cause 3"]
    assert first.estimates[0] == pytest.approx(2.0 + fault, abs=abs(fault) * 1e-4)
    assert first.remaining < 1e-4
    assert first.tied_with == ()
    assert found.fits[1].remaining > 0.5


def test_the_estimate_lies_within_some_standard_errors() -> None:
    causes = [cause(i) for i in range(6)]
    misses = []
    for _ in range(40):
        found = ask(noisy(causes[1].shift(1e-3), noise=1e-6), causes, noise=1e-6)
        first = found.fits[0]
        misses.append((first.estimates[0] - 2.001) / first.standard_errors[0])
    assert 0.2 < np.std(misses) < 1.5


def test_causes_that_no_data_tell_apart_are_tied_and_the_literal_leads() -> None:
    causes = [cause(i) for i in range(5)]
    causes.append(cause(5, kind="literal", shape=3 * SHAPES[2]))
    found = ask(noisy(causes[2].shift(1e-3)), causes)
    first = found.fits[0]
    assert names(first) == ["cause 5"]
    assert [str(one) for one in first.tied_with] == ["cause 2"]
    assert first.causes[0] in found.fits[1].tied_with


@pytest.mark.parametrize("noise", [1e-12, 1e-11, 1e-10])
def test_numbers_of_one_sum_are_in_the_order_of_the_file_whatever_the_rounding(
    noise: float,
) -> None:
    """Engines round differently, so the smallest remainder names another number in each."""
    shapes = [SHAPES[2], 2 * SHAPES[2], -3 * SHAPES[2]]
    causes = [cause(i, kind="literal", shape=shape) for i, shape in enumerate(shapes)]
    for _ in range(10):
        found = ask(noisy(1e-3 * SHAPES[2], noise), causes)
        assert [names(fit) for fit in found.fits] == [["cause 0"], ["cause 1"], ["cause 2"]]
        assert [str(one) for one in found.fits[0].tied_with] == ["cause 1", "cause 2"]


def test_of_equal_causes_the_one_whose_estimate_is_its_bound_value_is_first() -> None:
    shapes = [SHAPES[2], 2 * SHAPES[2], -3 * SHAPES[2]]
    causes = [cause(i, kind="literal", shape=shape) for i, shape in enumerate(shapes)]
    for i, expected in enumerate((2.0, 2.0 + 0.5e-3, 2.1)):  # right, wrong, wrong by more
        bound = replace(causes[i].hypothesis, expected=expected)
        causes[i] = replace(causes[i], hypothesis=bound)
    found = ask(noisy(1e-3 * SHAPES[2]), causes)
    assert names(found.fits[0]) == ["cause 1"]
    assert found.fits[0].estimates[0] == pytest.approx(2.0005, abs=1e-9)


def test_an_equal_cause_that_bends_is_fitted_too_though_another_is_straight() -> None:
    def bent(fault: float) -> Array:
        moved: Array = fault * SHAPES[2] + fault * (fault - 0.01) * SHAPES[5]
        return moved

    causes = [cause(i) for i in range(5)]
    causes.append(Cause(named("bent", "literal", 0), bent))
    found = ask(noisy(causes[2].shift(0.01)), causes)
    assert names(found.fits[0]) == ["bent"]
    assert all(f.remaining < 1e-6 for f in found.fits[:2])


def test_two_faults_at_once_are_named_as_a_pair() -> None:
    causes = [cause(i, curve=0.1) for i in range(6)]
    found = ask(noisy(causes[0].shift(1e-4) + causes[4].shift(1e-2)), causes)
    first = found.fits[0]
    assert found.explained
    assert set(names(first)) == {"cause 0", "cause 4"}
    values = dict(zip(names(first), first.estimates, strict=True))
    assert values["cause 0"] == pytest.approx(2.0001, abs=1e-6)
    assert values["cause 4"] == pytest.approx(2.01, abs=1e-6)


def test_what_nothing_explains_is_told_as_that() -> None:
    causes = [cause(i) for i in range(5)]
    found = ask(noisy(1e-3 * SHAPES[5]), causes)
    assert not found.explained
    assert found.fits[0].remaining > 0.5


def test_a_cause_is_named_where_the_bound_of_the_errors_is_as_large_as_what_it_does() -> None:
    causes = [cause(i) for i in range(4)]
    ranking = ask(noisy(1e-9 * SHAPES[2]), causes, noise=1e-9)
    assert ranking.floor == pytest.approx(1.0, rel=0.1)
    assert ranking.explained
    assert names(ranking.fits[0]) == ["cause 2"]
    assert not ranking.fits[0].tied_with
    nothing = ask(noisy(np.zeros(N), 1e-9), causes, noise=1e-9)
    assert not nothing.explained


@dataclass(frozen=True)
class Counted(MadeUp):
    """One that counts the models that are tried."""

    tried: list[int] = field(default_factory=list)

    def defect(self, faults: Mapping[int, float]) -> Array:
        if any(faults.values()):
            self.tried.append(len(faults))
        return super().defect(faults)

    def slopes(self, faults: Mapping[int, float], of: Sequence[int] | None = None) -> Array:
        return MadeUp(self.whole, self.causes).slopes(faults, of)


def test_a_fit_that_gains_nothing_ends() -> None:
    """Bent causes go on moving for as long as they are let."""
    problem = Counted(0.1 * RNG.standard_normal(N), [cause(i, curve=0.5) for i in range(6)])
    assert not diagnose(problem, np.full(N, 1e-10)).explained
    assert len(problem.tried) < 60


def test_what_falls_far_behind_a_cause_that_explains_all_is_tried_on_no_model() -> None:
    problem = Counted(1e-3 * SHAPES[0], [cause(i) for i in range(6)])
    assert diagnose(problem, np.full(N, 1e-10)).explained
    assert len(problem.tried) <= 3


def test_a_cause_without_any_effect_is_never_named() -> None:
    causes = [cause(i) for i in range(5)]
    causes.append(cause(5, shape=np.zeros(N)))
    found = ask(noisy(causes[0].shift(1e-3)), causes)
    assert all("cause 5" not in names(fit) for fit in found.fits)


def test_a_cause_that_has_no_effect_once_it_is_repaired_is_still_named() -> None:
    def saturated(fault: float) -> Array:
        moved: Array = min(fault, 1e-2) * SHAPES[0]  # a number beyond which nothing changes
        return moved

    causes = [Cause(named("saturated"), saturated), *(cause(i) for i in range(1, 6))]
    beside = np.sign(SHAPES[0] @ SHAPES[1]) * 1e-4  # the fit goes beyond, where nothing changes
    found = ask(noisy(causes[0].shift(1e-2) + causes[1].shift(beside)), causes)
    assert all(np.isfinite(fit.remaining) for fit in found.fits)
    assert set(names(found.fits[0])) >= {"saturated"}


def test_causes_are_told_apart_by_their_kind_too_and_never_by_their_words() -> None:
    causes = [cause(i) for i in range(5)]
    causes[3] = Cause(named("nut and bolt"), causes[3].shift)
    causes.append(cause(5, kind="literal", shape=3 * SHAPES[3]))
    causes[5] = Cause(named("nut and bolt", "literal", 0), causes[5].shift)
    first = ask(noisy(causes[3].shift(1e-3)), causes).fits[0]
    assert first.causes == (CauseId(kind="literal", subject=("nut and bolt",)),)
    assert first.tied_with == (CauseId(kind="constant", subject=("nut and bolt",)),)
