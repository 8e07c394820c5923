"""Initial states of the source: sampled with the equations of its file, as `run` samples them.

A model whose file is not a tree of bodies is pushed from the position in which the file draws it.
Its coordinates may be coupled (a rolling wheel, the bodies of a Space), so that only motions lead
to other states. The scales of its motions are measured.

Positions are within the limits of both files, and where tendon springs with play pull.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, LoadedModel
from physics_crosscheck.harness.numerics.accelerations import Accelerations
from physics_crosscheck.harness.numerics.coordinates import identity
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.reference.mechanism.chart import coordinate_names
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.collocation import ReferenceError
from physics_crosscheck.reference.solving.samples import rate_of, samples, within
from physics_crosscheck.reference.solving.segments import Segments
from .candidate import CompareError, Facts
from .match import Match, pairs_of
from .segments import quick
from .side import FileEquations

SEED = 20260101
SAMPLED = 40
"""Sampled states, each under forces of its own."""

PUSHES, LINKS = 12, 12
"""Chains of runs of a pushed mechanism, and runs in each; the second half of a chain is free."""

PERIODS = 1 / 30
"""Length of a run, in periods of the fastest rate."""

MIN_RESPONSE = 1e-6
"""Share of the largest response to a force below which a direction counts as locked."""

MIN_TYPICAL_RATE = 0.02
"""Minimum typical rate, relative to the fastest.

Positions then move by 4e-3 of their size over a run, known to 5e-11 of that.
"""

MAX_ACCELERATION = 4e9
"""Limit in rad/s^2 or m/s^2: an engine takes 1e10 for a run that has blown up."""

TAUT_SHARE = 0.5
"""Share of the way from an end of the play to the end of the joints' range."""

MAX_ROTATION = 2.0
"""Rotation coordinates, 4 tan(angle / 4), above which a body is turned back: 106 degrees."""

END_MARGIN = 1e-3
"""Share of a range between an initial state and its ends, where a stop may act already."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StartRange:
    """Positions from which runs of the source start.

    Attributes:
        home: that of its file, or the middle of the joints' range, (nz,).
        limits: of both files, (nz, 2), infinite without a limit.
        taut: further positions, at which springs of either file pull, (P, nz).
        strangers: joints whose ranges in both files do not overlap.
    """

    home: Array
    limits: Array
    taut: Array
    strangers: tuple[str, ...]


def start_range(source: Facts, target: Facts, match: Match) -> StartRange:
    """Return the positions within the limits of both files."""
    limits, strangers = source.limits.copy(), []
    lines = _lines(match, source, target)
    for i, j, slope, offset in lines:
        other = np.sort((target.limits[j] - offset) / slope)
        both = np.array([max(limits[i, 0], other[0]), min(limits[i, 1], other[1])])
        if both[0] < both[1]:
            limits[i] = both
        else:
            strangers.append(source.coordinates[i])
    home = _upright(source)
    sampled = within(limits, home)
    low, high = sampled.T + END_MARGIN * np.outer([1, -1], np.ptp(sampled, axis=1))
    home = np.where((low <= home) & (home <= high), home, sampled.mean(axis=1))
    unlimited: NDArray[np.bool_] = np.logical_and.reduce(np.isinf(limits), axis=1)
    taut = [
        start
        for spring in (*_springs(source), *_springs_of_target(target, lines, len(home)))
        for direction in (-1.0, 1.0)
        for start in _taut(spring, direction, home, sampled, unlimited)
    ]
    different = np.unique(np.array(taut).reshape(len(taut), len(home)), axis=0)
    return StartRange(home=home, limits=limits, taut=different, strangers=tuple(strangers))


def _upright(source: Facts) -> Array:
    """Return the positions of the file, (nz,), without large rotations of bodies.

    Half a turn is the edge of the chart. There a torque about an axis moves another coordinate
    than its own, so that the body would seem to be locked.
    """
    home, tree = source.home.copy(), source.tree
    turning = [link for link in tree.links if link.kind in ("free", "ball")] if tree else []
    for link in turning:
        names = [name for name, unit in coordinate_names(link.kind, link.name) if unit == "rad"]
        places = [source.coordinates.index(name) for name in names]
        if np.linalg.norm(home[places]) > MAX_ROTATION:
            home[places] = 0.0
    return home


@dataclass(frozen=True, kw_only=True, eq=False)
class _Spring:
    """A length slope @ z + offset of the source's positions z, and its range of play."""

    slope: Array
    offset: float
    rest: tuple[float, float]


def _springs(model: Facts) -> Iterator[_Spring]:
    """Yield springs with play along joints of one model, in its own positions."""
    tree = model.tree
    if tree is None or tree.couplings:
        return
    for force in tree.pulls:
        if not (any(force.stiffness) and force.joints and force.rest[0] < force.rest[1]):
            continue
        slope = np.zeros(len(model.coordinates))
        for joint, share in force.joints:
            slope[model.coordinates.index(tree.links[joint].name)] += share
        yield _Spring(slope=slope, offset=0.0, rest=force.rest)


def _springs_of_target(target: Facts, lines: Sequence[_Line], size: int) -> Iterator[_Spring]:
    """Yield the target's springs in the source's positions."""
    for spring in _springs(target):
        slope = np.zeros(size)
        for i, j, by, _ in lines:
            slope[i] += spring.slope[j] * by
        offset = sum(float(spring.slope[j]) * shift for _, j, _, shift in lines)
        yield _Spring(slope=slope, offset=offset, rest=spring.rest)


def _taut(
    spring: _Spring, direction: float, home: Array, sampled: Array, unlimited: NDArray[np.bool_]
) -> Iterator[Array]:
    """Yield a position beyond one end of the play, if the joints' range permits it."""
    slope = direction * spring.slope
    end = max(direction * spring.rest[0], direction * spring.rest[1])
    now = float(slope @ home) + direction * spring.offset
    corner = np.where(slope > 0, sampled[:, 1], sampled[:, 0])
    way, free = np.where(slope != 0, corner - home, 0.0), np.logical_and(slope != 0, unlimited)
    if free.any():  # joints without limits move as far as necessary
        way = np.where(free, way, 0.0)
    size = float(slope @ way)
    furthest = max(end, now) + size if free.any() else now + size
    if size > 0 and furthest > end:
        far = end + TAUT_SHARE * (furthest - end)
        yield home + way * (far - now) / size


def range_notes(strangers: Sequence[str], label: str) -> tuple[str, ...]:
    """Return a note about joints whose ranges do not overlap."""
    if not strangers:
        return ()
    return (
        f"the ranges of {', '.join(strangers)} have nothing in common: runs start within those"
        f" of {label}",
    )


_Line = tuple[int, int, float, float]
"""(i, j, slope, offset): the target's position j is on that line over the source's position i."""


def _lines(match: Match, source: Facts, target: Facts) -> tuple[_Line, ...]:
    pairs, names = pairs_of(match, source.coordinates), (source.coordinates, target.coordinates)
    if match.source == "A":
        rows = [(pair.a, pair.b, pair.slope, pair.offset) for pair in pairs]
    else:
        rows = [(p.b, p.a, 1 / p.slope, -p.offset / p.slope) for p in pairs]
    return tuple((names[0].index(i), names[1].index(j), by, shift) for i, j, by, shift in rows)


@dataclass(frozen=True, kw_only=True)
class SampledStates:
    """Initial states of runs, and the scales of their motions.

    Attributes:
        runs: in the source's coordinates.
        fastest: fastest rate of the motions, rad/s.
        unit: size of the motions in the coordinates of the comparison, (m,).
        typical: rate of motions of that size, rad/s.
        independent: indices of the compared coordinates that determine the others.
    """

    runs: Segments
    fastest: float
    unit: Array
    typical: float
    independent: tuple[int, ...]


def sampled_states(
    source: Facts, match: Match, start: StartRange, given: Sequence[Mapping[str, float]]
) -> SampledStates:
    """Sample states of the source.

    Args:
        source: the model.
        match: of its coordinates.
        start: its initial positions; each further position is a run from rest.
        given: initial states by coordinate (`x`, `x_dot`).

    Raises:
        EngineError, BlownUpError: for a failing run.
        CompareError: for unmatched joints of the source that move independently.
    """
    states = [_initial_state(source.coordinates, start.home, one) for one in given]
    tree = source.sampled_tree
    if tree is not None:
        try:
            return _of_equations(source, tree, match, start, states)
        except ReferenceError:
            pass  # the equations have no accelerations; the engine may have some
    return _pushed(source, match, states)


def _of_equations(
    source: Facts, tree: Tree, match: Match, start: StartRange, given: list[Array]
) -> SampledStates:
    """Sample states and forces with the equations of a tree.

    Raises:
        ReferenceError: if the equations have no accelerations.
    """
    names, file = source.coordinates, FileEquations(tree, source.coordinates)
    kept, n = file.kept, len(names)
    drawn = samples(file.equations, start.limits[kept], start.home[kept], SAMPLED, SEED)
    (z, w), forces = file.expanded(drawn.start), np.zeros((len(drawn.start), n))
    gain, typical = _gain(z[:, kept], w[:, kept], drawn.fastest)
    forces[:, kept] = gain * drawn.start_inputs
    slopes = match.slopes(z)
    push = np.einsum("kz,kzm->km", forces, np.linalg.pinv(slopes))
    still = [np.concatenate([one, 0 * one]) for one in (start.home, *start.taut)]
    runs = Segments.unsolved(np.hstack([z, gain * w]), drawn.length, push)
    runs = _with_starts(runs, np.array([*still, *given]))
    states = file.reduced(runs.start)[::-1]
    fastest = max(drawn.fastest, rate_of(file.equations, states, 0 * states[:, : len(kept)]))
    mass = file.equations.inertia(drawn.start[:1, : len(kept)])[0]
    compared = slopes[0] @ file.matrix
    independent = _independent(compared @ np.linalg.inv(mass) @ compared.T)
    if len(independent) < len(kept):
        _refuse_left_out(match, [one for one in match.left_out if names.index(one) in kept])
    return SampledStates(
        runs=replace(runs, lengths=np.minimum(runs.lengths, 2 * np.pi / fastest * PERIODS)),
        fastest=fastest,
        unit=np.abs(slopes[0]) @ np.ptp(z, axis=0) / 2,
        typical=typical,
        independent=independent,
    )


def _gain(z: Array, w: Array, fastest: float) -> tuple[float, float]:
    """Return a factor of velocities w at positions z, and the typical rate then, rad/s.

    It is above 1 under quick servos.
    """
    extent = np.ptp(z, axis=0) / 2
    typical = float(np.median(np.max(np.abs(w), axis=0) / np.where(extent > 0, extent, 1.0)))
    wanted = min(MIN_TYPICAL_RATE * fastest, MAX_ACCELERATION / (fastest * float(extent.max())))
    gain = max(1.0, wanted / typical) if typical > 0 else 1.0
    return gain, gain * typical


def _with_starts(runs: Segments, starts: Array) -> Segments:
    """Return runs with more starts (P, 2nz), each once free and once under forces of a run."""
    more = np.repeat(starts, 2, axis=0)
    forces = runs.start_inputs[np.arange(len(more)) // 2] * (np.arange(len(more)) % 2)[:, None]
    return Segments.unsolved(
        np.vstack([runs.start, more]), runs.length, np.vstack([runs.start_inputs, forces])
    )


def _initial_state(names: Sequence[str], home: Array, state: Mapping[str, float]) -> Array:
    z, w = home.copy(), np.zeros(len(home))
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
    return np.concatenate([z, w])


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


def _refuse_left_out(match: Match, free: list[str]) -> None:
    source = match.source
    other = "B" if source == "A" else "A"
    if free:
        raise CompareError(
            f"joint {', '.join(free)} of {source} moves on its own and has no match in {other},"
            f" whose joints are {', '.join(match.names)}; lock it, or add it to {other}"
        )


def _pushed(source: Facts, match: Match, given: list[Array]) -> SampledStates:
    """Push a model from the position in which its file draws it, and release it.

    Raises:
        CompareError: if no force moves a joint.
    """
    model, rng = source.candidate.load(), np.random.default_rng(SEED)
    extent, drawn = model.sampling_range, model.home
    unit = (extent[:, 1] - extent[:, 0]) / 2
    inverse, rank, fastest, typical = _scales(source.candidate.name, model, rng)
    slopes = match.slopes(drawn[None])[0]
    compared = slopes @ inverse @ slopes.T
    independent, size = _independent(compared), np.abs(slopes) @ unit
    chosen = list(independent)
    wanted = rng.uniform(-1, 1, (PUSHES, len(chosen))) * size[chosen]
    push = np.zeros((PUSHES + 1 + len(given), len(size)))
    push[:PUSHES, chosen] = wanted * typical**2 @ np.linalg.inv(compared[np.ix_(chosen, chosen)])
    starts = np.array([*[np.concatenate([drawn, 0 * drawn])] * (PUSHES + 1), *given])
    first = Segments.unsolved(starts, 2 * np.pi / fastest * PERIODS, push)
    runs = _chained(model, first, match)
    if rank > len(independent):
        away = np.abs(runs.start[:, : len(drawn)] - drawn).max(axis=0) > 1e-9 * unit
        free = [one for one in match.left_out if away[source.coordinates.index(one)]]
        _refuse_left_out(match, free)
    return SampledStates(
        runs=runs, fastest=fastest, unit=size, typical=typical, independent=independent
    )


def _chained(model: LoadedModel, first: Segments, match: Match) -> Segments:
    links = [first]
    while len(links) < LINKS:
        last = links[-1]
        push = last.start_inputs * (len(links) < LINKS // 2)
        try:
            end = quick(model, last, match)
        except BlownUpError:
            break
        links.append(Segments.unsolved(end, last.length, push))
    start, push = (
        np.concatenate([getattr(one, name) for one in links]) for name in ("start", "start_inputs")
    )
    return Segments.unsolved(start, first.length, push)


def _scales(
    name: str, model: LoadedModel, rng: np.random.Generator
) -> tuple[Array, int, float, float]:
    """Measure a model in the position in which its file draws it.

    Returns:
        The inverse of its mass matrix, (nz, nz); the number of directions in which it moves; the
        fastest and the typical rate of its motions, rad/s.

    Raises:
        CompareError: if no force moves a joint.
    """
    start, n, plain = model.home, len(model.coordinates), 2 * np.pi / (1000 * model.step)
    unit = (model.sampling_range[:, 1] - model.sampling_range[:, 0]) / 2
    # In motion: static friction would lock it at rest.
    here = np.concatenate([start, 0.1 * unit * plain * rng.uniform(0.5, 1.0, n)])[None]
    measured = Accelerations(
        model=model, coordinates=identity(n), speed=unit * plain, fastest=plain
    )
    ease = np.diagonal(measured.inverse_mass(here, np.ones(n))[0])
    if not np.isfinite(ease).all() or not (ease > 0).any():
        raise CompareError(f"{name}: forces on the joints move nothing, or nothing finite")
    sizes = unit * plain**2 / np.where(ease > 0, ease, np.max(ease))
    inverse = measured.inverse_mass(here, sizes)[0]
    tangent = free_directions(inverse)
    tangent /= np.max(np.abs(tangent) / unit[:, None], axis=0)
    rates = _rates(measured, start, tangent, plain)
    fastest = max(float(np.max(rates)), plain)
    moving = rates[rates > 1e-3 * fastest]
    # Slower components would reverse within a run, where drag has a kink.
    rest = measured.measure(np.hstack([start, 0 * start])[None], np.zeros((1, 0)), 0 * start[None])
    falling = float(np.sqrt(np.max(np.nan_to_num(np.abs(rest.value[0])) / unit)))
    typical = max(float(np.median(moving)) if len(moving) else plain, plain / 3, falling)
    return inverse, tangent.shape[1], fastest, max(typical, MIN_TYPICAL_RATE * fastest)


def free_directions(inverse: Array) -> Array:
    """Return columns (nz, r): velocities possible with this inverse mass matrix."""
    size = np.sqrt(np.maximum(np.diagonal(inverse), 0.0))
    safe = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh((inverse + inverse.T) / 2 / np.outer(safe, safe))
    kept: Array = vectors[:, values > MIN_RESPONSE * max(float(values[-1]), 1e-300)]
    return kept * safe[:, None]


def _rates(measured: Accelerations, start: Array, tangent: Array, plain: float) -> Array:
    """Return magnitudes of the eigenvalues of the linearization along the free directions."""
    r, step = tangent.shape[1], 1e-3
    moves = np.concatenate([tangent.T, -tangent.T]) * step
    going = np.tile(0.1 * plain * tangent.sum(axis=1), (len(moves), 1))
    states = np.concatenate(
        [np.hstack([start + moves, going]), np.hstack([start + 0 * moves, going + moves * plain])]
    )
    zero = np.zeros((len(states), len(start)))
    values = measured.measure(states, zero[:, :0], zero).value.reshape(2, 2, r, len(start))
    if not np.isfinite(values).all():
        return np.array([plain])
    slopes = (values[:, 0] - values[:, 1]) / (2 * step)
    back = np.linalg.pinv(tangent)
    stiffness, damping = (back @ slopes[0].T), (back @ slopes[1].T) / plain
    matrix = np.block([[np.zeros((r, r)), np.eye(r)], [stiffness, damping]])
    return np.abs(np.linalg.eigvals(matrix))
