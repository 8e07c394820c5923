"""Laws of a compiled file: bodies without couplings, and the numbers of all other forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.reference.laws.mechanics import LawTree
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import minimal_coordinates
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY
from physics_crosscheck.reference.mechanism.tree import WORLD
from .read import compiled_tree

NO_TURN = 1.0, 0.0, 0.0, 0.0


def law_model(compiled: CompiledTree) -> LawModel | None:
    """Return the laws of a compiled file on its own bodies; None without joints or laws.

    Raises:
        TreeError: naming the element that the equations of the bodies do not cover.
    """
    if compiled.laws is None or not compiled.joints:
        return None
    paths = tuple(replace(path, name=f"path {i}") for i, path in enumerate(compiled.paths))
    tree = compiled_tree(replace(compiled, pulls=(*compiled.passive, *paths), couplings=()), ())
    count = len(tree.pulls) - len(paths)
    bodies = list(tree.frames.values())
    return LawModel(
        laws=compiled.laws,
        tree=LawTree(
            tree=replace(tree, pulls=tree.pulls[:count]),
            paths=tree.pulls[count:],
            bodies=((WORLD, IDENTITY), *bodies),
            masses=np.array([0.0, *(body.mass for body in compiled.bodies)]),
            centers=np.array([np.zeros(3), *(body.center for body in compiled.bodies)]),
        ),
        home=_home(compiled),
    )


def _home(compiled: CompiledTree) -> Array:
    """Return the coordinates of the drawn configuration, (nv,)."""
    parts: list[Array] = []
    for body in compiled.bodies:
        for joint in body.joints:
            if joint.kind == "free":
                turn = minimal_coordinates(np.array(body.quaternion or NO_TURN), np.array(NO_TURN))
                parts += [turn, np.array(body.position)]
            else:
                parts.append(np.zeros(3) if joint.kind == "ball" else np.array([joint.zero]))
    return np.concatenate(parts)
