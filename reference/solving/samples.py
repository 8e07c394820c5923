"""Sampled states of a tree, and their short segments of motion.

A robot has more joints than one motion can excite, but its equations hold at every state. Segments
start anywhere within the joint limits, each under its own constant forces. The most informative of
many random states are used (`reference.solving.excitation`).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .collocation import Field, ReferenceError, collocate, stiff_ends
from .integrate import by_runge_kutta
from .segments import Segments

SEGMENTS_A_PERIOD = 30
"""Segments per period of the fastest motion at any state; an engine's step error falls with the
seventh power of it."""

SAMPLING_RANGE = 1.0
"""Sampling range of unlimited positions around home, rad or m."""

MAX_LIMIT_DISTANCE = np.pi
"""Limits farther from home than this are ignored, rad or m."""

COUPLED_A_PERIOD = 20
"""Segments per period if joints are coupled; shorter segments would increase rounding there."""

MAX_CANDIDATES, CANDIDATE_ROWS, MIN_CANDIDATE_RATIO = 400, 6000, 2
"""Number of sampled states: `MAX_CANDIDATES`, or fewer, such that they have about `CANDIDATE_ROWS`
accelerations; at least `MIN_CANDIDATE_RATIO` times the selected states."""

RATE_STATES = 24
"""Largest number of states at which rates are computed, each by 4 n accelerations."""

DEFAULT_RATE = 1.0
"""Rate of motions if nothing oscillates, rad/s."""

MAX_SAMPLED_RATE = 20.0
"""Largest rate of sampled motions, rad/s; stiff servos settle faster than robots move."""

MAX_RATE = 1e9
"""Rate above which positions move by rounding only while a joint settles, rad/s."""

LOCKED_RATE, STIFF_RATE = 1e8, 2e8
"""Rates above which a joint's own dampers, or its spring, lock it, rad/s."""

MIN_EIGENVALUE = 1e-13
"""Threshold of eigenvalues of a mass matrix with unit diagonal; smaller ones are rounding."""

MAX_SINGULAR_SHARE = 0.1
"""Share of singular mass matrices from which the joints, not the positions, are the reason."""

MIN_SHARE = 0.1
"""Share of the largest part in a motion without inertia from which a joint is named."""

MAX_DIFFERENCE = 1e-9
"""Largest difference of the two solutions, relative to the largest component of its kind. Smaller
differences enter the bound."""

MAX_AMPLIFICATION = 2.0
"""Factor by which the equations may amplify an error within a segment; e^(2 pi / 20) is 1.37."""


def samples(
    equations: TreeEquations, limits: Array, home: Array, count: int, seed: int
) -> Segments:
    """Sample states and forces, select the most informative, and solve.

    Args:
        limits: limits of the positions, (n, 2), infinite if unlimited.
        home: center of the sampling range of unlimited positions, (n,).
        count: number of selected states.
        seed: seed of the random numbers.

    Raises:
        LockedError: if dampers or springs lock joints.
        ReferenceError: if the mass matrix is singular, or the two solutions differ.
    """
    pool = candidates(equations, limits, home, count, seed)
    _check_locks(equations, pool.settling)
    chosen = select_d_optimal(pool.rows(equations), count)
    q, v = pool.q[chosen], pool.v[chosen]
    forces = equations.forces_for(q, v, pool.a[chosen])
    start = np.concatenate([q, v], axis=1)
    spinning = float(np.max(np.abs(v[:, equations.turning]), initial=0.0))
    fastest = max(pool.swing, _rates(equations, start, forces)[0], pool.rate, spinning)
    if fastest > STIFF_RATE:
        slopes = equations.pushed_slopes(start[:RATE_STATES], forces[:RATE_STATES])
        swinging = np.sqrt(np.max(np.abs(np.einsum("kii->ki", slopes[:, :, : len(home)])), axis=0))
        _check_springs(equations, home, swinging)
    if fastest > MAX_RATE:
        rates = np.maximum(pool.settling, swinging)
        joint = equations.system.coordinates[int(np.argmax(rates))].name
        raise ReferenceError(
            f"its fastest motion takes {1 / fastest:.0e} s, too short to move any "
            f"position by more than rounding; joint {joint!r} is the fastest; check the inertia "
            "that it moves"
        )
    length = min(_length(equations, fastest), pool.longest)
    return solved(equations, start, forces, length, fastest)


class LockedError(ReferenceError):
    """Joints that their own dampers or springs lock."""

    def __init__(self, message: str, joints: tuple[str, ...]) -> None:
        super().__init__(message)
        self.joints = joints


def locked_joints(equations: TreeEquations, q: Array) -> dict[str, float]:
    """Return joints that their own dampers lock at some positions (K, n), with the damping.

    Raises:
        ReferenceError: if the mass matrix is singular.
    """
    start = np.concatenate([q, 0 * q], axis=1)
    locks = _locks(equations, _rates(equations, start, 0 * q)[1])
    return {name: damper for name, damper, _ in locks}


def _locks(equations: TreeEquations, settling: Array) -> list[tuple[str, float, float]]:
    """Return joints that their own dampers lock: damping and rate, rad/s, of each."""
    damping = {link.name: link.damping for link in equations.system.tree.links}
    names = [coordinate.name for coordinate in equations.system.coordinates]
    return [
        (name, damping[name], rate)
        for name, rate in zip(names, settling, strict=True)
        if rate > LOCKED_RATE and damping.get(name, 0.0) > 0
    ]


def _check_locks(equations: TreeEquations, settling: Array) -> None:
    """Refuse joints that their own dampers lock: engines move them by rounding only."""
    if locked := _locks(equations, settling):
        name, damper, rate = locked[0]
        raise LockedError(
            f"damping {damper:g} stops joint {name!r}, of inertia {damper / rate:.2g}, within "
            f"{1 / rate:.0e} s: lower the damping, or fix the joint",
            tuple(name for name, _, _ in locked),
        )


def _check_springs(equations: TreeEquations, home: Array, swinging: Array) -> None:
    """Refuse joints that their own springs lock at home, by the rates of their swings, rad/s."""
    tree, names = equations.system.tree, [one.name for one in equations.system.coordinates]
    rates = dict(zip(names, swinging, strict=True))
    locked = {
        link.name: link.stiffness
        for link, there in zip(tree.links, tree.velocities, strict=True)
        if link.stiffness > 0 and rates.get(link.name, 0.0) > STIFF_RATE
        and link.rest[0] == home[there.start]
    }  # fmt: skip
    for name, stiffness in locked.items():
        raise LockedError(
            f"stiffness {stiffness:g} moves joint {name!r} within {1 / rates[name]:.0e} s: "
            "lower the stiffness, or fix the joint",
            tuple(locked),
        )


def solved(
    equations: TreeEquations, start: Array, forces: Array, length: float, fastest: float
) -> Segments:
    """Return the segments from given states, solved by two methods.

    Args:
        start: states, (K, 2n), the most informative first.
        forces: constant generalized forces, (K, n).
        length: seconds per segment.
        fastest: fastest rate at any of the states, rad/s.

    Raises:
        ReferenceError: if they can't be solved, or the two solutions differ.
    """
    n = forces.shape[1]
    field, times = _field(equations, forces), np.zeros(len(start))
    names = [c.name for c in equations.system.coordinates]
    names += [f"{name}_dot" for name in names]
    end, _ = collocate(field, times, start, length, names)
    checked = by_runge_kutta(field, times, start, length, rounded=True)
    apart, size = np.max(np.abs(end - checked), axis=0), np.max(np.abs(end), axis=0)
    sizes = np.repeat([size[:n].max(), size[n:].max()], n)
    if not np.all(apart <= MAX_DIFFERENCE * sizes):  # so that nan is rejected as well
        worst = int(np.argmax(apart / sizes))
        raise ReferenceError(
            f"two solutions of {names[worst]} are {apart[worst]:.1e} apart over a segment"
        )
    bound = apart + rounding_of(equations, start, forces, end, length)
    return replace(
        Segments.unsolved(start, length, forces),
        end=end,
        bound=bound,
        fastest=fastest,
        nonsmooth=equations.nonsmooth,
    )


def rounding_of(
    equations: TreeEquations, start: Array, forces: Array, end: Array, length: float
) -> Array:
    """Return the effect of rounding of states and accelerations on the ends, (2n,)."""
    n, size = forces.shape[1], np.max(np.abs(end), axis=0)
    rounded = equations.rounding(start[:, :n], start[:, n:], forces)
    jolt = np.concatenate([rounded * length**2 / 2, rounded * length])
    bound: Array = 2 * np.finfo(float).eps * size + MAX_AMPLIFICATION * jolt
    return bound


def rate_of(equations: TreeEquations, start: Array, forces: Array) -> float:
    """Return the rate of the fastest motion at some states under constant forces, rad/s.

    Raises:
        ReferenceError: if the accelerations are not finite.
    """
    return _rates(equations, start, forces)[0]


class Candidates(NamedTuple):
    """Candidate states: positions, velocities and accelerations, (P, n) each.

    `swing` is the rate of oscillation at rest, `rate` that of the sampled motions, and `settling`
    how fast each joint's own dampers stop it, (n,), all in rad/s. `longest` is the largest length,
    s, of segments on which forces are smooth.
    """

    q: Array
    v: Array
    a: Array
    swing: float
    rate: float
    settling: Array
    longest: float = np.inf

    def rows(self, equations: TreeEquations) -> Array:
        """Return each state's sensitivity to the parameters, (P, n, p), by the accelerations."""
        sensitivity = equations.slopes_by_number(self.q, self.v, self.a)
        sensitivity /= np.max(np.abs(self.a), axis=0)[:, None]
        return sensitivity


def candidates(
    equations: TreeEquations, limits: Array, home: Array, count: int, seed: int
) -> Candidates:
    """Sample random states, from which `count` are to be selected.

    Velocities and accelerations are typical of the mechanism: positions times the rate of
    oscillation at rest, and times its square. The arguments are those of `samples`.
    """
    rng, n = np.random.default_rng(seed), len(home)
    number_drawn = max(min(MAX_CANDIDATES, CANDIDATE_ROWS // n), MIN_CANDIDATE_RATIO * count)
    sampling_range = within(limits, home)
    q = rng.uniform(sampling_range[:, 0], sampling_range[:, 1], (number_drawn, n))
    extent = np.minimum((sampling_range[:, 1] - sampling_range[:, 0]) / 2, SAMPLING_RANGE)
    q = q[_is_regular(equations, q)]
    none = np.zeros_like(q)
    swing, settling = _rates(equations, np.concatenate([q, none], axis=1), none)
    rate = min(max(swing, DEFAULT_RATE), MAX_SAMPLED_RATE)

    def moving(q: Array, rate: float, settling: Array) -> tuple[Array, Array]:
        """Return velocities and accelerations at positions."""
        v = rng.uniform(-1, 1, q.shape) * extent * rate
        # If a damper stops a joint sooner, slower accelerations would leave only rounding.
        return v, rng.uniform(-1, 1, q.shape) * extent * rate * np.maximum(rate, settling)

    v, a = moving(q, rate, settling)
    if not equations.nonsmooth:
        return Candidates(q, v, a, swing, rate, settling)
    # A drag grows with the velocity; if it dominates, slower states are as fast.
    lively = max(swing, MAX_SAMPLED_RATE)
    rate *= min(1.0, lively / _fastest(equations, q, v, a))
    settling = np.maximum(settling, lively)
    v, a = moving(q, rate, settling)
    fastest = max(swing, rate, _fastest(equations, q, v, a))

    def drawn(number: int) -> tuple[Array, Array]:
        positions = rng.uniform(sampling_range[:, 0], sampling_range[:, 1], (number, n))
        velocities, wanted = moving(positions, rate, settling)
        forces = equations.forces_for(positions, velocities, wanted)
        return np.concatenate([positions, velocities], axis=1), forces

    start, forces, longest = smooth_segments(
        equations,
        lambda forces: _field(equations, forces),
        drawn,
        number_drawn,
        _length(equations, fastest),
    )
    q, v = start[:, :n], start[:, n:]
    a = equations.pushed_acceleration(q, v, forces)
    return Candidates(q, v, a, swing, rate, settling, longest)


def _fastest(equations: TreeEquations, q: Array, v: Array, a: Array) -> float:
    """Return the fastest rate at some states with the given accelerations, rad/s."""
    some = slice(RATE_STATES)
    forces = equations.forces_for(q[some], v[some], a[some])
    return _rates(equations, np.concatenate([q[some], v[some]], axis=1), forces)[0]


def _length(equations: TreeEquations, fastest: float) -> float:
    """Return the length of segments, seconds, for the rate of the fastest motion."""
    coupled = bool(equations.system.tree.couplings)
    return 2 * np.pi / fastest / (COUPLED_A_PERIOD if coupled else SEGMENTS_A_PERIOD)


def ends_of(
    equations: TreeEquations, start: Array, forces: Array, length: float, *, stiff: bool = False
) -> Array:
    """Return the ends of states (K, 2n) under constant forces, (K, n), after `length` seconds.

    Args:
        equations: of the tree.
        start: states.
        forces: on its coordinates.
        length: of the segments.
        stiff: whether those of a stiff tree are solved to fewer digits.

    Raises:
        ReferenceError: if they can't be solved.
    """
    field = _field(equations, forces)
    try:
        return collocate(field, np.zeros(len(start)), start, length)[0]
    except ReferenceError:
        if not stiff:
            raise
        return stiff_ends(field, start, length)


def _field(equations: TreeEquations, forces: Array) -> Field:
    """Return dy/dt under constant forces, (K, n)."""
    count, n = forces.shape

    def field(times: Array, states: Array) -> Array:
        pushed = forces.reshape(count, *(1,) * (states.ndim - 2), n)
        a = equations.pushed_acceleration(states[..., :n], states[..., n:], pushed)
        return np.concatenate([states[..., n:], a], axis=-1)

    return field


def within(limits: Array, home: Array) -> Array:
    """Return the sampling range of positions, (n, 2): within limits, and near home.

    Equal limits, such as both zero, are ignored. Some engines treat such a joint as free, others as
    fixed; equations without limits let it move.
    """
    room = limits[:, 1] > limits[:, 0]
    low, high = np.where(room, limits.T, np.array([[-np.inf], [np.inf]]))
    low = np.where(np.isfinite(low), low, np.minimum(home, high) - SAMPLING_RANGE)
    high = np.where(np.isfinite(high), high, np.maximum(home, low) + SAMPLING_RANGE)
    near = np.clip(home, low, high)
    result: Array = np.stack(
        [np.maximum(low, near - MAX_LIMIT_DISTANCE), np.minimum(high, near + MAX_LIMIT_DISTANCE)],
        axis=1,
    )
    return result


def _is_regular(equations: TreeEquations, q: Array) -> NDArray[np.bool_]:
    """Return at which positions every motion of the tree moves some mass.

    A point mass on three joints has some positions without: states far from these are compared.

    Raises:
        ReferenceError: with the joints that move none together at most positions.
    """
    mass = equations.inertia(q)
    diagonal = np.einsum("kii->ki", mass)
    if not np.isfinite(diagonal).all():
        raise ReferenceError("the masses are not finite")
    # Scale by the diagonal, since a light part beside a heavy one is not singular.
    size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(mass / size[:, :, None] / size[:, None, :])
    worst = int(np.argmin(values[:, 0]))
    if np.mean(values[:, 0] <= MIN_EIGENVALUE) > MAX_SINGULAR_SHARE:
        shares = np.abs(vectors[worst, :, 0])
        joints = np.flatnonzero(shares >= MIN_SHARE * shares.max())
        given = [equations.system.coordinates[i].name for i in joints]
        names, links = _moved(equations.system.tree, given)
        who = f"joint {names[0]} moves" if len(names) == 1 else "together, joints "
        who += "" if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]} move"
        raise ReferenceError(
            f"{who} no mass or inertia, or a negative one: the mass "
            "matrix is not positive definite. Check the inertias of the links that they move"
            + (f": {', '.join(links)}" if links else "")
        )
    is_regular: NDArray[np.bool_] = values[:, 0] > MIN_EIGENVALUE
    return is_regular


def _moved(tree: Tree, names: list[str]) -> tuple[list[str], list[str]]:
    """Return joints, with those above that carry no mass themselves, and the links they move."""
    moving = {i for i, link in enumerate(tree.links) if link.name in names}
    for i in reversed(range(len(tree.links))):
        parent = tree.links[i].parent
        if i in moving and parent != WORLD and not tree.links[parent].mass:
            moving.add(parent)
    joints = [link.name for i, link in enumerate(tree.links) if i in moving] or names
    links = [name for name, (i, _) in tree.frames.items() if i in moving and tree.links[i].mass]
    return [repr(name) for name in joints], [repr(name) for name in links]


def _rates(equations: TreeEquations, states: Array, forces: Array) -> tuple[float, Array]:
    """Return the fastest rate of motions at states under constant forces, rad/s.

    It is the largest |eigenvalue| of the equations' Jacobian. The second value is how fast each
    joint's own dampers stop it, (n,).

    Raises:
        ReferenceError: if the accelerations are not finite.
    """
    states, forces, n = states[:RATE_STATES], forces[:RATE_STATES], states.shape[1] // 2
    with np.errstate(all="ignore"):
        matrices = equations.state_matrices(states, forces)
    if not np.isfinite(matrices).all():
        raise ReferenceError("the accelerations are not finite: the mass matrix is singular")
    settling = np.max(np.abs(np.einsum("kii->ki", matrices[:, n:, n:])), axis=0)
    return float(np.max(np.abs(np.linalg.eigvals(matrices)))), settling


MIN_SINGULAR_VALUE = 1e-9
"""Threshold of singular values, relative to the largest, with columns of the slopes normalized.
Smaller ones belong to parameters that no motion can distinguish."""

PRIOR_INFORMATION = 1e-6
"""Initial information in each direction, relative to that of all states. It makes the determinant
nonzero while there are fewer states than parameters."""


def select_d_optimal(rows: Array, count: int) -> list[int]:
    """Select the states that identify the parameters best, the most informative first.

    Args:
        rows: sensitivity of each of K states to p parameters, in units of its uncertainty, (K, m,
            p).
        count: number of states, at most K.
    """
    white = _whitened(rows)
    states, m, r = white.shape
    flat, eye = white.reshape(-1, r), np.eye(m)
    covariance = np.eye(r) / PRIOR_INFORMATION
    shown = eye + white @ np.swapaxes(white, 1, 2) / PRIOR_INFORMATION
    available, chosen = np.ones(states, dtype=bool), list[int]()
    for _ in range(count):
        gain = np.where(available, np.linalg.slogdet(shown)[1], -np.inf)
        best = int(np.argmax(gain))
        available[best] = False
        chosen.append(best)
        # The inverse information decreases by the state's information (Woodbury).
        by = np.linalg.solve(np.linalg.cholesky(shown[best]), white[best] @ covariance)
        covariance = covariance - by.T @ by
        both = (flat @ by.T).reshape(states, m, m)
        shown = shown - both @ np.swapaxes(both, 1, 2)
    return chosen


def _whitened(rows: Array) -> Array:
    """Return the sensitivities in identifiable directions, each of unit length, (K, m, r)."""
    states, m, _ = rows.shape
    flat = rows.reshape(states * m, -1)
    length = np.sqrt((flat * flat).sum(axis=0))
    flat = flat[:, length > 0] / length[length > 0]
    across, triangle = np.linalg.qr(flat)
    turn, sizes, _ = np.linalg.svd(triangle)
    result: Array = across @ turn[:, : len(sizes)][:, sizes > MIN_SINGULAR_VALUE * sizes[0]]
    return result.reshape(states, m, -1)


CANDIDATES_PER_SEGMENT = 4
"""One of so many sampled segments, at least, must cross no kink."""

MAX_HALVINGS = 16
"""Largest number of times that segments are halved to reach `CANDIDATES_PER_SEGMENT`."""

STEPS_PER_SEGMENT = 4
"""Runge-Kutta steps per segment; the sign of each switching function is checked after each."""

ZERO_TOLERANCE = 1e-12
"""A switching function that stays below this, relative to the largest, is zero and has no sign."""

Draw = Callable[[int], tuple[Array, Array]]
"""Sample so many states (K, 2n) and constant forces, (K, n)."""


def smooth_segments(
    equations: TreeEquations,
    field_of: Callable[[Array], Field],
    draw: Draw,
    count: int,
    length: float,
) -> tuple[Array, Array, float]:
    """Return states, forces, and the length of segments that cross no kink.

    Args:
        equations: of the tree.
        field_of: dy/dt under constant forces.
        draw: samples more states and forces.
        count: number of segments.
        length: largest length of segments, seconds.

    Raises:
        ReferenceError: if all segments cross a kink.
    """
    start, forces = draw(CANDIDATES_PER_SEGMENT * count)
    for _ in range(MAX_HALVINGS):
        free = np.flatnonzero(_free(equations, field_of(forces), start, length))
        if len(free) >= count:
            return start[free[:count]], forces[free[:count]], length
        length /= 2
    raise ReferenceError("every segment crosses a kink of the forces, however short it is")


def _free(equations: TreeEquations, field: Field, start: Array, length: float) -> NDArray[np.bool_]:
    """Return the mask of segments that cross no kink, (K,)."""
    n, h = start.shape[1] // 2, length / STEPS_PER_SEGMENT
    times, states = np.zeros(len(start)), [start]
    with np.errstate(all="ignore"):
        for _ in range(STEPS_PER_SEGMENT):
            states.append(_stepped(field, times, states[-1], h))
        values = np.stack([equations.switching_functions(at[:, :n], at[:, n:]) for at in states])
    sizes = np.max(np.abs(values), axis=(0, 1), initial=0.0)
    turned = np.any((values > 0) != (values[0] > 0), axis=0) & (
        sizes > ZERO_TOLERANCE * np.max(sizes, initial=0.0)
    )
    finite = np.isfinite(states[-1]).all(axis=1)
    result: NDArray[np.bool_] = finite & np.logical_not(turned.any(axis=1))
    return result


def _stepped(field: Field, times: Array, states: Array, h: float) -> Array:
    """Take one step of the classical Runge-Kutta method of order 4."""
    k1 = field(times, states)
    k2 = field(times, states + h / 2 * k1)
    k3 = field(times, states + h / 2 * k2)
    k4 = field(times, states + h * k3)
    result: Array = states + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return result
