"""One mechanism through the harness's own segments and verdict, beside what it must do."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import process_time
from types import MappingProxyType

import numpy as np

from campaigns.mechanisms.dynamics import Dynamics
from campaigns.mechanisms.joints import identity, inputs
from campaigns.mechanisms.mechanism import Mechanism
from campaigns.mechanisms.truth import Ends, TruthError, ends
from campaigns.mechanisms.written import joint_name, sidecar
from physics_crosscheck.harness.checks.verdict import CaseJudgement, component_scale, judge
from physics_crosscheck.harness.engines.protocol import Array, Engine, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.ladder import movement
from physics_crosscheck.harness.numerics.segments import Extrapolated, extrapolate
from physics_crosscheck.reference.solving.segments import Segments

SEGMENTS_A_PERIOD = 20
"""As `reference.solving.solve` cuts its motions."""

SLOWEST = 1.0
"""Least rate for which segments are made short, rad/s."""

Settings = Mapping[str, object]
_NONE: Settings = MappingProxyType({})

EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True, kw_only=True)
class Posed:
    """A mechanism's motion, cut in segments.

    Attributes:
        motion: as the harness takes it, its ends rounded to doubles.
        truth: the same ends with all their digits.
    """

    mechanism: Mechanism
    motion: Segments
    truth: Ends


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What the harness found.

    Attributes:
        verdict: at the resolution asked.
        found: every limit with its uncertainty.
        uncertainty: of every limit, with the truth's own bound, (K, 2n).
        ratios: errors of the limits by their uncertainty, (K, 2n).
        seconds: processor time.
    """

    verdict: CaseJudgement
    found: Extrapolated
    uncertainty: Array
    ratios: Array
    seconds: float


def pose(mechanism: Mechanism, segments: int) -> Posed:
    """Choose segments along a motion, and find where each must end.

    They start where the engine itself passes at some step: any states will do.

    Raises:
        EngineError: where the engine refuses the file.
        TruthError: where the equations can't be solved.
    """
    fastest, starts = _passed(mechanism, segments)
    length = _length(fastest)
    t = length * np.arange(segments, dtype=np.float64)
    truth = ends(Dynamics(mechanism), t, starts, length)
    end = truth.states.astype(float)
    # The ends are rounded to doubles.
    bound = truth.error.astype(float) + EPSILON / 2 * np.max(np.abs(end), axis=0)
    still = not any(drive.varies for drive in mechanism.drives)
    motion = Segments(
        start=starts,
        lengths=np.full(segments, length),
        inputs=inputs(mechanism.drives, length * segments),
        end=end,
        bound=bound,
        t=t,
        varying=not still,
        fastest=fastest,
    )
    # There is no other scenario that could say how far a component moves that hardly does here.
    scale = np.maximum(component_scale(motion, []), movement(end, starts))
    return Posed(mechanism=mechanism, motion=replace(motion, scale=scale), truth=truth)


def examine(
    posed: Posed, mechanism: Mechanism, resolution: float, settings: Settings = _NONE
) -> Judged:
    """Judge a mechanism, the posed one or one with a fault, over the posed motion.

    With settings of the engine's, if any, beside the usual ones.

    Raises:
        EngineError, BlownUpError: where it can't be run.
    """
    began = process_time()
    motion = posed.motion
    with loaded(mechanism, settings) as (model, coordinates):
        found = extrapolate(model, coordinates, motion, resolution=resolution)
        claimed = model.exponents(motion.varying)[0]
    names = tuple(joint_name(i) for i in range(len(mechanism.links)))
    components = (*names, *(f"{name}_dot" for name in names))
    verdict = judge(found.limit, motion, components, claimed, resolution)
    uncertainty = found.limit.uncertainty + motion.bound
    known = np.isfinite(uncertainty)
    error = np.abs(found.limit.value - posed.truth.states).astype(float)
    return Judged(
        verdict=verdict,
        found=found,
        uncertainty=uncertainty,
        ratios=np.where(known, error / np.where(known, uncertainty, 1.0), 0.0),
        seconds=process_time() - began,
    )


@contextmanager
def loaded(
    mechanism: Mechanism, settings: Settings = _NONE
) -> Iterator[tuple[LoadedModel, CoordinateMap]]:
    """The mechanism in its engine, from a file, by the ordinary adapter."""
    with tempfile.TemporaryDirectory() as folder:
        beside = sidecar(mechanism, Path(folder), settings)
        model = _engines()[mechanism.engine].load(beside.spec(mechanism.engine))
        driven = tuple(drive.joint for drive in mechanism.drives)
        yield model, identity(mechanism.kinds, driven, model.coordinates)


def undone(mechanism: Mechanism) -> Settings:
    """Settings that undo what the engine loses of the file's digits, as its remarks have it."""
    with loaded(mechanism) as (model, _):
        still = np.zeros((1, len(mechanism.links)))
        remarks = model.remarks(still, still)
        return {key: value for remark in remarks for key, value in remark.undone_by.items()}


@cache
def _engines() -> dict[str, Engine]:
    return engines()


def _length(fastest: float) -> float:
    return 2 * np.pi / fastest / SEGMENTS_A_PERIOD


def _passed(mechanism: Mechanism, segments: int) -> tuple[float, Array]:
    """The fastest rate along the engine's motion, and the states that it passes, (segments, 2n)."""
    dynamics = Dynamics(mechanism, np.float64)
    start = np.array([*mechanism.q, *mechanism.v])[None]
    fastest = max(SLOWEST, _rate(dynamics, start))
    with loaded(mechanism) as (model, _):
        # Twice: the rate at the start may be a small one, and steps by it too long.
        for _ in range(2):
            try:
                states = _rolled(model, dynamics, start, _length(fastest), segments)
            except TruthError:
                fastest *= 4
            else:
                fastest = max(fastest, _rate(dynamics, states[:: max(1, segments // 10)]))
        return fastest, _rolled(model, dynamics, start, _length(fastest), segments)


STEPS = 4
"""A segment, on the way to the states where segments start."""


def _rolled(
    model: LoadedModel, dynamics: Dynamics, start: Array, length: float, segments: int
) -> Array:
    n, steps = start.shape[1] // 2, STEPS * (segments - 1)
    h = length / STEPS
    force = dynamics.inputs(h * np.arange(steps), (n, steps)).T[None].astype(float)
    q, v = model.rollout(start[:, :n], start[:, n:], h, steps, force, STEPS)
    states = np.concatenate([start, np.concatenate([q[0], v[0]], axis=1)])
    if not np.isfinite(states).all():
        raise TruthError("the motion is not finite")
    return states


def _rate(dynamics: Dynamics, states: Array) -> float:
    """Largest |eigenvalue| of the equations' Jacobian, of the hinges' speeds and of the drives."""
    count, n = len(states), states.shape[1] // 2
    step = 1e-6
    moves = step * np.concatenate([np.eye(2 * n), -np.eye(2 * n)])
    moved = (states[:, None] + moves).reshape(-1, 2 * n).T
    found = dynamics.acceleration(np.zeros(moved.shape[1]), moved[:n], moved[n:]).astype(float)
    changes = found.T.reshape(count, 2, 2 * n, n)
    full = np.zeros((count, 2 * n, 2 * n))
    full[:, range(n), range(n, 2 * n)] = 1.0
    full[:, n:] = ((changes[:, 0] - changes[:, 1]) / (2 * step)).swapaxes(1, 2)
    hinges = np.array(dynamics.mechanism.kinds)
    return max(
        float(np.max(np.abs(np.linalg.eigvals(full)))),
        float(np.max(np.abs(states[:, n:][:, hinges]), initial=0.0)),
        *(drive.rate for drive in dynamics.mechanism.drives if drive.varies),
    )
