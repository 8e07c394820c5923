"""States of a tree, and where its equations take them over a short segment.

A robot has more joints than one motion can try; its equations hold at every state. So segments
start anywhere within the limits, each under forces of its own that are held: of many states at
random, those that tell the tree's numbers best apart (`reference.solving.excitation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.collocation import Field, ReferenceError, collocate
from physics_crosscheck.reference.solving.excitation import telling
from physics_crosscheck.reference.solving.integrate import by_runge_kutta
from physics_crosscheck.reference.solving.switching import unbent

SEGMENTS_A_PERIOD = 30
"""Of the fastest motion at any of the states: an engine's steps leave the seventh power of it."""

REACH = 1.0
"""How far positions are drawn from home where there are no limits: rad or m."""

FAR = np.pi
"""Limits further from home than this stand for none: rad or m."""

COUPLED_A_PERIOD = 20
"""The same where joints follow others: there rounding weighs more, which short segments raise."""

DRAWN, ROWS, TIMES = 400, 6000, 2
"""How many states are drawn: so many, or fewer, so that they have about so many accelerations
together; never fewer than so many times those that are taken."""

LOOKED_AT = 24
"""States at which rates are taken, each by 4 n accelerations."""

SLOWEST = 1.0
"""Rate of motions where nothing swings, rad/s."""

LIVELIEST = 20.0
"""Rate of motions that are drawn, at most, rad/s: stiff servos settle faster than robots move."""

QUICKEST = 1e9
"""Rate beyond which no position moves by more than its last digits while a joint settles, rad/s."""

SINGULAR = 1e-13
"""Of a mass matrix with a diagonal of ones: a smaller eigenvalue is rounding."""

APART = 1e-9
"""Of the largest of a component's like: two solutions further apart are no reference. Nearer ones
are in the bound, by what they are apart."""

GROWTH = 2.0
"""By how much the equations may turn up an error within a segment: e^(2 pi / 20) is 1.37."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """K segments of a tree of n coordinates; all in SI units.

    Attributes:
        start: states (q, v), (K, 2n), the most telling first.
        forces: on the coordinates, held, (K, n).
        length: of each, seconds.
        end: where the equations take them, (K, 2n).
        bound: of the error of `end`, per component, (2n,).
        fastest: rate at any of the states, rad/s.
        bent: whether forces bend, as a drag does, which grows with the square of a velocity.
    """

    start: Array
    forces: Array
    length: float
    end: Array
    bound: Array
    fastest: float
    bent: bool = False

    @property
    def t(self) -> Array:
        """Start times, (K,): none, since no motion joins the segments."""
        return np.full(len(self.start), np.nan)

    def ordered(self, order: Sequence[int]) -> Samples:
        """The same with the coordinates in another order."""
        n = len(order)
        both = [*order, *(n + i for i in order)]
        return replace(
            self,
            start=self.start[:, both],
            forces=self.forces[:, list(order)],
            end=self.end[:, both],
            bound=self.bound[both],
        )


def samples(equations: TreeEquations, limits: Array, home: Array, count: int, seed: int) -> Samples:
    """Draw states and forces, take the most telling, and solve.

    Args:
        limits: of the positions, (n, 2), infinite where there are none.
        home: positions about which they are drawn then, (n,).
        count: how many are taken.
        seed: of the draw.

    Raises:
        ReferenceError: where the mass matrix is singular, or the two solutions are apart.
    """
    many = candidates(equations, limits, home, count, seed)
    chosen = telling(many.rows(equations), count)
    q, v = many.q[chosen], many.v[chosen]
    forces = equations.forces_for(q, v, many.a[chosen])
    start = np.concatenate([q, v], axis=1)
    spinning = float(np.max(np.abs(v[:, equations.turning]), initial=0.0))
    fastest = max(many.swing, _rates(equations, start, forces)[0], many.rate, spinning)
    if fastest > QUICKEST:
        joint = equations.system.coordinates[int(np.argmax(many.settling))].name
        raise ReferenceError(
            f"its fastest motion takes {1 / fastest:.0e} s, too short to move any "
            f"position by more than rounding; joint {joint!r} is the fastest: check "
            "the inertia that it moves"
        )
    length = min(_length(equations, fastest), many.longest)
    return solved(equations, start, forces, length, fastest)


def solved(
    equations: TreeEquations, start: Array, forces: Array, length: float, fastest: float
) -> Samples:
    """Where equations take states, by two methods; the fields of `Samples` as arguments.

    Raises:
        ReferenceError: where they can't be solved, or the two are apart.
    """
    n = forces.shape[1]
    field, times = _field(equations, forces), np.zeros(len(start))
    names = [c.name for c in equations.system.coordinates]
    names += [f"{name}_dot" for name in names]
    end, _ = collocate(field, times, start, length, names)
    checked = by_runge_kutta(field, times, start, length, rounded=True)
    apart, size = np.max(np.abs(end - checked), axis=0), np.max(np.abs(end), axis=0)
    sizes = np.repeat([size[:n].max(), size[n:].max()], n)
    if not np.all(apart <= APART * sizes):  # so that nan is refused as well
        worst = int(np.argmax(apart / sizes))
        raise ReferenceError(
            f"two solutions of {names[worst]} are {apart[worst]:.1e} apart over a segment"
        )
    bound = apart + rounding_of(equations, start, forces, end, length)
    return Samples(
        start=start,
        forces=forces,
        length=length,
        end=end,
        bound=bound,
        fastest=fastest,
        bent=equations.bent,
    )


def rounding_of(
    equations: TreeEquations, start: Array, forces: Array, end: Array, length: float
) -> Array:
    """What rounding may do to the ends, per component, (2n,): to states and to accelerations."""
    n, size = forces.shape[1], np.max(np.abs(end), axis=0)
    rounded = equations.rounding(start[:, :n], start[:, n:], forces)
    jolt = np.concatenate([rounded * length**2 / 2, rounded * length])
    found: Array = 2 * np.finfo(float).eps * size + GROWTH * jolt
    return found


def rate_of(equations: TreeEquations, start: Array, forces: Array) -> float:
    """The rate of the fastest motion at some states under forces that are held, rad/s.

    Raises:
        ReferenceError: where the accelerations are not finite.
    """
    return _rates(equations, start, forces)[0]


class Candidates(NamedTuple):
    """States to choose from: positions, velocities and accelerations, (P, n) each.

    And rates, rad/s: at which the mechanism swings at rest, that of the motions drawn, and how fast
    each joint's own dampers stop it, (n,); and how long segments are at most that pass no bend of a
    force, seconds.
    """

    q: Array
    v: Array
    a: Array
    swing: float
    rate: float
    settling: Array
    longest: float = np.inf

    def rows(self, equations: TreeEquations) -> Array:
        """What each says of the tree's numbers, by the largest accelerations, (P, n, p)."""
        found = equations.slopes_by_number(self.q, self.v, self.a)
        found /= np.max(np.abs(self.a), axis=0)[:, None]
        return found


def candidates(
    equations: TreeEquations, limits: Array, home: Array, count: int, seed: int
) -> Candidates:
    """States at random, of which so many are to be chosen.

    Velocities and accelerations are such as motions of the mechanism have: positions times the rate
    at which it swings at rest, and times its square. Arguments as in `samples`.
    """
    rng, n = np.random.default_rng(seed), len(home)
    many = max(min(DRAWN, ROWS // n), TIMES * count)
    reach = within(limits, home)
    q = rng.uniform(reach[:, 0], reach[:, 1], (many, n))
    extent = np.minimum((reach[:, 1] - reach[:, 0]) / 2, REACH)
    none = np.zeros((many, n))
    _check_masses(equations, q)
    swing, settling = _rates(equations, np.concatenate([q, none], axis=1), none)
    rate = min(max(swing, SLOWEST), LIVELIEST)

    def moving(q: Array, rate: float, settling: Array) -> tuple[Array, Array]:
        """Velocities and accelerations there."""
        v = rng.uniform(-1, 1, q.shape) * extent * rate
        # Where a damper stops a joint sooner, holding it against that would leave but rounding.
        return v, rng.uniform(-1, 1, q.shape) * extent * rate * np.maximum(rate, settling)

    v, a = moving(q, rate, settling)
    if not equations.bent:
        return Candidates(q, v, a, swing, rate, settling)
    # A drag grows with the velocity: where it leads, slower is as lively.
    lively = max(swing, LIVELIEST)
    rate *= min(1.0, lively / _fastest(equations, q, v, a))
    settling = np.maximum(settling, lively)
    v, a = moving(q, rate, settling)
    fastest = max(swing, rate, _fastest(equations, q, v, a))

    def drawn(number: int) -> tuple[Array, Array]:
        at = rng.uniform(reach[:, 0], reach[:, 1], (number, n))
        velocities, wanted = moving(at, rate, settling)
        forces = equations.forces_for(at, velocities, wanted)
        return np.concatenate([at, velocities], axis=1), forces

    start, forces, longest = unbent(
        equations,
        lambda forces: _field(equations, forces),
        drawn,
        many,
        _length(equations, fastest),
    )
    q, v = start[:, :n], start[:, n:]
    a = equations.pushed_acceleration(q, v, forces)
    return Candidates(q, v, a, swing, rate, settling, longest)


def _fastest(equations: TreeEquations, q: Array, v: Array, a: Array) -> float:
    """How fast motions are at some states that move so, rad/s."""
    some = slice(LOOKED_AT)
    forces = equations.forces_for(q[some], v[some], a[some])
    return _rates(equations, np.concatenate([q[some], v[some]], axis=1), forces)[0]


def _length(equations: TreeEquations, fastest: float) -> float:
    """Of segments, seconds, by the rate of the fastest motion."""
    coupled = bool(equations.system.tree.couplings)
    return 2 * np.pi / fastest / (COUPLED_A_PERIOD if coupled else SEGMENTS_A_PERIOD)


def ends_of(equations: TreeEquations, start: Array, forces: Array, length: float) -> Array:
    """Where the equations take states (K, 2n) under forces that are held, (K, n), in a while.

    Raises:
        ReferenceError: where they can't be solved.
    """
    end, _ = collocate(_field(equations, forces), np.zeros(len(start)), start, length)
    return end


def _field(equations: TreeEquations, forces: Array) -> Field:
    """Rates of states under forces that are held, (K, n)."""
    count, n = forces.shape

    def field(times: Array, states: Array) -> Array:
        pushed = forces.reshape(count, *(1,) * (states.ndim - 2), n)
        a = equations.pushed_acceleration(states[..., :n], states[..., n:], pushed)
        return np.concatenate([states[..., n:], a], axis=-1)

    return field


def within(limits: Array, home: Array) -> Array:
    """Where positions are drawn, (n, 2): within limits, and about home where these are far away.

    Limits that leave no room, as both of zero, are none: engines read them in two ways, as a joint
    that is free and as one that is held, and equations that leave limits out have it move.
    """
    room = limits[:, 1] > limits[:, 0]
    low, high = np.where(room, limits.T, np.array([[-np.inf], [np.inf]]))
    low = np.where(np.isfinite(low), low, np.minimum(home, high) - REACH)
    high = np.where(np.isfinite(high), high, np.maximum(home, low) + REACH)
    near = np.clip(home, low, high)
    found: Array = np.stack([np.maximum(low, near - FAR), np.minimum(high, near + FAR)], axis=1)
    return found


def _check_masses(equations: TreeEquations, q: Array) -> None:
    """Every joint of the tree must move something that has mass.

    Raises:
        ReferenceError: naming the joint.
    """
    mass = equations.inertia(q)
    own = np.einsum("kii->ki", mass)
    if not np.isfinite(own).all():
        raise ReferenceError("the masses are not finite")
    # In units of its own diagonal, since a light part beside a heavy one is no singular one.
    size = np.sqrt(np.where(own > 0, own, 1.0))
    values, vectors = np.linalg.eigh(mass / size[:, :, None] / size[:, None, :])
    at = int(np.argmin(values[:, 0]))
    if values[at, 0] <= SINGULAR:
        joint = int(np.argmax(np.abs(vectors[at, :, 0])))
        name = equations.system.coordinates[joint].name
        raise ReferenceError(
            f"joint {name!r} moves no mass or inertia, or a negative one: the mass "
            "matrix is not positive definite"
        )


def _rates(equations: TreeEquations, states: Array, forces: Array) -> tuple[float, Array]:
    """How fast motions are at the states, under forces that are held, rad/s.

    Returns the largest |eigenvalue| of the equations' Jacobian, and how fast each joint's own
    dampers stop it, (n,).

    Raises:
        ReferenceError: where the accelerations are not finite.
    """
    states, forces, n = states[:LOOKED_AT], forces[:LOOKED_AT], states.shape[1] // 2
    with np.errstate(all="ignore"):
        lower = equations.pushed_slopes(states, forces)
    if not np.isfinite(lower).all():
        raise ReferenceError("the accelerations are not finite: the mass matrix is singular")
    full = np.zeros((len(states), 2 * n, 2 * n))
    full[:, range(n), range(n, 2 * n)] = 1.0
    full[:, n:] = lower
    own = np.max(np.abs(np.einsum("kii->ki", lower[:, :, n:])), axis=0)
    return float(np.max(np.abs(np.linalg.eigvals(full)))), own
