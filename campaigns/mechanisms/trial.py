"""Judgement of a mechanism by the harness, and the error of each limit by the equations."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import sympy as sp

from campaigns.mechanisms.dynamics import MechanismDynamics
from campaigns.mechanisms.mechanism import AppliedForce, RandomMechanism
from campaigns.mechanisms.truth import SegmentEnds, TruthError, ends
from campaigns.mechanisms.written import joint_name, sidecar
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.engines.protocol import Array, Engine, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, identity
from physics_crosscheck.harness.numerics.ladder import movement
from physics_crosscheck.harness.numerics.segments import Extrapolated, extrapolate
from physics_crosscheck.reference.mechanism.declaration import t
from physics_crosscheck.reference.mechanism.numeric import compile_function
from physics_crosscheck.reference.mechanism.signal import Inputs, SignalPiece, numeric_inputs
from physics_crosscheck.reference.solving.segments import Segments

SEGMENTS_PER_PERIOD = 20
"""Segments in a period of the fastest rate, as in `reference.solving.solve`."""

MIN_RATE = 1.0
"""Smallest rate that sets the length of segments, rad/s."""

Settings = Mapping[str, object]
_NONE: Settings = MappingProxyType({})

EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True, kw_only=True)
class MechanismCase:
    """A mechanism and the segments of its motion.

    Attributes:
        motion: segments for the harness, with ends rounded to doubles.
        truth: ends of the segments in `longdouble`.
    """

    mechanism: RandomMechanism
    motion: Segments
    truth: SegmentEnds


@dataclass(frozen=True, kw_only=True)
class MechanismJudgement:
    """The verdict of the harness on a mechanism, and the errors of its limits.

    Attributes:
        verdict: at the requested resolution.
        extrapolated: every limit with its uncertainty.
        uncertainty: of every limit, with the bound of the reference ends, (K, 2n).
        ratios: errors of the limits over their uncertainty, (K, 2n).
    """

    verdict: CaseJudgement
    extrapolated: Extrapolated
    uncertainty: Array
    ratios: Array


def prepare_case(mechanism: RandomMechanism, segments: int) -> MechanismCase:
    """Choose segments along a motion, and solve for the end of each.

    They start at states of a run of the engine: any states will do.

    Raises:
        EngineError: if the engine refuses the file.
        TruthError: if the equations can't be solved.
    """
    fastest, starts = _starts(mechanism, segments)
    length = _length(fastest)
    times = length * np.arange(segments, dtype=np.float64)
    truth = ends(MechanismDynamics(mechanism), times, starts, length)
    end = truth.states.astype(float)
    # Rounding the ends to doubles adds to their error.
    bound = truth.error.astype(float) + EPSILON / 2 * np.max(np.abs(end), axis=0)
    motion = Segments(
        start=starts,
        lengths=np.full(segments, length),
        inputs=inputs(mechanism.drives, length * segments),
        end=end,
        bound=bound,
        t=times,
        varying=any(drive.varies for drive in mechanism.drives),
        fastest=fastest,
    )
    # No other scenario scales a component that hardly moves here.
    scale = np.maximum(component_scale(motion, []), movement(end, starts))
    return MechanismCase(mechanism=mechanism, motion=replace(motion, scale=scale), truth=truth)


def judge_motion(
    case: MechanismCase, mechanism: RandomMechanism, resolution: float, settings: Settings = _NONE
) -> MechanismJudgement:
    """Judge a mechanism over the segments of a case: that of the case, or a faulty copy.

    Args:
        case: the segments and their ends.
        mechanism: the mechanism to run.
        resolution: of the verdict.
        settings: added to the usual settings of the engine.

    Raises:
        EngineError, BlownUpError: if the engine can't run it.
    """
    motion = case.motion
    with loaded(mechanism, settings) as (model, coordinates):
        extrapolated = extrapolate(model, coordinates, motion, resolution=resolution)
        claimed = model.exponents(motion.varying)[0]
    names = tuple(joint_name(i) for i in range(len(mechanism.links)))
    components = (*names, *(f"{name}_dot" for name in names))
    verdict = judge(extrapolated.limit, motion, components, claimed, resolution)
    uncertainty = extrapolated.limit.uncertainty + motion.bound
    finite = np.isfinite(uncertainty)
    error = np.abs(extrapolated.limit.value - case.truth.states).astype(float)
    return MechanismJudgement(
        verdict=verdict,
        extrapolated=extrapolated,
        uncertainty=uncertainty,
        ratios=np.where(finite, error / np.where(finite, uncertainty, 1.0), 0.0),
    )


@contextmanager
def loaded(
    mechanism: RandomMechanism, settings: Settings = _NONE
) -> Iterator[tuple[LoadedModel, CoordinateMap]]:
    """Yield the mechanism, loaded from a file in its engine, and its coordinate map."""
    with tempfile.TemporaryDirectory() as folder:
        model_file = sidecar(mechanism, Path(folder), settings)
        model = _engines()[mechanism.engine].load(model_file.spec(mechanism.engine))
        assert model.coordinates == tuple(joint_name(i) for i in range(len(mechanism.links)))
        driven = tuple(drive.joint for drive in mechanism.drives)
        yield model, joint_map(len(mechanism.links), driven)


def inputs(drives: tuple[AppliedForce, ...], duration: float) -> Inputs:
    """Return the forces of the drives over the whole motion, `duration` seconds."""
    expressions = tuple(
        sp.Float(d.offset, 17) + sp.Float(d.amplitude, 17) * sp.sin(d.rate * t + d.phase)
        if d.varies
        else sp.Float(d.offset, 17)
        for d in drives
    )
    return numeric_inputs([SignalPiece(start=0.0, stop=duration, expressions=expressions)])


@cache
def joint_map(joints: int, driven: tuple[int, ...]) -> CoordinateMap:
    """Return the map of a mechanism whose coordinates are its joints, some of them driven."""
    z, u = (sp.symbols(f"{name}:{n}", real=True) for name, n in (("z", joints), ("u", len(driven))))
    matrix = np.eye(joints)[:, list(driven)]
    forces = [u[driven.index(i)] if i in driven else sp.Integer(0) for i in range(joints)]
    push = compile_function(forces, list(z), list(u))
    return replace(identity(joints), push=push, push_matrix=matrix)


def corrective_settings(mechanism: RandomMechanism) -> Settings:
    """Return the settings by which the engine loses no digits of the file, from its remarks."""
    with loaded(mechanism) as (model, _):
        still = np.zeros((1, len(mechanism.links)))
        remarks = model.remarks(still, still)
        return {key: value for remark in remarks for key, value in remark.undone_by.items()}


@cache
def _engines() -> dict[str, Engine]:
    return engines()


def _length(fastest: float) -> float:
    return 2 * np.pi / fastest / SEGMENTS_PER_PERIOD


def _starts(mechanism: RandomMechanism, segments: int) -> tuple[float, Array]:
    """Return the fastest rate along a run of the engine, rad/s, and its states, (segments, 2n)."""
    dynamics = MechanismDynamics(mechanism, np.float64)
    start = np.array([*mechanism.q, *mechanism.v])[None]
    fastest = max(MIN_RATE, _rate(dynamics, start))
    with loaded(mechanism) as (model, _):
        # Twice: the rate at the start may be small, and its steps too long.
        for _ in range(2):
            try:
                states = _rollout(model, dynamics, start, _length(fastest), segments)
            except TruthError:
                fastest *= 4
            else:
                fastest = max(fastest, _rate(dynamics, states[:: max(1, segments // 10)]))
        return fastest, _rollout(model, dynamics, start, _length(fastest), segments)


STEPS_PER_SEGMENT = 4
"""Steps per segment of the run that gives the starts."""


def _rollout(
    model: LoadedModel, dynamics: MechanismDynamics, start: Array, length: float, segments: int
) -> Array:
    n, steps = start.shape[1] // 2, STEPS_PER_SEGMENT * (segments - 1)
    h = length / STEPS_PER_SEGMENT
    force = dynamics.inputs(h * np.arange(steps), (n, steps)).T[None].astype(float)
    q, v = model.rollout(start[:, :n], start[:, n:], h, steps, force, STEPS_PER_SEGMENT)
    states = np.concatenate([start, np.concatenate([q[0], v[0]], axis=1)])
    if not np.isfinite(states).all():
        raise TruthError("the motion is not finite")
    return states


def _rate(dynamics: MechanismDynamics, states: Array) -> float:
    """Return the largest of |eigenvalues| of the Jacobian, hinge speeds and drive rates, rad/s."""
    count, n = len(states), states.shape[1] // 2
    step = 1e-6
    moves = step * np.concatenate([np.eye(2 * n), -np.eye(2 * n)])
    moved = (states[:, None] + moves).reshape(-1, 2 * n).T
    qdd = dynamics.acceleration(np.zeros(moved.shape[1]), moved[:n], moved[n:]).astype(float)
    changes = qdd.T.reshape(count, 2, 2 * n, n)
    full = np.zeros((count, 2 * n, 2 * n))
    full[:, range(n), range(n, 2 * n)] = 1.0
    full[:, n:] = ((changes[:, 0] - changes[:, 1]) / (2 * step)).swapaxes(1, 2)
    hinges = np.array(dynamics.mechanism.kinds)
    return max(
        float(np.max(np.abs(np.linalg.eigvals(full)))),
        float(np.max(np.abs(states[:, n:][:, hinges]), initial=0.0)),
        *(drive.rate for drive in dynamics.mechanism.drives if drive.varies),
    )
