"""Equations of a mechanism whose contacts, friction and drives are each in one mode.

In a mode every interaction is smooth: a contact is free, slips or sticks, dry friction slips or
sticks, a drive is linear or at its limit. Contacts that close add multipliers:
M a = f + G lambda, L a + c = target - R lambda. Eliminating them leaves equations of motion as
those of a system without contacts. Source: Pfeiffer and Glocker, Multibody Dynamics with
Unilateral Contacts (1996), chapters 5 and 6; for soft rows see `reference.laws.soft`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TypeAlias

import sympy as sp

from physics_crosscheck.reference.dynamics.derive import Equations, simplify_bounded, solved
from physics_crosscheck.reference.mechanism.declaration import Declaration, t
from physics_crosscheck.reference.mechanism.interactions import (
    Buffer,
    Contact,
    Drive,
    DryFriction,
    Interaction,
    Limit,
)
from physics_crosscheck.reference.mechanism.laws import SoftLaw
from physics_crosscheck.reference.mechanism.numeric import NumericFunction
from .soft import SMALLEST, clipped_impedance, gains

Modes: TypeAlias = tuple[str, ...]
"""One mode of each part, by its name."""

FREE, CLOSED, STICK = "free", "closed", "stick"

SLIPS: Mapping[str, int] = {"slip+": 1, "slip-": -1}
"""Modes of sliding, with the sign of the slip."""


@dataclass(frozen=True, kw_only=True)
class Rate:
    """A velocity that is linear in the velocities, with its derivative J a + bias.

    Attributes:
        value: the velocity.
        row: J, 1 x n.
        bias: the derivative without accelerations.
    """

    value: sp.Expr
    row: sp.ImmutableMatrix
    bias: sp.Expr

    @staticmethod
    def of_gap(gap: sp.Expr, system: Declaration) -> Rate:
        """Return the rate of a position."""
        rate = sp.Add(*(sp.diff(gap, q) * v for q, v in zip(system.q, system.v, strict=True)))
        return Rate.of_velocity(rate + sp.diff(gap, t), system)

    @staticmethod
    def of_velocity(value: sp.Expr, system: Declaration) -> Rate:
        """Return a velocity with its derivative."""
        bias = sp.Add(*(sp.diff(value, q) * v for q, v in zip(system.q, system.v, strict=True)))
        row = sp.ImmutableMatrix([[sp.diff(value, v) for v in system.v]])
        return Rate(value=value, row=row, bias=bias + sp.diff(value, t))


@dataclass(kw_only=True)
class ModeTerms:
    """Contribution of one part in one mode to the equations.

    Attributes:
        force: generalized force without unknown multipliers, n x 1; None for none.
        conditions, right: row of each multiplier's condition, and its column of forces.
        target: value of L a for each multiplier.
        soft: compliance R of each multiplier.
        guards: conditions that stay positive in the mode, from the multipliers and accelerations.
        zeros: expressions that are zero when the mode begins.
    """

    force: sp.Matrix | None = None
    conditions: list[sp.Matrix] = field(default_factory=list)
    right: list[sp.Matrix] = field(default_factory=list)
    target: list[sp.Expr] = field(default_factory=list)
    soft: list[sp.Expr] = field(default_factory=list)
    guards: Callable[[list[sp.Expr], sp.Matrix], list[sp.Expr]] = lambda multipliers, a: []
    zeros: tuple[sp.Expr, ...] = ()

    def add(
        self, condition: sp.Matrix, right: sp.Matrix, target: sp.Expr, soft: sp.Expr | int = 0
    ) -> None:
        """Add a multiplier."""
        self.conditions.append(condition)
        self.right.append(right)
        self.target.append(target)
        self.soft.append(sp.sympify(soft))


@dataclass(frozen=True, kw_only=True)
class Contacting:
    """A contact, rigid or soft.

    Attributes:
        name: its name.
        gap, rate: distance and its rate.
        slip: sliding velocity; None without friction.
        mu, e: friction coefficient and restitution.
        law: its soft law; None if it is rigid.
        weight: inverse inertia that scales a soft row, 1/kg.
    """

    name: str
    gap: sp.Expr
    rate: Rate
    slip: Rate | None
    mu: sp.Expr
    e: sp.Expr
    law: SoftLaw | None
    weight: sp.Expr

    @property
    def modes(self) -> Modes:
        """All modes: of a soft contact, one for each branch of its impedance."""
        pressed = (CLOSED,) if self.slip is None else (STICK, *SLIPS)
        if self.law is None:
            return (FREE, *pressed)
        return (FREE, *(f"{m} {i}" for m in pressed for i in range(len(self._branches))))

    @cached_property
    def _branches(self) -> tuple[tuple[float, float, Callable[[sp.Expr], sp.Expr]], ...]:
        """Depths between which the impedance is one formula, with that formula."""
        assert self.law is not None
        start, full, width, middle, power = clipped_impedance(self.law.softness)
        if start == full or width <= SMALLEST:
            return ((0.0, float("inf"), lambda depth: sp.Float((start + full) / 2, 17)),)
        span, exponent = full - start, sp.nsimplify(power)

        def below(depth: sp.Expr) -> sp.Expr:
            return start + span * (depth / width) ** exponent / middle ** (exponent - 1)

        def above(depth: sp.Expr) -> sp.Expr:
            rest = (1 - depth / width) ** exponent / (1 - middle) ** (exponent - 1)
            return start + span * (1 - rest)

        def deep(depth: sp.Expr) -> sp.Expr:
            return sp.Float(full, 17)

        last = (width, float("inf"), deep)
        if exponent == 1:
            return ((0.0, width, below), last)
        return ((0.0, middle * width, below), (middle * width, width, above), last)

    def contribution(self, mode: str) -> ModeTerms:
        """Return what the contact adds in a mode."""
        if mode == FREE:
            return self._free()
        return self._rigid(mode) if self.law is None else self._pressed(*mode.split(" "))

    def _free(self) -> ModeTerms:
        if self.law is None:
            return ModeTerms(guards=lambda multipliers, a: [self.gap])
        *lower, last = range(len(self._branches))
        target = sp.Piecewise(
            *((self._targets(i)[0], -self.gap < self._branches[i][1]) for i in lower),
            (self._targets(last)[0], True),
        )

        def guards(multipliers: list[sp.Expr], a: sp.Matrix) -> list[sp.Expr]:
            # Beyond touch it stays free while the law would pull.
            pulls = (self.rate.row * a)[0] - target
            return [_larger(self.gap, pulls)]

        return ModeTerms(guards=guards)

    def _rigid(self, mode: str) -> ModeTerms:
        contribution = ModeTerms(zeros=(self.gap, self.rate.value))
        row, column = self.rate.row, self.rate.row.T
        sign = SLIPS.get(mode, 0)
        if self.slip is not None and sign:
            column = column - sign * self.mu * self.slip.row.T
        contribution.add(row, column, -self.rate.bias)
        if self.slip is not None and mode == STICK:
            contribution.add(self.slip.row, self.slip.row.T, -self.slip.bias)
            contribution.zeros += (self.slip.value,)
        contribution.guards = lambda multipliers, a: self._closed(mode, multipliers, a)
        return contribution

    def _closed(self, mode: str, multipliers: list[sp.Expr], a: sp.Matrix) -> list[sp.Expr]:
        sign = SLIPS.get(mode, 0)
        if self.slip is not None and sign:
            return [multipliers[0], sign * self.slip.value]
        if mode == STICK:
            normal, across = multipliers
            return [normal, self.mu * normal - across, self.mu * normal + across]
        return [multipliers[0]]

    def _targets(self, branch: int) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """Return aref of both directions, and the softness over the inverse inertia."""
        assert self.law is not None
        full = clipped_impedance(self.law.softness)[1]
        k, b = gains(self.law.softness.reference, full, 0.0, safe=False)
        d = self._branches[branch][2](-self.gap)
        across = sp.Integer(0) if self.slip is None else -b * self.slip.value
        return -b * self.rate.value - k * d * self.gap, across, (1 - d) / d

    def _pressed(self, mode: str, number: str) -> ModeTerms:
        assert self.law is not None
        branch = int(number)
        normal, across, share = self._targets(branch)
        soft = share * self.weight / self.law.points
        sideways = soft / sp.sympify(self.law.friction_ratio)
        row, sign = self.rate.row, SLIPS.get(mode, 0)
        # The law is one of J a, without J-dot v.
        contribution = ModeTerms()
        if self.slip is not None and sign:
            row = row - sign * self.mu * self.slip.row
            target = normal - sign * self.mu * across
            contribution.add(row, row.T, target, soft + self.mu**2 * sideways)
        else:
            contribution.add(row, row.T, normal, soft)
        if self.slip is not None and not sign:
            contribution.add(self.slip.row, self.slip.row.T, across, sideways)

        def guards(multipliers: list[sp.Expr], a: sp.Matrix) -> list[sp.Expr]:
            low, high, _ = self._branches[branch]
            knots = [-self.gap - low] + ([high + self.gap] if high < float("inf") else [])
            if self.slip is not None and sign:
                # Outside the cone, the force that sticking needs is beyond the edge.
                wanted = [
                    ((self.rate.row * a)[0] - normal) / soft,
                    ((self.slip.row * a)[0] - across) / sideways,
                ]
                beyond = sign * wanted[1] + self.mu * wanted[0]
                return [multipliers[0], beyond, *knots]
            return [*self._closed(mode, multipliers, a), *knots]

        contribution.guards = guards
        return contribution


@dataclass(frozen=True, kw_only=True)
class Rubbing:
    """Dry friction, rigid or soft."""

    name: str
    slip: Rate
    force: sp.Expr
    law: SoftLaw | None
    weight: sp.Expr

    modes: Modes = (STICK, *SLIPS)

    def contribution(self, mode: str) -> ModeTerms:
        """Return what the friction adds in a mode."""
        sign = SLIPS.get(mode, 0)
        aref, soft = self._target()
        if not sign:
            contribution = ModeTerms(zeros=(self.slip.value,) if self.law is None else ())
            contribution.add(self.slip.row, self.slip.row.T, aref - self.slip.bias, soft)
            contribution.guards = lambda multipliers, a: [
                self.force - multipliers[0],
                self.force + multipliers[0],
            ]
            return contribution
        contribution = ModeTerms(force=-sign * self.force * self.slip.row.T)
        if self.law is None:
            contribution.guards = lambda multipliers, a: [sign * self.slip.value]
        else:
            contribution.guards = lambda multipliers, a: [
                sign * ((self.slip.row * a)[0] + self.slip.bias - aref) / soft - self.force
            ]
        return contribution

    def _target(self) -> tuple[sp.Expr, sp.Expr]:
        if self.law is None:
            return sp.Integer(0), sp.Integer(0)
        start, full, *_ = clipped_impedance(self.law.softness)
        _, b = gains(self.law.softness.reference, full, 0.0, safe=False)
        return -b * self.slip.value, sp.Float((1 - start) / start, 17) * self.weight


@dataclass(frozen=True, kw_only=True)
class Pushing:
    """A buffer."""

    name: str
    gap: sp.Expr
    rate: Rate
    force: sp.Expr

    modes: Modes = (FREE, CLOSED)

    def contribution(self, mode: str) -> ModeTerms:
        """Return what the buffer adds in a mode."""
        if mode == FREE:
            return ModeTerms(guards=lambda multipliers, a: [_larger(self.gap, -self.force)])
        contribution = ModeTerms(force=self.force * self.rate.row.T)
        contribution.guards = lambda multipliers, a: [self.force]
        return contribution


@dataclass(frozen=True, kw_only=True)
class Driving:
    """A drive with a limited force."""

    name: str
    column: sp.ImmutableMatrix
    force: sp.Expr
    limit: sp.Expr

    modes: Modes = ("linear", "upper", "lower")

    def contribution(self, mode: str) -> ModeTerms:
        """Return what the drive adds in a mode."""
        sign = {"linear": 0, "upper": 1, "lower": -1}[mode]
        force = sign * self.limit if sign else self.force
        contribution = ModeTerms(force=force * self.column)
        contribution.guards = lambda multipliers, a: (
            [sign * self.force - self.limit]
            if sign
            else [self.limit - self.force, self.limit + self.force]
        )
        return contribution


def _larger(first: sp.Expr, second: sp.Expr) -> sp.Expr:
    return sp.Piecewise((first, first > second), (second, True))


Part: TypeAlias = Contacting | Rubbing | Pushing | Driving
"""An interaction with its rates; a joint limit is one contact for each end."""


@dataclass(frozen=True, kw_only=True)
class ModeEquations:
    """The equations of one mode, with what ends it.

    Attributes:
        modes: the mode of each part.
        equations: M a = f with the multipliers eliminated.
        guards: positive conditions, of q, v, u, (t,).
        owners: index of the part of each guard.
    """

    modes: Modes
    equations: Equations
    guards: NumericFunction
    owners: tuple[int, ...]


def parts_of(
    equations: Equations,
    interactions: Sequence[Interaction],
    laws: Mapping[str, SoftLaw],
    home: Mapping[sp.Symbol, sp.Expr],
) -> tuple[Part, ...]:
    """Return the parts of a system's interactions.

    Args:
        laws: soft laws, by the name of the contact or friction; the others are rigid.
        home: positions at which inverse inertias scale soft rows.
    """
    system, result = equations.system, list[Part]()
    contacts = [c for i in interactions for c in (i.contacts if isinstance(i, Limit) else (i,))]

    def weight(rate: Rate, law: SoftLaw | None) -> sp.Expr:
        if law is None:
            return sp.Integer(0)
        mass = sp.Matrix(equations.mass).xreplace(dict(home))
        row = rate.row.xreplace(dict(home))
        return sp.simplify((row * solved(mass, row.T))[0]) * sp.nsimplify(law.weight)

    def law(name: str) -> SoftLaw | None:
        return laws.get(name, laws.get(name.rpartition(" ")[0]))

    for declared in contacts:
        if isinstance(declared, Contact):
            gap, slip = sp.sympify(declared.gap), sp.sympify(declared.slip)
            rate = Rate.of_gap(gap, system)
            rough = slip != 0 and sp.sympify(declared.mu) != 0
            result.append(
                Contacting(
                    name=declared.name,
                    gap=gap,
                    rate=rate,
                    slip=Rate.of_velocity(slip, system) if rough else None,
                    mu=sp.sympify(declared.mu),
                    e=sp.sympify(declared.e),
                    law=law(declared.name),
                    weight=weight(rate, law(declared.name)),
                )
            )
        elif isinstance(declared, DryFriction):
            slip_rate = Rate.of_velocity(sp.sympify(declared.slip), system)
            result.append(
                Rubbing(
                    name=declared.name,
                    slip=slip_rate,
                    force=sp.sympify(declared.force),
                    law=law(declared.name),
                    weight=weight(slip_rate, law(declared.name)),
                )
            )
        elif isinstance(declared, Buffer):
            gap = sp.sympify(declared.gap)
            rate = Rate.of_gap(gap, system)
            force = -declared.stiffness * gap - declared.damping * rate.value
            result.append(Pushing(name=declared.name, gap=gap, rate=rate, force=force))
        elif isinstance(declared, Drive):
            forces = [sp.sympify(declared.on.get(c, 0)) for c in system.coordinates]
            result.append(
                Driving(
                    name=declared.name,
                    column=sp.ImmutableMatrix(forces),
                    force=sp.sympify(declared.force),
                    limit=sp.sympify(declared.limit),
                )
            )
    return tuple(result)


def mode_equations(equations: Equations, parts: Sequence[Part], modes: Modes) -> ModeEquations:
    """Derive the equations of a mode.

    Raises:
        ZeroDivisionError: if more rows are closed than their Jacobian's rank.
    """
    pushed, guards, owners = _mode_terms(equations.mass, equations.force, tuple(parts), modes)
    return ModeEquations(
        modes=modes,
        equations=replace(equations, force=pushed),
        guards=equations.compile(list(guards)),
        owners=owners,
    )


@lru_cache(maxsize=256)  # a diagnosis and a census have the same modes at many constants
def _mode_terms(
    mass: sp.ImmutableMatrix, force: sp.ImmutableMatrix, parts: tuple[Part, ...], modes: Modes
) -> tuple[sp.ImmutableMatrix, tuple[sp.Expr, ...], tuple[int, ...]]:
    """Return the forces of a mode with its multipliers, its guards, and the part of each."""
    contribution = [part.contribution(mode) for part, mode in zip(parts, modes, strict=True)]
    total = sp.Matrix(force)
    for each in contribution:
        total += each.force if each.force is not None else sp.zeros(*force.shape)
    multipliers, pushed = _eliminated(sp.Matrix(mass), total, contribution)
    a = solved(sp.Matrix(mass), pushed)
    guards, owners, first = list[sp.Expr](), list[int](), 0
    for i, each in enumerate(contribution):
        some = each.guards(multipliers[first : first + len(each.conditions)], a)
        first += len(each.conditions)
        guards += some
        owners += [i] * len(some)
    return sp.ImmutableMatrix(pushed), tuple(guards), tuple(owners)


def _eliminated(
    mass: sp.Matrix, force: sp.Matrix, contribution: Sequence[ModeTerms]
) -> tuple[list[sp.Expr], sp.Matrix]:
    """Return the multipliers, and the forces with them, n x 1."""
    rows = [row for each in contribution for row in each.conditions]
    if not rows:
        return [], force
    conditions = sp.Matrix.vstack(*rows)
    right = sp.Matrix.hstack(*(column for each in contribution for column in each.right))
    target = sp.Matrix([value for each in contribution for value in each.target])
    soft = sp.diag(*(value for each in contribution for value in each.soft))
    inverse = sp.Matrix.hstack(*(solved(mass, right[:, j]) for j in range(right.cols)))
    matrix = (conditions * inverse + soft).applyfunc(_simplified)
    if _vanishes(matrix.det(method="berkowitz")):
        raise ZeroDivisionError
    wanted = target - conditions * solved(mass, force)
    values = matrix.LUsolve(wanted)
    return list(values), force + right * values


def _vanishes(expression: sp.Expr) -> bool:
    """Return whether an expression is zero, by its value at a generic point."""
    symbols = sorted(expression.free_symbols, key=str)
    point = {x: sp.Rational((37 * k) % 101 + 13, 101) for k, x in enumerate(symbols, 1)}
    return bool(abs(expression.xreplace(point).evalf(VANISHING_DIGITS)) < TINY)


VANISHING_DIGITS, TINY = 30, 1e-20
"""Digits of a value at a generic point, and the size below which it is zero."""


def _simplified(expression: sp.Expr) -> sp.Expr:
    """Simplify an expression without floats; others would lose digits in expanded powers."""
    return expression if expression.has(sp.Float) else simplify_bounded(expression)
