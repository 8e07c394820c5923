"""The next state by an integrator's rule, of the equations: what an engine's very step must be.

`next_states` takes the rules that engines document, and knows none of the engines. A step starts
from positions q and velocities m, such as an engine keeps; of a rotation these are no rates
(`reference.solving.tree_stepping`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.derive import Equations
from physics_crosscheck.reference.mechanism.declaration import t
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.tree_stepping import SteppedTree

Scheme = Literal["semi-implicit Euler", "Runge-Kutta 4"]


class Stepped(ABC):
    """M(q) dm/dt = f(q, m, u), as integrators ask it; positions and velocities are (B, n)."""

    @abstractmethod
    def velocities(self, q: Array, rate: Array) -> Array:
        """Those that a step keeps, of rates."""

    @abstractmethod
    def rates(self, q: Array, m: Array) -> Array:
        """Of velocities."""

    @abstractmethod
    def mass(self, q: Array) -> Array:
        """M, (B, n, n)."""

    @abstractmethod
    def force(self, q: Array, m: Array, u: Array) -> Array:
        """f under inputs or forces u, (B, n)."""

    @abstractmethod
    def advanced(self, q: Array, m: Array, h: float) -> Array:
        """Positions after m is held for h seconds."""

    @abstractmethod
    def unturned(self, moved: Array, m: Array) -> Array:
        """m as the rate of what `advanced` moves by, after moves (B, n)."""


class SteppedEquations(Stepped):
    """Equations whose velocities are rates, and in which time does not stand; u are inputs."""

    def __init__(self, equations: Equations) -> None:
        self._mass = equations.numeric_mass
        self._force = equations.compile(equations.force)
        self._inputs = len(equations.system.inputs)
        self._still = not set(equations.system.q) & equations.mass.free_symbols
        self._constant: Array | None = None
        """Of a mass in which no coordinate stands: asked for once, of thousands of steps."""

    def velocities(self, q: Array, rate: Array) -> Array:
        """The rates."""
        return rate

    def rates(self, q: Array, m: Array) -> Array:
        """The velocities."""
        return m

    def mass(self, q: Array) -> Array:
        """M, (B, n, n)."""
        if self._constant is not None:
            return np.broadcast_to(self._constant, (len(q), *self._constant.shape))
        n, none = q.shape[1], np.zeros((len(q), self._inputs + 1))
        found = self._mass(q, 0 * q, none[:, 1:], none[:, :1]).reshape(len(q), n, n)
        if self._still and len(q):
            self._constant = found[0]
        return found

    def force(self, q: Array, m: Array, u: Array) -> Array:
        """f, (B, n)."""
        return self._force(q, m, u, np.zeros((len(q), 1)))

    def advanced(self, q: Array, m: Array, h: float) -> Array:
        """q + h m."""
        return q + h * m

    def unturned(self, moved: Array, m: Array) -> Array:
        """m."""
        return m


def stepped_equations(equations: Equations) -> SteppedEquations | None:
    """None where time stands in the equations: no engine's step knows it."""
    timed = any(t in e.free_symbols for e in (*equations.mass, *equations.force))
    return None if timed else SteppedEquations(equations)


class SteppedBodies(Stepped):
    """A tree of bodies, its coordinates in some order; u are forces on them.

    Args:
        tree: the links.
        order: which of the tree's coordinates each one is, (n,).
    """

    def __init__(self, tree: Tree, order: list[int]) -> None:
        self._tree, self._order, self._back = SteppedTree(tree), order, np.argsort(order)

    def velocities(self, q: Array, rate: Array) -> Array:
        """Angular ones of rotations."""
        return self._there(self._tree.velocities(*map(self._here, (q, rate))))

    def rates(self, q: Array, m: Array) -> Array:
        """Of the coordinates."""
        return self._there(self._tree.rates(*map(self._here, (q, m))))

    def mass(self, q: Array) -> Array:
        """M, (B, n, n)."""
        found = np.moveaxis(self._tree.mass(self._here(q)), -1, 0)
        return found[:, self._order][:, :, self._order]

    def force(self, q: Array, m: Array, u: Array) -> Array:
        """f, (B, n)."""
        return self._there(self._tree.force(*map(self._here, (q, m, u))))

    def advanced(self, q: Array, m: Array, h: float) -> Array:
        """Rotations go on about one axis."""
        return self._there(self._tree.advanced(self._here(q), self._here(m), h))

    def unturned(self, moved: Array, m: Array) -> Array:
        """By the inverse of the exponential's differential."""
        return self._there(self._tree.unturned(*map(self._here, (moved, m))))

    def _here(self, values: Array) -> Array:
        return values.T[self._back]

    def _there(self, values: Array) -> Array:
        return values[self._order].T


def next_states(
    stepped: Stepped,
    states: Array,
    u: Array,
    h: float,
    *,
    scheme: Scheme,
    damping: Array | None = None,
    stiffness: Array | None = None,
    by_velocity: bool = False,
    coupled: NDArray[np.bool_] | None = None,
    steps: int = 1,
) -> Array:
    """States (B, 2n) after steps of h seconds, by a rule on the equations.

    Args:
        stepped: the mechanism.
        states: q and rates, (B, 2n).
        u: held over each step, (B, steps, inputs).
        h: seconds.
        scheme: "semi-implicit Euler" is m + h a, then q advanced by the new m; "Runge-Kutta 4" the
            classical rule, and of Munthe-Kaas where bodies turn.
        damping: D of (M + h D) a = f, (n, n), taken at the step's end; None: f is all at its start.
        stiffness: K of (M + h D + h^2 K) a = f - h K m, (n, n): of springs taken where the new m
            takes them.
        by_velocity: D is -df/dm of all that there is instead,
        coupled: of these pairs alone, (n, n); None: of all.
        steps: how many.

    Returns:
        What is not finite where a motion blows up on the way.
    """
    n = states.shape[1] // 2
    q: Array = states[:, :n]
    m: Array = stepped.velocities(q, states[:, n:])
    for k in range(steps):
        held = u[:, k]
        if scheme == "Runge-Kutta 4":
            q, m = _runge_kutta(stepped, q, m, held, h)
            continue
        late = damping
        if by_velocity:
            late = _by_velocity(stepped, q, m, held) * (1 if coupled is None else coupled)
        m = m + h * _acceleration(stepped, q, m, held, _Late.of(h, late, stiffness))
        q = stepped.advanced(q, m, h)
    return np.concatenate([q, stepped.rates(q, m)], axis=1)


@dataclass(frozen=True)
class _Late:
    """What of the forces is taken at a step's end: `mass` beside M, (n, n) or (B, n, n).

    And a share of them by the velocity at its start, (n, n); None: none.
    """

    mass: Array
    by_velocity: Array | None

    @staticmethod
    def of(h: float, damping: Array | None, stiffness: Array | None) -> _Late | None:
        """Of D and K, where there are any."""
        if stiffness is None:
            return None if damping is None else _Late(h * damping, None)
        springs = h * stiffness
        mass = h * springs if damping is None else h * (damping + springs)
        return _Late(mass, springs)


def _acceleration(stepped: Stepped, q: Array, m: Array, u: Array, late: _Late | None) -> Array:
    mass, force = stepped.mass(q), stepped.force(q, m, u)
    left: Array = mass if late is None else mass + late.mass
    if late is not None and late.by_velocity is not None:
        force = force - m @ late.by_velocity.T
    columns = force[:, :, None]
    if len(q[0]) == 1:  # the same division
        with np.errstate(all="ignore"):
            return (columns / left)[:, :, 0]
    try:
        return np.linalg.solve(left, columns).astype(float)[:, :, 0]
    except np.linalg.LinAlgError:  # a motion that has blown up has masses of any kind
        return np.full_like(q, np.nan)


def _by_velocity(stepped: Stepped, q: Array, m: Array, u: Array) -> Array:
    """-df/dm, (B, n, n): of forces of second degree in m central differences are exact."""
    columns = []
    for i, size in enumerate(np.maximum(np.max(np.abs(m), axis=0), 1e-3)):
        moved = size * np.eye(m.shape[1])[i]
        ahead, behind = (stepped.force(q, m + by, u) for by in (moved, -moved))
        columns.append((behind - ahead) / (2 * size))
    return np.stack(columns, axis=2)


def _runge_kutta(stepped: Stepped, q: Array, m: Array, u: Array, h: float) -> tuple[Array, Array]:
    """Of Munthe-Kaas where bodies turn (1999, Appl. Numer. Math. 29, 115-127), else the classical.

    What is summed are moves from the step's start, so that rotations keep the order.
    """
    rates, accelerations = [m], [_acceleration(stepped, q, m, u, None)]
    for share in (0.5, 0.5, 1.0):
        moved = share * h * rates[-1]
        at = stepped.advanced(q, moved, 1.0)
        now: Array = m + share * h * accelerations[-1]
        rates.append(stepped.unturned(moved, now))
        accelerations.append(_acceleration(stepped, at, now, u, None))
    move, gain = (h / 6 * (a + d + 2 * (b + c)) for a, b, c, d in (rates, accelerations))
    return stepped.advanced(q, move, 1.0), m + gain
