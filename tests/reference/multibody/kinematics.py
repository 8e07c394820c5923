"""Points and axes of trees by their poses alone, differentiated by CasADi: a witness of forces."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, Protocol

import casadi
import numpy as np

from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import objects
from physics_crosscheck.reference.mechanism.tree import Tree

casadi.GlobalOptions.setNumpyMode(1)  # arrays of symbols are NumPy's; else it warns

SYMBOLS = objects(casadi.sin, casadi.cos, casadi.SX)

Poses = list[tuple[Any, Any]]
"""Of each link: its axes in the world as columns, (3, 3), and its origin, (3,)."""


class Rate(Protocol):
    """Of any matrix of the positions: its rate under the true velocities, or virtual ones."""

    def __call__(self, what: Any, *, true: bool = True) -> Any:
        """The matrix of the rates."""


def by_virtual_power(one: Tree, q: Array, v: Array, power: Callable[[Poses, Rate], Any]) -> Array:
    """What forces do on a tree's velocities: the gradient of their power in these, (nv,).

    Args:
        one: the tree.
        q, v: its state.
        power: of the links' poses, and of what tells the true rate and the virtual one of any
            matrix of them; forces depend on true rates alone.
    """
    at, rate = casadi.SX.sym("q", one.nq), casadi.SX.sym("v", one.nv)
    virtual = casadi.SX.sym("w", one.nv)
    columns = np.array([[at[i]] for i in range(one.nq)], dtype=object)
    recursion = Recursion(one, SYMBOLS)
    poses: Poses = []
    for pose in recursion.poses(columns):
        turn = casadi.SX(3, 3)
        for i, j in itertools.product(range(3), repeat=2):
            turn[i, j] = pose.rotation[i, j, 0]
        poses.append((turn, casadi.vertcat(*pose.origin[:, 0])))

    def moved(what: Any, along: Any) -> Any:
        given = np.array([[along[i]] for i in range(one.nv)], dtype=object)
        slopes = casadi.vertcat(*recursion.rates(columns, given)[:, 0])
        flat = casadi.reshape(what, what.numel(), 1)
        return casadi.reshape(casadi.jtimes(flat, at, slopes), *what.shape)

    def of(what: Any, *, true: bool = True) -> Any:
        return moved(what, rate if true else virtual)

    whole = power(poses, of)
    function = casadi.Function("forces", [at, rate], [casadi.gradient(whole, virtual)])
    return np.array(function(q, v))[:, 0]


def spin(turn: Any, rate: Any) -> Any:
    """Angular velocity in the turning frame, of its rotation and the rate of that."""
    skew = casadi.mtimes(turn.T, rate)
    return casadi.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
