"""Forces of trees by virtual power, from their poses alone, differentiated by CasADi."""

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
"""Axes of each link in the world as columns, (3, 3), and its origin, (3,)."""


class Rate(Protocol):
    """Rates of a matrix that depends on the positions, under true or virtual velocities."""

    def __call__(self, quantity: Any, *, true: bool = True) -> Any:
        """Return the matrix of the rates."""


def by_virtual_power(robot: Tree, q: Array, v: Array, power: Callable[[Poses, Rate], Any]) -> Array:
    """Return generalized forces: the gradient of their power in the virtual velocities, (nv,)."""
    position, rate = casadi.SX.sym("q", robot.nq), casadi.SX.sym("v", robot.nv)
    virtual = casadi.SX.sym("w", robot.nv)
    columns = np.array([[position[i]] for i in range(robot.nq)], dtype=object)
    recursion = Recursion(robot, SYMBOLS)
    poses: Poses = []
    for pose in recursion.poses(columns):
        turn = casadi.SX(3, 3)
        for i, j in itertools.product(range(3), repeat=2):
            turn[i, j] = pose.rotation[i, j, 0]
        poses.append((turn, casadi.vertcat(*pose.origin[:, 0])))

    def moved(quantity: Any, along: Any) -> Any:
        given = np.array([[along[i]] for i in range(robot.nv)], dtype=object)
        slopes = casadi.vertcat(*recursion.rates(columns, given)[:, 0])
        flat = casadi.reshape(quantity, quantity.numel(), 1)
        return casadi.reshape(casadi.jtimes(flat, position, slopes), *quantity.shape)

    def rate_of(quantity: Any, *, true: bool = True) -> Any:
        return moved(quantity, rate if true else virtual)

    whole = power(poses, rate_of)
    function = casadi.Function("forces", [position, rate], [casadi.gradient(whole, virtual)])
    return np.array(function(q, v))[:, 0]


def spin(turn: Any, rate: Any) -> Any:
    """Return the angular velocity in the turning frame, from its rotation and the rate of it."""
    skew = casadi.mtimes(turn.T, rate)
    return casadi.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
