"""Soft constraints: rows, their softness, and the convex problem that determines accelerations.

The accelerations a minimize (a - a0)^T M (a - a0) / 2 + s(J a - aref), where a0 are those without
constraints. Sources: Todorov, Convex and analytically-invertible dynamics with contacts and
constraints (ICRA 2014); MuJoCo's documentation, Computation, chapters Constraint model and Solver.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.laws import Range, Softness
from physics_crosscheck.reference.mechanism.numeric import Array

SMALLEST = 1e-15
"""Smallest divisor and smallest R of the documented law."""

IMPEDANCE = 1e-4, 0.9999
"""Range of impedances and of their midpoint."""

DEFAULT_REFERENCE = 0.02, 1.0
"""Replaces a reference whose two numbers have different signs."""


class Kind(Enum):
    """Kind of a row, by its cost of x = J a - aref."""

    EQUALITY = 0
    FRICTION = 1
    ONE_SIDED = 2
    BLOCK = 3


ONE_SIDED, FRICTION = Kind.ONE_SIDED.value, Kind.FRICTION.value


def clipped_impedance(softness: Softness) -> tuple[float, float, float, float, float]:
    """Return d at zero and full depth, width, midpoint and power, within the documented ranges."""
    start, full, width, middle, power = softness.impedance
    low, high = IMPEDANCE
    start, full, middle = (min(max(x, low), high) for x in (start, full, middle))
    return start, full, max(0.0, width), middle, max(1.0, power)


def impedance(softness: Softness, distance: float) -> tuple[float, float]:
    """Return d at a violation (m or rad), and d at full depth."""
    start, full, width, middle, power = clipped_impedance(softness)
    if start == full or width <= SMALLEST:
        return (start + full) / 2, full
    x = abs(distance) / width
    if x >= 1 or x <= 0:
        return (full if x >= 1 else start), full
    if power == 1:
        y = x
    elif x <= middle:
        y = x**power / middle ** (power - 1)
    else:
        y = 1 - (1 - x) ** power / (1 - middle) ** (power - 1)
    return start + y * (full - start), full


def varies(softness: Softness) -> bool:
    """Return whether the impedance depends on the violation."""
    start, full, width, *_ = clipped_impedance(softness)
    return width > SMALLEST and start != full


def gains(reference: Range, full: float, step: float, *, safe: bool) -> tuple[float, float]:
    """Return stiffness k (1/s^2) and damping b (1/s) of aref = -b v - k d r.

    Args:
        reference: as in `Softness`.
        full: impedance at full depth.
        step: s.
        safe: whether the time constant is at least two steps.
    """
    if (reference[0] > 0) != (reference[1] > 0):
        reference = DEFAULT_REFERENCE
    first, second = reference
    if first <= 0:
        return -first / full**2, -second / full
    constant = max(first, 2 * step) if safe else first
    k = 1 / max(SMALLEST, full**2 * constant**2 * second**2)
    return k, 2 / max(SMALLEST, full * constant)


WITHIN = 2
"""Way of a part whose violation is within the width of its impedance."""


class Part(NamedTuple):
    """A part of the laws that acts at some states.

    Attributes:
        kind: "limit", "dry friction", "equality", "contact", "control", "state", "force", "joint
            force", "tendon force".
        place: index of the limit, friction, equality, contact, drive, joint or sum.
        way: end of a range, -1 or 1; 1 for friction that slides; `WITHIN` for an equality within
            the width of its impedance, and for a limit too, with the sign of its end.
    """

    kind: str
    place: int = -1
    way: int = 0


class RowBlock(Protocol):
    """Rows whose forces depend on each other: n blocks of k rows."""

    @property
    def rows(self) -> NDArray[np.int_]:
        """Its rows, the normal ones first, (n, k)."""

    def force(self, x: Array, softness: Array) -> tuple[Array, Array]:
        """Return the forces, (n, k), and minus their slopes by x = J a - aref, (n, k, k).

        Args:
            x, softness: of the rows, (n, k).
        """


class Cone(NamedTuple):
    """Elliptic friction cones: their rows begin at `start`; `slope` is the regularized friction."""

    start: NDArray[np.int_]
    slope: Array
    friction: Array

    @property
    def rows(self) -> NDArray[np.int_]:
        """Its rows, the normal ones first, (n, k)."""
        return self.start[:, None] + np.arange(1 + self.friction.shape[1])

    def force(self, x: Array, softness: Array) -> tuple[Array, Array]:
        """Return the forces, and minus their slopes by x, as in `RowBlock.force`."""
        mu = self.slope[:, None]
        normal, across = x[:, :1] * mu, x[:, 1:] * self.friction
        size = np.linalg.norm(across, axis=1, keepdims=True)
        free, sticks = (normal >= mu * size)[:, 0], (mu * normal + size <= 0)[:, 0]
        size[free | sticks] = 1.0  # neither slides
        stiffness = 1 / (softness[:, :1] * mu**2 * (1 + mu**2))
        outside, along = normal - mu * size, across / size
        slope = np.concatenate([np.ones_like(mu), -mu * along], axis=1)
        curvature = slope[:, :, None] * slope[:, None]
        isotropic = np.eye(across.shape[1]) - along[:, :, None] * along[:, None]
        curvature[:, 1:, 1:] -= (outside * mu / size)[:, None] * isotropic
        scale = np.concatenate([mu, self.friction], axis=1)
        force = -stiffness * outside * slope * scale
        slopes = stiffness[:, None] * curvature * scale[:, :, None] * scale[:, None]
        force[free], slopes[free] = 0.0, 0.0
        force[sticks] = -x[sticks] / softness[sticks]
        slopes[sticks] = np.eye(x.shape[1]) / softness[sticks][:, None]
        return force, slopes


@dataclass(kw_only=True)
class Rows:
    """Rows of constraints at one state, as they are added.

    Attributes:
        step: s.
        safe: whether time constants are at least two steps.
        velocities: stored, (nv,).
        parts: of the laws that the rows belong to.
        arms: magnitudes of the positions whose differences are arms in each row, (nv,).
        violations: r of each row, m or rad.
    """

    step: float
    safe: bool
    velocities: Array
    jacobian: list[Array] = field(default_factory=list)
    reference: list[float] = field(default_factory=list)
    softness: list[float] = field(default_factory=list)
    kinds: list[Kind] = field(default_factory=list)
    bounds: list[float] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)
    blocks: list[RowBlock] = field(default_factory=list)
    cones: list[tuple[int, float, Array]] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    arms: list[Array] = field(default_factory=list)
    violations: list[float] = field(default_factory=list)

    def add(
        self, kind: Kind, row: Array, softness: Softness, violation: float, weight: float, *,
        position: float = 0.0, depth: float | None = None, bias: float = 0.0, bound: float = 0.0,
        share: float = 1.0, arms: Array | float = 0.0, part: Part,
    ) -> None:  # fmt: skip
        """Add a row.

        Args:
            kind: of the row.
            row: J, (nv,).
            softness: of the constraint.
            violation: r, m or rad, 0 for friction.
            weight: inverse inertia that scales R.
            position: magnitude of the positions whose difference r is.
            depth: violation that determines the impedance; None for r itself.
            bias: J-dot v.
            bound: of a friction force.
            share: factor of R, after its lower bound.
            arms: magnitudes of the positions whose differences are arms in the row, (nv,).
            part: of the laws that the row belongs to.
        """
        d, full = impedance(softness, violation if depth is None else depth)
        k, b = gains(softness.reference, full, self.step, safe=self.safe)
        rate = float(row @ self.velocities)
        self.violations.append(violation)
        size = b * float(np.abs(row) @ np.abs(self.velocities)) + abs(bias)
        self._append(
            kind, row, reference=-b * rate - k * d * violation - bias,
            softness=share * max(SMALLEST, (1 - d) / d * weight),
            size=size + k * d * (abs(violation) + position), bound=bound, arms=arms, part=part,
        )  # fmt: skip

    def add_rate(
        self, kind: Kind, row: Array, *, softness: float = 1.0, bound: float = 0.0,
        size: float = 0.0, arms: Array | float = 0.0, part: Part,
    ) -> None:  # fmt: skip
        """Add a row whose x is its velocity after the step, per second of it.

        Args:
            kind, row, bound, arms, part: as in `add`.
            softness: R.
            size: further magnitudes in x.
        """
        self._append(
            kind, row, reference=-float(row @ self.velocities) / self.step, softness=softness,
            size=float(np.abs(row) @ np.abs(self.velocities)) / self.step + size,
            bound=bound, arms=arms, part=part,
        )  # fmt: skip

    def _append(
        self, kind: Kind, row: Array, *, reference: float, softness: float, size: float,
        bound: float, arms: Array | float, part: Part,
    ) -> None:  # fmt: skip
        self.kinds.append(kind)
        self.jacobian.append(row)
        self.reference.append(reference)
        self.softness.append(softness)
        self.sizes.append(size)
        self.bounds.append(bound)
        self.arms.append(arms + np.zeros_like(row))
        self.parts.append(part)

    def _cones(self) -> Iterator[Cone]:
        """Yield the cones of each number of rows."""
        for count in sorted({len(friction) for *_, friction in self.cones}):
            cones = zip(*(cone for cone in self.cones if len(cone[2]) == count), strict=True)
            yield Cone(*map(np.array, cones))

    def problem(self, mass: Array, free: Array) -> Problem:
        """Return the problem of these rows; arguments as its attributes."""
        return Problem(
            mass=mass,
            free=free,
            jacobian=np.array(self.jacobian).reshape(-1, len(free)),
            arms=np.array(self.arms).reshape(-1, len(free)),
            reference=np.array(self.reference),
            softness=np.array(self.softness),
            kinds=np.array([kind.value for kind in self.kinds], dtype=int),
            bounds=np.array(self.bounds),
            sizes=np.array(self.sizes),
            blocks=(*self.blocks, *self._cones()),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """The convex problem at one state, of K rows.

    Attributes:
        mass: M, (nv, nv).
        free: a0, (nv,).
        jacobian: J, (K, nv).
        arms: magnitudes of the positions whose differences are arms in J, (K, nv).
        reference: aref, (K,).
        softness: R, (K,).
        kinds: values of `Kind`, (K,).
        bounds: of friction forces, (K,).
        sizes: sums of the magnitudes in aref, (K,).
        blocks: of rows whose forces depend on each other.
    """

    mass: Array
    free: Array
    jacobian: Array
    arms: Array
    reference: Array
    softness: Array
    kinds: NDArray[np.int_]
    bounds: Array
    sizes: Array
    blocks: tuple[RowBlock, ...]

    def forces(self, a: Array) -> tuple[Array, Array]:
        """Return the forces of the rows, (K,), and minus their slopes by x, (K, K)."""
        return self._forces(self.jacobian @ a - self.reference)

    def _forces(self, x: Array) -> tuple[Array, Array]:
        force = -x / self.softness
        active = np.ones(len(x))
        free = (self.kinds == ONE_SIDED) & (x >= 0)
        slides = (self.kinds == FRICTION) & (np.abs(force) >= self.bounds)
        force[free] = 0.0
        force[slides] = np.sign(force[slides]) * self.bounds[slides]
        active[free | slides] = 0.0
        slope = np.diag(active / self.softness)
        for block in self.blocks:
            rows = block.rows
            force[rows], slopes = block.force(x[rows], self.softness[rows])
            slope[rows[:, :, None], rows[:, None]] = slopes
        return force, slope

    def gradient(self, a: Array) -> Array:
        """Return the gradient of the cost, (nv,): the force that is not balanced."""
        result: Array = self.mass @ (a - self.free) - self.jacobian.T @ self.forces(a)[0]
        return result

    def residual(self, a: Array) -> Array:
        """Return the gradient, (nv,); zero where it is rounding, whose effect `rounding` has."""
        gradient = self.gradient(a)
        converged = float(np.linalg.norm(gradient)) <= self._negligible(a)
        return np.zeros_like(gradient) if converged else gradient

    def with_residual(self, a: Array, residual: Array, momentum: Array) -> Problem:
        """Return the problem that an engine solved exactly, which stopped before this one's end.

        A residual beyond a solver's tolerance comes from a different law, and changes nothing.

        Args:
            a: the engine's accelerations.
            residual: force that its solver left, with the forces of limits, (nv,).
            momentum: M m per step, (nv,).
        """
        force = np.where(self.kinds == ONE_SIDED, self.forces(a)[0], 0.0)
        residual = residual - self.jacobian.T @ force
        sizes = map(np.linalg.norm, (momentum, self.mass @ (a - self.free)))
        if np.linalg.norm(residual) > TOLERANCE * max(sizes):
            return self
        free = self.free + np.linalg.solve(self.mass, residual)
        return replace(self, free=np.asarray(free, dtype=np.float64))

    def solve(self, start: Array) -> Array:
        """Return the minimizer, (nv,), by Newton's method with an exact line search.

        Args:
            start: first guess, such as an engine's answer.
        """
        a, size = start, np.inf
        for _ in range(MAX_ITERATIONS):
            gradient = self.gradient(a)
            now = float(np.linalg.norm(gradient))
            done = now >= size / 2 and size <= self._negligible(a)
            size = min(size, now)
            slope = self.forces(a)[1]
            hessian = self.mass + self.jacobian.T @ slope @ self.jacobian
            direction = np.asarray(np.linalg.solve(hessian, -gradient), dtype=np.float64)
            direction -= np.linalg.solve(hessian, hessian @ direction + gradient)
            whole = a + direction
            if done:  # the rounding of large components hides small ones
                return whole
            if np.linalg.norm(self.gradient(whole)) < now / 2:
                a = whole
            elif now <= self._negligible(a):
                return whole
            else:
                a = a + self._line_search(a, direction) * direction
        return a

    def _negligible(self, a: Array) -> float:
        """Return the size of a gradient that rounding leaves: of its forces, and of `a` itself."""
        (force, slope), mass = self.forces(a), np.abs(self.mass)
        loose = mass @ np.abs(a - self.free) + np.abs(self.jacobian).T @ np.abs(force)
        digits = mass @ np.abs(a) + np.abs(self.jacobian.T @ slope) @ self._sizes(a)
        return float(ROUGHLY * np.linalg.norm(loose) + LAST_DIGITS * np.linalg.norm(digits))

    def _sizes(self, a: Array) -> Array:
        """Return the sums of the magnitudes in x = J a - aref, (K,)."""
        result: Array = np.abs(self.jacobian) @ np.abs(a) + self.sizes
        return result

    def _line_search(self, a: Array, direction: Array) -> float:
        """Return the share of a direction at which the cost is least, by Brent's method."""
        from scipy.optimize import brentq  # slow import

        inertial = direction @ self.mass @ (a - self.free)
        curvature = direction @ self.mass @ direction
        x, rate = self.jacobian @ a - self.reference, self.jacobian @ direction

        def slope(share: float) -> float:
            force = self._forces(x + share * rate)[0]
            return float(inertial + share * curvature - rate @ force)

        low, high = 0.0, 1.0
        if abs(slope(1.0)) <= LINE_TOLERANCE * abs(slope(0.0)):
            return 1.0
        while (last := slope(high)) < 0 and high < MAX_SHARE:
            low, high = high, 2 * high
        if last <= 0 or slope(low) >= 0:
            return high if last <= 0 else low
        return float(brentq(slope, low, high, xtol=SHARE_TOLERANCE, disp=False))

    def rounding(self, a: Array, in_mass: Array, in_forces: Array) -> Array:
        """Return the effect of a last digit of every term on the minimizer, relative to epsilon.

        The rounding of a row acts along one vector, which is short even if the row is nearly rigid.

        Args:
            a: accelerations.
            in_mass, in_forces: sums of the magnitudes in M, (nv, nv), and in the smooth forces.
        """
        force, slope = self.forces(a)
        loose = (np.abs(self.mass) + in_mass) @ (np.abs(a) + np.abs(self.free)) + in_forces
        loose = loose + (np.abs(self.jacobian) + self.arms).T @ np.abs(force)
        stiff = self.jacobian.T @ slope
        inverse = np.linalg.inv(self.mass + stiff @ self.jacobian)
        result: Array = np.abs(inverse) @ loose + np.abs(inverse @ stiff) @ self._sizes(a)
        return result


MAX_ITERATIONS, ROUGHLY = 200, 1e-12
"""Newton iterations, and the share of the forces below which only rounding is left."""

TOLERANCE = 1e-5
"""Largest force that a solver may leave, as a share of the momentum per step, or of its change.

Documented tolerances are 1e-6, of norms that weigh velocities by their inertia.
"""

LAST_DIGITS = 4 * float(np.finfo(float).eps)
"""Share of the accelerations by which they are rounded."""

LINE_TOLERANCE, SHARE_TOLERANCE, MAX_SHARE = 1e-10, 1e-15, 1e6
"""Numbers of the line search: share of the first slope, error and largest value of a share."""
