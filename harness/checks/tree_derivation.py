"""Equations of bodies for `crosscheck derive`: formulas for few joints, numbers for all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp

from physics_crosscheck.harness.checks.system_record import quantities
from physics_crosscheck.harness.modelfiles.robot import home_of
from physics_crosscheck.harness.render.terminal.equations import (
    DerivedTree,
    Matrix,
    ShownBody,
    ShownJoint,
)
from physics_crosscheck.reference.dynamics.formulas import SymbolicEquations, formulas
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.bodies import Joint, RigidBody, powers
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem

ROUNDING = 1e-11
"""Threshold for zero entries of a mass matrix with unit diagonal: smaller entries come from rounded
angles in the file.
"""


def tree_derivation(declared: MultibodySystem, omitted: Sequence[str] = ()) -> DerivedTree:
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
    force = np.where(np.abs(force) > ROUNDING * np.max(np.abs(force)), force, 0.0)
    size = np.sqrt(np.outer(mass.diagonal(), mass.diagonal()))
    mass = np.where(np.abs(mass) > ROUNDING * size, mass, 0.0)
    return DerivedTree(
        title=declared.title,
        source=declared.source,
        q=system.q,
        v=system.v,
        a=system.a,
        coordinates=quantities(system.coordinates),
        bodies=[_body(one) for one in declared.bodies],
        joints=[_joint(one, body) for body in declared.bodies for one in body.joints],
        gravity=declared.gravity,
        pulls=[one.name for one in declared.pulls],
        couplings=[one.follower for one in declared.couplings],
        omitted=omitted,
        motion=_motion(formula, system.a) if isinstance(formula, SymbolicEquations) else [],
        left_out="" if isinstance(formula, SymbolicEquations) else formula,
        home=home.tolist(),
        mass=Matrix(name="M", symbolic=None, numbers=mass.tolist()),
        force=Matrix(name="f", symbolic=None, numbers=force[:, None].tolist()),
    )


def _motion(
    equations: SymbolicEquations, a: tuple[sp.Symbol, ...]
) -> list[tuple[list[tuple[sp.Expr, sp.Expr]], list[tuple[sp.Expr, sp.Expr]]]]:
    """Return both sides of each equation."""
    return [
        (list(zip(row, a, strict=True)), [(term, sp.Integer(1)) for term in force])
        for row, force in zip(equations.mass, equations.force, strict=True)
    ]


def _body(body: RigidBody) -> ShownBody:
    carried = body.parent or "the world"
    moved = ", ".join(joint.name for joint in body.joints) or "welded"
    return ShownBody(name=body.name, parent=carried, by=moved, mass=float(body.mass))


def _joint(joint: Joint, body: RigidBody) -> ShownJoint:
    return ShownJoint(
        name=joint.name,
        kind=joint.kind,
        body=body.name,
        limits=joint.limits if joint.single else None,
        damping=powers(joint.damping),
        stiffness=powers(joint.stiffness),
        armature=float(joint.armature),
    )
