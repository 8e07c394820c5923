"""Excitation of the source: initial states, lengths and end states of runs.

Where each coordinate moves independently, initial states are random. Where coordinates are
coupled (a mimic, a rolling wheel, the bodies of a Space), forces push the mechanism from the
position in which the file draws it. Each chain of runs is driven by a known random force that is
constant during a run, or runs free.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.compare.candidate import Candidate, CompareError
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.runs import Runs, ends
from physics_crosscheck.harness.compare.scales import (
    MIN_RESPONSE,
    CharacteristicScales,
    characteristic_scales,
)
from physics_crosscheck.harness.engines.protocol import Array, Model
from physics_crosscheck.harness.numerics.ladder import Limit, movement

SEED = 20260101
RANDOM_STARTS = 20
"""Random initial states, each once driven and once released."""

RANDOM_PUSHES = 12
"""Random pushes of a mechanism with coupled coordinates."""

LINKS_DRAWN, LINKS_PUSHED = 2, 12
"""Runs in a chain; the second half of a pushed chain is released."""

RUN_PERIODS = 1 / 20
"""Length of a run, in periods of the fastest rate."""

ROUNDING_UNCERTAINTY = 1e-9
"""Relative uncertainty at which rounding may limit runs."""

RUN_DIVISORS = (1.0, 2.0, 4.0, 16.0)
"""Divisors of the run length, tried until the limits are resolved."""

RUN_EXTENSION = 3.0
"""Factor by which runs are lengthened if only rounding limits them."""

SOURCE_SHARE = 0.4
"""Share of the resolution available to a run of the source."""


@dataclass(frozen=True, kw_only=True)
class SourceTask:
    """Input of a worker that records states.

    Attributes:
        given: initial states by coordinate (`x`, `x_dot`).
        home: initial positions, (nz,).
        sampling_range: sampling range of positions, (nz, 2).
        taut: further initial positions, (P, nz).
    """

    candidate: Candidate
    match: Match
    given: tuple[Mapping[str, float], ...]
    resolution: float
    home: Array
    sampling_range: Array
    taut: Array


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """Runs of the source, and their end states.

    Attributes:
        runs: K runs, in the source's coordinates.
        end, uncertainty: in the coordinates of the comparison, (K, 2m).
        scale: how far each component moves at most, (2m,).
        driven: whether a force acts, (K,).
        lost: number of runs left out because the source's motion is not smooth there.
        fastest, typical: fastest and typical rate of its motions, rad/s.
        unit: size of its motions, in the coordinates of the comparison, (m,).
        independent: indices of the coordinates that determine the others.
        order, order_confirmed: observed convergence order, and whether it is the claimed one.
    """

    runs: Runs
    end: Array
    uncertainty: Array
    scale: Array
    driven: NDArray[np.bool_]
    lost: int
    fastest: float
    typical: float
    unit: Array
    independent: tuple[int, ...]
    order: float
    order_confirmed: bool


def record(task: SourceTask) -> Recorded:
    """Run the source from its own states.

    Raises:
        EngineError, BlownUpError: for a failing run.
        CompareError: for unmatched joints of the source that move independently.
    """
    model = task.candidate.load()
    rng = np.random.default_rng(SEED)
    home, scales = _scales(task, model, rng)
    names = tuple(model.coordinates)
    z, w, driven, links = _starts(task, home, scales, names, rng)
    reduced = task.match.slopes(home[None])[0]
    compared = reduced @ scales.inverse @ reduced.T
    independent = _independent(compared)
    unit = np.abs(reduced) @ scales.unit
    push = np.zeros((len(z), len(unit)))
    picked = np.ix_(independent, independent)
    mass = np.linalg.inv(compared[picked])
    wanted = rng.uniform(-1, 1, (len(z), len(independent))) * unit[list(independent)]
    push[:, independent] = (wanted * scales.typical**2) @ mass
    push[np.logical_not(driven)] = 0.0
    chain = _chain(model, task, scales, Runs(length=0.0, z=z, w=w, push=push), links)
    recorded = _build_record(task, chain, scales, unit, independent)
    _check_left_out(task, model, scales, recorded, names)
    return recorded


def _scales(
    task: SourceTask, model: Model, rng: np.random.Generator
) -> tuple[Array, CharacteristicScales]:
    """Return a position, and the characteristic scales of the model there.

    With coupled coordinates this is the position in which the file draws the mechanism: elsewhere
    the couplings may be violated.

    Raises:
        CompareError: if no force moves a joint.
    """
    try:
        scales = characteristic_scales(model, rng, task.home, task.sampling_range)
        drawn = model.home
        if scales.tangent.shape[1] == len(drawn) or np.array_equal(drawn, task.home):
            return task.home, scales
        return drawn, characteristic_scales(model, rng, drawn, task.sampling_range)
    except CompareError as error:
        raise CompareError(f"{task.candidate.name}: {error}") from None


def _starts(
    task: SourceTask,
    start: Array,
    scales: CharacteristicScales,
    names: tuple[str, ...],
    rng: np.random.Generator,
) -> tuple[Array, Array, Array, int]:
    """Return initial states (B, nz), whether each is driven (B,), and the runs per chain."""
    extent, n = task.sampling_range, len(names)
    given = [_initial_state(start, names, state) for state in task.given]
    still = np.zeros(n)
    if scales.tangent.shape[1] == n:
        middle, half = extent.mean(axis=1), 0.8 * scales.unit
        drawn = middle + half * rng.uniform(-1, 1, (RANDOM_STARTS, n))
        going = 0.5 * scales.unit * scales.typical * rng.uniform(-1, 1, (RANDOM_STARTS, n))
        taut = [(position, still) for position in task.taut]
        pairs = [*given, (start, still), *taut, *zip(drawn, going, strict=True)]
        starts = [pair for pair in pairs for _ in range(2)]
        driven = np.tile([False, True], len(pairs))
        links = LINKS_DRAWN
    else:
        starts = [*given, *[(start, still)] * (RANDOM_PUSHES + 1)]
        driven = np.array([False] * (len(given) + 1) + [True] * RANDOM_PUSHES)
        links = LINKS_PUSHED
    z, w = (np.array([s[i] for s in starts], dtype=float) for i in range(2))
    return z, w, driven, links


def _initial_state(
    start: Array, names: tuple[str, ...], state: Mapping[str, float]
) -> tuple[Array, Array]:
    z, w = start.copy(), np.zeros(len(start))
    for name, value in state.items():
        if name in names:
            z[names.index(name)] = value
        elif name.endswith("_dot") and name[:-4] in names:
            w[names.index(name[:-4])] = value
        else:
            raise CompareError(
                f"--start: {name!r} is not a joint, or a joint's velocity, of the model; its"
                f" joints are {', '.join(names)}"
            )
    return z, w


def _independent(inverse: Array) -> tuple[int, ...]:
    """Return coordinates that determine the others: pivoted Cholesky of the scaled matrix."""
    size = np.sqrt(np.maximum(np.diagonal(inverse), 0.0))
    safe = np.where(size > 0, size, 1.0)
    rest = inverse / np.outer(safe, safe)
    chosen: list[int] = []
    for _ in range(len(rest)):
        # Take the first of about equally free coordinates.
        free = np.diagonal(rest)
        pivot = int(np.argmax(free > 0.5 * np.max(free)))
        if not free[pivot] > 10 * MIN_RESPONSE:
            break
        chosen.append(pivot)
        column = rest[:, pivot].copy()
        rest = rest - np.outer(column, column) / column[pivot]
    return tuple(sorted(chosen))


def _chain(
    model: Model, task: SourceTask, scales: CharacteristicScales, first: Runs, links: int
) -> list[tuple[Runs, Limit]]:
    """Return chains of runs, as long as the fastest rate allows."""
    best: tuple[float, list[tuple[Runs, Limit]]] | None = None
    for shorter in RUN_DIVISORS:
        length = 2 * np.pi / scales.fastest * RUN_PERIODS / shorter
        chain = _links(model, task, scales, replace(first, length=length), links)
        worst = _ninetieth_percentile(chain, lambda limit: limit.uncertainty)
        # Rounding dominates where half the length or less does not halve the uncertainty.
        before = np.inf if best is None else best[0]
        if best is None or worst < before:
            best = worst, chain
        if worst <= 0.05 * task.resolution or (
            worst > before / 2 and before <= ROUNDING_UNCERTAINTY
        ):
            break
    assert best is not None
    worst, chain = best
    if (
        worst > SOURCE_SHARE * task.resolution
        and 2 * _ninetieth_percentile(chain, lambda limit: limit.rounding) > worst
    ):
        # Over a longer run a position moves further, while its rounding error stays the same.
        length = chain[0][0].length * RUN_EXTENSION
        longer = _links(model, task, scales, replace(first, length=length), links)
        if _ninetieth_percentile(longer, lambda limit: limit.uncertainty) < worst:
            return longer
    return chain


def _ninetieth_percentile(
    chain: Sequence[tuple[Runs, Limit]], quantity: Callable[[Limit], Array]
) -> float:
    """Return the 90th percentile over runs, relative to how far components move."""
    sizes = [np.max(_relative(runs, limit, quantity(limit)), axis=1) for runs, limit in chain]
    ordered = np.sort(np.concatenate(sizes))
    return float(ordered[int(0.9 * (len(ordered) - 1))])


def _links(
    model: Model, task: SourceTask, scales: CharacteristicScales, runs: Runs, links: int
) -> list[tuple[Runs, Limit]]:
    chain: list[tuple[Runs, Limit]] = []
    for link in range(links):
        if chain:
            runs, limit = chain[-1]
            n = runs.z.shape[1]
            lost = np.max(limit.uncertainty, axis=1, keepdims=True) == np.inf
            state = np.where(lost, np.hstack([runs.z, runs.w]), limit.value)
            released = links > LINKS_DRAWN and link >= links // 2
            push = np.zeros_like(runs.push) if released else runs.push
            runs = Runs(length=runs.length, z=state[:, :n], w=state[:, n:], push=push)
        chain.append((runs, ends(model, runs, task.match, task.resolution).limit))
    return chain


def _relative(runs: Runs, limit: Limit, error: Array) -> Array:
    starts = np.hstack([runs.z, runs.w])
    finite = np.flatnonzero(np.max(limit.uncertainty, axis=1) < np.inf)
    scale = movement(limit.value[finite], starts[finite])
    relative: Array = error / scale
    return relative


def _build_record(
    task: SourceTask,
    chain: list[tuple[Runs, Limit]],
    scales: CharacteristicScales,
    unit: Array,
    independent: tuple[int, ...],
) -> Recorded:
    match, m = task.match, len(task.match.names)
    z, w, push = (
        np.concatenate([getattr(runs, key) for runs, _ in chain]) for key in ("z", "w", "push")
    )
    value = np.concatenate([limit.value for _, limit in chain])
    error = np.concatenate([limit.uncertainty for _, limit in chain])
    n = z.shape[1]
    end = np.hstack(match.over(value[:, :n], value[:, n:]))
    start = np.hstack(match.over(z, w))
    wrapped = unwrapped(end, start, match.periodic)
    uncertainty = match.errors(value[:, :n], value[:, n:], error)
    relative = uncertainty / movement(wrapped, start)
    kept = _kept(np.max(relative, axis=1), task.resolution)
    scale = movement(wrapped[kept], start[kept]) if len(kept) else np.ones(2 * m)
    limit = chain[0][1]
    return Recorded(
        runs=Runs(length=chain[0][0].length, z=z[kept], w=w[kept], push=push[kept]),
        end=wrapped[kept],
        uncertainty=uncertainty[kept],
        scale=scale,
        driven=np.not_equal(push[kept], 0.0).any(axis=1),
        lost=len(z) - len(kept),
        fastest=scales.fastest,
        typical=scales.typical,
        unit=unit,
        independent=independent,
        order=limit.order,
        order_confirmed=limit.order_confirmed,
    )


def _kept(uncertainty: Array, resolution: float) -> NDArray[np.intp]:
    """Return which runs of K are resolved, given relative uncertainties (K,).

    The target adds about the same uncertainty. Where most runs leave room for it, return only
    those.
    """
    (clear,) = np.nonzero(uncertainty <= SOURCE_SHARE * resolution)
    if 2 * len(clear) >= len(uncertainty):
        return clear
    return np.flatnonzero(uncertainty <= resolution)


def unwrapped(end: Array, near: Array, periodic: tuple[bool, ...]) -> Array:
    """Shift angles known modulo 2 pi close to another state."""
    end = end.copy()
    for i, turns in enumerate(periodic):
        if turns:
            end[:, i] += 2 * np.pi * np.round((near[:, i] - end[:, i]) / (2 * np.pi))
    return end


def _check_left_out(
    task: SourceTask,
    model: Model,
    scales: CharacteristicScales,
    recorded: Recorded,
    names: tuple[str, ...],
) -> None:
    """Reject unmatched joints of the source, unless they follow from others or stay at rest."""
    match = task.match
    if not match.left_out or not len(recorded.runs.z):
        return
    if scales.tangent.shape[1] == len(recorded.independent):
        return
    places = [names.index(name) for name in match.left_out]
    moved = np.abs(recorded.runs.z[:, places] - model.home[places]).max(axis=0)
    free = [
        name
        for name, by, i in zip(match.left_out, moved, places, strict=True)
        if by > 1e-9 * scales.unit[i]
    ]
    if not free:
        return
    other = "B" if match.source == "A" else "A"
    raise CompareError(
        f"joint {', '.join(free)} of {match.source} moves on its own and has no match in {other},"
        f" whose joints are {', '.join(match.names)}; lock it, or add it to {other}"
    )
