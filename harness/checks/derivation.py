"""Derivation of a system for `crosscheck derive`."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import sympy as sp

from physics_crosscheck.harness.modelfiles.robot import home_of
from physics_crosscheck.harness.render.terminal.equations import DerivedPage, Matrix
from physics_crosscheck.harness.render.terminal.typeset import SumTerms, deviation
from physics_crosscheck.reference.dynamics.derive import LONG_OPERATIONS, Equations, derive
from physics_crosscheck.reference.dynamics.formulas import SymbolicEquations, formulas
from physics_crosscheck.reference.dynamics.linearize import (
    TaylorLinearization,
    classify,
    damped_shapes,
    linearize,
    s,
    taylor,
    to_array,
    transfer_functions,
)
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
from physics_crosscheck.reference.mechanism.bodies import powers
from physics_crosscheck.reference.mechanism.chart import Coupled
from physics_crosscheck.reference.mechanism.system import System
from .system_record import (
    errata_records,
    linearity_records,
    mode_records,
    motion_terms,
    pole_records,
)

ORDER = 3
"""Order of the Taylor series: the first with a nonlinear term of an odd force such as the sine."""

LONG_SERIES = 400
"""Maximum number of operations in the equations of motion for printing their series."""

ROUNDING = 1e-40
"""Relative size below which a matrix entry is rounding; entries are computed with 60 digits."""


def derivation(system: System) -> DerivedPage:
    """Return everything that is derived from a system, without integrating a scenario.

    This covers equations of motion, class, linearizations with poles, modes and transfer functions,
    Taylor series, the range of the linear equations, and the errata of the source.

    Raises:
        DeclarationError: for a wrong equilibrium, or an unreadable erratum.
    """
    equations = derive(system)
    linearizations = tuple(linearize(equations, e) for e in system.equilibria)
    return DerivedPage(
        name="derive",
        symbols=(system.q, system.v, system.a),
        coordinates=[coordinate.name for coordinate in system.coordinates],
        values={
            "system": system,
            "sides": motion_terms(equations),
            "kind": classify(len(system.inputs), len(system.outputs)),
            "linear": equations.linear,
            "order": ORDER,
            "equilibria": [_equilibrium(equations, one) for one in linearizations],
            "errata": errata_records(equations, linearizations),
            "s": s,
        },
    )


def _equilibrium(equations: Equations, linearization: TaylorLinearization) -> dict[str, object]:
    """Return what a page shows about an equilibrium.

    - rest: each position symbol and its value at rest.
    - matrices: M, C, K, A, B; without empty ones.
    - damped: eigenvalue and complex shape of each mode; empty without damping.
    - transfers: output, input and transfer function of each pair.
    - moved: symbols of deviations from nonzero rest positions, each with its meaning.
    - series: both sides of each equation's Taylor series; None for linear equations, empty if too
      long to read.
    - linearity: empty for linear equations, or about an unstable equilibrium.
    """
    system = equations.system
    moved = {
        q: deviation(q)
        for q, at in zip(system.q, linearization.symbolic_position, strict=True)
        if at != 0
    }
    series = None if equations.linear else _series(equations, linearization, moved)
    damped = any(linearization.damping) and len(system.q) > 1
    return {
        "declared": next(e for e in system.equilibria if e.name == linearization.equilibrium),
        "rest": list(zip(system.q, linearization.symbolic_position, strict=True)),
        "matrices": list(_matrices(linearization, system)),
        "poles": pole_records(linearization),
        "modes": mode_records(linearization),
        "damped": [
            (value, [complex(share) for share in shape])
            for value, shape in (damped_shapes(linearization) if damped else ())
        ],
        "transfers": _transfers(linearization, system),
        "moved": [
            (d, q - linearization.symbolic_position[system.q.index(q)]) for q, d in moved.items()
        ]
        if series
        else [],
        "series": series,
        "linearity": linearity_records(equations, linearization),
    }


def _matrices(linearization: TaylorLinearization, system: System) -> Iterator[Matrix]:
    symbolic = {
        "M": linearization.mass.applyfunc(sp.expand) if _short(linearization.mass) else None,
        "C": linearization.damping.applyfunc(sp.expand) if _short(linearization.damping) else None,
        "K": linearization.stiffness.applyfunc(sp.expand)
        if _short(linearization.stiffness)
        else None,
    }
    if _invertible(
        linearization.mass, linearization.damping, linearization.stiffness, linearization.input
    ):
        n, inverse = len(system.q), linearization.mass.inv()
        below = (-inverse * linearization.stiffness).row_join(-inverse * linearization.damping)
        state = sp.zeros(n).row_join(sp.eye(n)).col_join(below)
        push = sp.zeros(n, len(system.u)).col_join(inverse * linearization.input)
        symbolic |= {"A": state.applyfunc(sp.factor), "B": push.applyfunc(sp.factor)}
    for name in ("M", "C", "K", "A", "B"):
        numbers = to_array(linearization.exact[name])
        if not numbers.size:
            continue
        numbers[np.abs(numbers) < ROUNDING * np.max(np.abs(numbers))] = 0.0
        formula = symbolic.get(name)
        if formula is not None and not any(entry.free_symbols for entry in formula):
            formula = None
        yield Matrix(name=name, symbolic=formula, numbers=numbers.tolist())


def _short(*matrices: sp.Matrix) -> bool:
    """Return whether the matrices are short enough to read."""
    return bool(
        sum(sp.count_ops(entry) for matrix in matrices for entry in matrix) <= LONG_OPERATIONS
    )


def _invertible(*matrices: sp.Matrix) -> bool:
    """Return whether the matrices are short, and sympy can factor what follows from them.

    An equilibrium found numerically has decimal digits. Its polynomials then share no factors
    except numbers, and the search for factors would not end.
    """
    return _short(*matrices) and not any(matrix.has(sp.Float) for matrix in matrices)


def _transfers(
    linearization: TaylorLinearization, system: System
) -> list[tuple[sp.Symbol, sp.Symbol, sp.Expr]]:
    if not system.inputs:
        return []
    functions = transfer_functions(linearization)
    return [
        (sp.Symbol(o.name), u, functions[i, j])
        for i, o in enumerate(system.outputs)
        for j, u in enumerate(system.u)
    ]


def _series(
    equations: Equations, linearization: TaylorLinearization, moved: Mapping[sp.Symbol, sp.Symbol]
) -> list[tuple[SumTerms, SumTerms]]:
    system = equations.system
    if sum(sp.count_ops(row) for row in equations.residual) > LONG_SERIES:
        return []
    place = dict(zip(system.q, linearization.symbolic_position, strict=True))
    rest = place | dict.fromkeys((*system.v, *system.a, *system.u), sp.Integer(0))
    variables = [*system.a, *system.v, *(moved.get(q, q) for q in system.q), *system.u]
    sides: list[tuple[SumTerms, SumTerms]] = []
    for row in equations.residual:
        series = taylor(row, rest, ORDER)
        shifted = series.subs({q: d + place[q] for q, d in moved.items()}, simultaneous=True)
        monomials = sp.Poly(sp.expand(shifted), *variables).terms()
        # Linear terms first; within each degree acceleration, velocity, position.
        monomials.sort(key=lambda term: (sum(term[0]), [-power for power in term[0]]))
        driven = [_term(t, variables) for t in monomials if any(t[0][len(system.q) * 3 :])]
        free = [_term(t, variables) for t in monomials if not any(t[0][len(system.q) * 3 :])]
        sides.append((free, [(-coefficient, factor) for coefficient, factor in driven]))
    return sides


def _term(
    term: tuple[tuple[int, ...], sp.Expr], variables: Sequence[sp.Symbol]
) -> tuple[sp.Expr, sp.Expr]:
    powers, coefficient = term
    factors = (x**p for x, p in zip(variables, powers, strict=True))
    return coefficient, sp.Mul(*factors)


MASS_ROUNDING = 1e-11
"""Threshold for zero entries of a mass matrix with unit diagonal: smaller entries come from rounded
angles in the file.
"""


def tree_derivation(declared: MultibodySystem, omitted: Sequence[str] = ()) -> DerivedPage:
    """Return the equations of bodies.

    Args:
        declared: the bodies of a declaration, or of a robot file.
        omitted: statements of the file that the equations omit.
    """
    system, whole = declared.tree_system, declared.assembled
    home = home_of(whole.tree, whole.limits)[Coupled(whole.tree).kept]
    formula = formulas(whole.tree, system.q, system.v)
    n = len(home)
    still = np.zeros((1, n))
    equations = TreeEquations(system)
    mass = equations.numeric_mass(
        home[None], still, np.zeros((1, 0)), np.zeros((1, 1))
    ).reshape(n, n)  # fmt: skip
    force = -equations.forces_for(home[None], still, still)[0]
    force = np.where(np.abs(force) > MASS_ROUNDING * np.max(np.abs(force)), force, 0.0)
    size = np.sqrt(np.outer(mass.diagonal(), mass.diagonal()))
    mass = np.where(np.abs(mass) > MASS_ROUNDING * size, mass, 0.0)
    sides = _motion(formula, system.a) if isinstance(formula, SymbolicEquations) else []
    return DerivedPage(
        name="bodies",
        symbols=(system.q, system.v, system.a),
        coordinates=[coordinate.name for coordinate in system.coordinates],
        values={
            "declared": declared,
            "q": system.q,
            "coefficients": powers,
            "omitted": omitted,
            "sides": sides,
            "left_out": "" if sides else formula,
            "position": home.tolist(),
            "mass": Matrix(name="M", symbolic=None, numbers=mass.tolist()),
            "force": Matrix(name="f", symbolic=None, numbers=force[:, None].tolist()),
        },
    )


def _motion(
    equations: SymbolicEquations, a: tuple[sp.Symbol, ...]
) -> list[tuple[list[tuple[sp.Expr, sp.Expr]], list[tuple[sp.Expr, sp.Expr]]]]:
    """Return both sides of each equation."""
    return [
        (list(zip(row, a, strict=True)), [(term, sp.Integer(1)) for term in force])
        for row, force in zip(equations.mass, equations.force, strict=True)
    ]
