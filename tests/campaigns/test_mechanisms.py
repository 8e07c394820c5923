"""Random 3-D mechanisms: correct ones pass, all limits hold, and visible faults are reported."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import mpmath as mp
import msgspec
import numpy as np
import pytest

from campaigns import usd_trees
from campaigns.mechanisms import __main__ as command
from campaigns.mechanisms import census, truth
from campaigns.mechanisms.census import CensusOptions, study
from campaigns.mechanisms.drawn import VARIANTS, draw
from campaigns.mechanisms.dynamics import BodyPoses, MechanismDynamics, Real
from campaigns.mechanisms.faults import detection_of, judge_fault
from campaigns.mechanisms.mechanism import MJCF, Path, RandomMechanism, literals, with_fault
from campaigns.mechanisms.results import (
    Detection,
    MechanismFault,
    MechanismResult,
    all_correct,
    detection_lines,
    json_line,
    problem_lines,
    table,
)
from campaigns.mechanisms.trial import MechanismCase, judge_motion, loaded, prepare_case
from tests.campaigns import digits

SMALL = CensusOptions(seed=5, joints=3, segments=9)


def test_correct_mechanisms_pass_and_all_limits_hold() -> None:
    results = [study(SMALL, index) for index in range(9)]
    assert {result.group.split(",")[0] for result in results} == {
        f"{engine} {integrator}".strip() for engine, integrator, _ in VARIANTS
    }
    for result in results:
        assert not result.wrong, problem_lines(result, "")
        assert result.explained or result.outcome == "AGREES"
        assert result.limits
        assert result.truth < 0.01


@pytest.mark.slow
def test_only_visible_faults_are_reported() -> None:
    options = CensusOptions(seed=7, joints=3, segments=9, faults=2)
    results = [study(options, index) for index in range(9)]
    planted = [fault for result in results for fault in result.faults]
    for result in results:
        assert not result.wrong, problem_lines(result, "")
    assert len(planted) == 18
    assert {fault.share for fault in planted} == {1e-6, 1e-8}
    seen = [fault for fault in planted if fault.fate is Detection.MOTION]
    assert len(seen) > 9
    for fault in planted:
        if fault.fate is Detection.INVISIBLE:
            assert fault.effect == 0
            assert fault.pose < 1e-15


@pytest.mark.parametrize("index", range(len(VARIANTS)))
def test_file_has_the_numbers_of_the_mechanism(index: int) -> None:
    mechanism = draw(3, index)
    with loaded(mechanism) as (model, coordinates):
        assert model.coordinates == tuple(f"q{i + 1}" for i in range(len(mechanism.links)))
        assert model.step == mechanism.step
        assert np.allclose(model.gravity, mechanism.gravity, rtol=1e-15)
        states = np.array([[*mechanism.q, *mechanism.v]])
        z, w = coordinates.to_engine(states)
        assert np.array_equal(np.concatenate([z, w], axis=1), states)
        if mechanism.format == MJCF:
            assert np.array_equal(model.home, [link.reference for link in mechanism.links])


def test_usd_files_in_random_representations_are_read_right() -> None:
    pytest.importorskip("pxr")
    assert usd_trees.main(["--count", "4", "--seed", "2"]) == 0


def test_draws_differ_and_are_reproducible() -> None:
    drawn = [draw(3, index) for index in range(40)]
    assert all(a != b for a, b in pairwise(drawn))
    assert draw(3, 17) == drawn[17]
    assert {len(m.links) for m in drawn} == {1, 2, 3, 4, 5}
    assert {link.parent - i for m in drawn for i, link in enumerate(m.links)} > {-1, -2}
    for kind in ("stiffness", "rest", "damping", "armature", "reference"):
        assert any(getattr(link, kind) for m in drawn for link in m.links), kind
    assert {m.engine for m in (draw(3, i, engine="pybullet") for i in range(5))} == {"pybullet"}


def test_fault_changes_one_number_of_the_file() -> None:
    mechanism = draw(3, 1)
    numbers = literals(mechanism)
    assert ("step",) in numbers
    assert not {path[0] for path in numbers} & {"q", "v", "drives"}
    where = next(path for path in numbers if path[-2:] == ("centre", 2))
    assert isinstance(where[1], int)
    wrong = with_fault(mechanism, where, 0.5)
    link = mechanism.links[where[1]]
    x, y, z = link.centre
    links = list(mechanism.links)
    links[where[1]] = replace(link, centre=(x, y, 1.5 * z))
    assert wrong == replace(mechanism, links=tuple(links))


def test_time_step_fault_is_invisible() -> None:
    assert planted_at("step").fate is Detection.INVISIBLE


def test_moved_base_is_detected_by_frames() -> None:
    fault = planted_at("position")
    assert fault.fate is Detection.FRAMES
    assert 0 < fault.pose < 1e-6


def planted_at(field: str) -> MechanismFault:
    """Plant a fault in the first link, or in a global number, of a mechanism without products."""
    mechanism = draw(3, 3, max_joints=2)
    where = next(p for p in literals(mechanism) if field in p and (len(p) == 1 or p[1] == 0))
    return judge_fault(prepare_case(mechanism, 9), where, 1e-6, {})


@pytest.mark.parametrize(
    ("is_reported", "effect", "excess", "pose", "seen", "fate"),
    [
        (True, 1e-6, 1e3, 1e-6, 1e-6, Detection.MOTION),
        (True, 0.0, 0.0, 0.0, 0.0, Detection.FALSE),
        (False, 1e-6, 1e3, 1e-6, 1e-6, Detection.MISSED),
        (False, 0.0, 0.0, 1e-6, 1e-6, Detection.FRAMES),
        (False, 0.0, 0.0, 1e-6, 1e-16, Detection.MISSED),  # the engine's pose lacks the fault
        (True, 1e-6, 1e3, 0.0, 1e-6, Detection.FALSE),  # the engine's pose is wrong without a fault
        (False, 0.0, 0.0, 1e-12, 1e-12, Detection.FAINT),
        (False, 1e-14, 0.4, 0.0, 1e-16, Detection.BELOW),
        (False, 1e-6, 0.0, 0.0, 1e-16, Detection.BELOW),  # no limit is claimed
        (False, 0.0, 0.0, 1e-19, 1e-16, Detection.INVISIBLE),
    ],
)
def test_fate_of_a_fault(
    is_reported: bool, effect: float, excess: float, pose: float, seen: float, fate: Detection
) -> None:
    assert detection_of(is_reported, effect, excess, pose, seen) is fate


@pytest.mark.slow
def test_engine_error_is_explained_only_by_its_remark() -> None:
    options = replace(SMALL, engine="pybullet")
    results = [study(options, index) for index in range(1, 10, 2)]
    explained = [result for result in results if result.explained]
    assert len(explained) > 1
    for result in explained:
        assert result.group == "pybullet, urdf, products"
        assert "exact_axes; effect" in result.explained
        assert result.outside
        assert not result.wrong


def test_other_errors_are_not_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    options = replace(SMALL, engine="pybullet")

    def elsewhere(mechanism: RandomMechanism, segments: int) -> MechanismCase:
        posed = prepare_case(mechanism, segments)
        off = posed.truth.states * (1 + 1e-6)
        return replace(
            posed,
            truth=replace(posed.truth, states=off),
            motion=replace(posed.motion, end=off.astype(float)),
        )

    monkeypatch.setattr(census, "prepare_case", elsewhere)
    results = [study(options, index) for index in range(1, 6, 2)]
    assert all(result.wrong for result in results)
    assert not any(result.explained for result in results)


def test_error_of_a_mechanism_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(mechanism: RandomMechanism, segments: int) -> None:
        raise ZeroDivisionError("nothing to stand on")

    monkeypatch.setattr(census, "prepare_case", broken)
    result = study(SMALL, 0)
    assert result.wrong
    assert (result.outcome, result.reason) == ("FAILED", "ZeroDivisionError: nothing to stand on")


def test_failed_mechanism_affects_no_other() -> None:
    below = -1  # not a valid seed
    results = list(census.census(SMALL, [0, below, 1], jobs=1))
    assert [result.index for result in results] == [0, below, 1]
    assert [result.outcome for result in results] == ["AGREES", "FAILED", "AGREES"]
    assert results[1].reason.startswith("ValueError")


RIGHT = MechanismResult(
    index=0, group="mujoco RK4, mjcf", joints=2, outcome="AGREES", limits=8, worst=0.3
)
WRONG = msgspec.structs.replace(RIGHT, index=1, outside=2, worst=1.7)


OPEN = msgspec.structs.replace(RIGHT, index=1, outcome="UNRESOLVED")


@pytest.mark.parametrize(
    ("results", "code"), [([RIGHT], 0), ([RIGHT, WRONG], 1), ([RIGHT] * 9 + [OPEN], 1)]
)
def test_exit_code_is_0_only_if_all_results_are_right(
    results: list[MechanismResult],
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fake_census(
        options: CensusOptions, indices: Sequence[int], jobs: int
    ) -> Iterator[MechanismResult]:
        yield from results

    monkeypatch.setattr(command, "census", fake_census)
    assert command.main(["--count", "2", "--seed", "9"]) == code
    output = capsys.readouterr().out
    assert ("--seed 9 --only 1 --joints 5 --segments 31" in output) == bool(code)
    assert "mujoco RK4, mjcf" in output


def test_result_is_one_line() -> None:
    assert json_line(WRONG).count(b"\n") == 1
    assert msgspec.json.decode(json_line(WRONG), type=MechanismResult) == WRONG


@pytest.mark.parametrize(
    ("changed", "wrong"),
    [
        ({}, False),
        ({"outcome": "DIFFERS"}, True),
        ({"outcome": "FAILED"}, True),
        ({"outcome": "UNRESOLVED"}, False),
        ({"outcome": "UNRESOLVED", "outside": 1}, True),
        ({"outcome": "DIFFERS", "outside": 3, "explained": "the engine's own"}, False),
        ({"outside": 1}, True),
    ],
)
def test_wrong_results(changed: dict[str, object], wrong: bool) -> None:
    assert msgspec.structs.replace(RIGHT, **changed).wrong == wrong


def test_few_results_may_be_unresolved() -> None:
    assert all_correct([RIGHT] * 190 + [OPEN] * 2) is False
    assert all_correct([RIGHT] * 199 + [OPEN]) is True


@pytest.mark.parametrize("fate", list(Detection))
def test_fates_are_counted_and_two_of_them_are_wrong(fate: Detection) -> None:
    fault = MechanismFault(
        where="step", share=1e-6, fate=fate, effect=0.0, excess=0.0, pose=1e-9, outside=0
    )
    assert fault.wrong == (fate in (Detection.MISSED, Detection.FALSE))
    result = msgspec.structs.replace(RIGHT, faults=(fault,))
    assert result.wrong == fault.wrong
    counted = detection_lines(result.faults)
    assert counted[0] == "1 faults of 1e-06"
    assert any(row.startswith(f"       1 {fate}"[1:]) or f" 1 {fate}" in row for row in counted)
    assert len(table([result])) == 5


EPSILON = truth.EPSILON


def apart(actual: Real, wanted: list[Any]) -> float:
    """Return the largest error of `longdouble` numbers, relative to the largest of mpmath's."""
    pairs = [(float(x), float(x - np.longdouble(float(x)))) for x in actual]
    values = [mp.mpf(0) + mp.mpf(high) + mp.mpf(low) for high, low in pairs]
    size = max(1, *(abs(x) for x in wanted))
    return float(max(abs(a - b) for a, b in zip(values, wanted, strict=True)) / size)


@pytest.mark.parametrize("index", range(6))
def test_accelerations_have_more_digits_than_a_double(index: int) -> None:
    mechanism = draw(41, index)
    if mechanism.engine == "pybullet":  # does not normalize axes: an error of a double's last digit
        mechanism = replace(mechanism, engine="mujoco")
    n = len(mechanism.links)
    state = np.array([*mechanism.q, *mechanism.v], dtype=np.longdouble)[:, None]
    time = np.array([0.75], dtype=np.longdouble)
    dynamics = MechanismDynamics(mechanism)
    actual = dynamics.acceleration(time, state[:n], state[n:])[:, 0]
    with mp.workdps(digits.DIGITS):
        q, v = ([mp.mpf(x) for x in part] for part in (mechanism.q, mechanism.v))
        wanted = list(digits.accelerations(mechanism, mp.mpf(0.75), q, v))
        error = apart(actual, wanted)
    condition = np.linalg.cond(dynamics.mass_matrix(np.array([mechanism.q]))[0].astype(float))
    assert error < 100 * EPSILON * condition


@pytest.mark.slow
def test_ends_have_more_digits_than_a_double() -> None:
    mechanism = draw(41, 18, max_joints=2)
    assert mechanism.engine == "mujoco"
    posed = prepare_case(mechanism, 5)
    length = float(posed.motion.lengths[0])
    with mp.workdps(digits.DIGITS):
        wanted = digits.end(mechanism, float(posed.motion.t[2]), posed.motion.start[2], length)
        ends = posed.truth.states[2]
        off = [apart(ends[i : i + 1], wanted[i : i + 1]) * abs(wanted[i]) for i in range(len(ends))]
    assert np.all(np.array(off, dtype=float) <= posed.truth.error)
    assert np.all(posed.truth.error < 1e-16 * posed.motion.unit)


@cache
def three_hinges() -> RandomMechanism:
    """Return three hinges under RK4 without drives, which have the tightest limits."""
    mechanisms = (draw(43, index, max_joints=3) for index in range(400))
    return next(
        replace(m, drives=())
        for m in mechanisms
        if m.kinds == (True,) * 3 and m.integrator == "RK4" and m.format == MJCF
    )


def differs(posed: MechanismCase, mechanism: RandomMechanism) -> bool:
    return bool(np.any(judge_motion(posed, mechanism, 1e-9).ratios > 1))


def test_correct_mechanism_does_not_differ() -> None:
    assert not differs(prepare_case(three_hinges(), 9), three_hinges())


@pytest.mark.parametrize(
    "where", [("links", 1, "mass"), ("links", 2, "inertia", 0), ("links", 1, "centre", 1)]
)
def test_wrong_number_in_the_equations_is_detected(where: Path) -> None:
    assert differs(prepare_case(with_fault(three_hinges(), where, 1e-9), 9), three_hinges())


def test_wrong_term_in_the_equations_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = three_hinges()
    right = MechanismDynamics._biases

    def wrong(self: MechanismDynamics, poses: BodyPoses, v: Real) -> tuple[Real, Real, Real]:
        spins, turning, moving = right(self, poses, v)
        return spins, turning * (1 + 1e-8), moving

    monkeypatch.setattr(MechanismDynamics, "_biases", wrong)
    assert differs(prepare_case(mechanism, 9), mechanism)


def test_missing_convergence_is_reported() -> None:
    mechanism = three_hinges()
    states = np.array([[*mechanism.q, *mechanism.v]])
    with pytest.raises(truth.TruthError, match="does not converge"):
        truth.ends(MechanismDynamics(mechanism), np.zeros(1), states, 20.0)
