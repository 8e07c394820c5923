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
from physics_crosscheck.reference.mechanism.tree import WORLD, TreeError
from .tree import KINDS, compiled_tree

IDENTITY_TURN = np.array([1.0, 0.0, 0.0, 0.0])


def law_model(compiled: CompiledTree) -> LawModel | None:
    """Return the laws of a compiled file on its own bodies; None without joints or laws.

    Raises:
        TreeError: naming the element that the equations of the bodies do not cover.
    """
    joints = [joint for body in compiled.bodies for joint in body.joints]
    if compiled.laws is None or not joints:
        return None
    if unknown := [joint.kind for joint in joints if joint.kind not in KINDS]:
        raise TreeError(f"a joint of kind {unknown[0]}")
    passive = tuple(pull for pull in compiled.pulls if pull.control < 0)
    paths = tuple(replace(path, name=f"path {i}") for i, path in enumerate(compiled.paths))
    tree = compiled_tree(replace(compiled, pulls=(*passive, *paths), couplings=()), ())
    count = len(tree.pulls) - len(paths)
    bodies = list(tree.frames.values())
    return LawModel(
        laws=compiled.laws,
        tree=LawTree(
            tree=replace(tree, pulls=tree.pulls[:count]),
            paths=tree.pulls[count:],
            bodies=((WORLD, IDENTITY), *bodies),
            masses=np.array([0.0, *(body.mass for body in compiled.bodies)]),
            centers=np.array([np.zeros(3), *(body.centre for body in compiled.bodies)]),
        ),
        home=_home(compiled),
    )


def _home(compiled: CompiledTree) -> Array:
    """Return the coordinates of the drawn configuration, (nv,)."""
    parts: list[Array] = []
    for body in compiled.bodies:
        for joint in body.joints:
            if joint.kind == "free":
                turn = minimal_coordinates(np.array(body.turn), IDENTITY_TURN)
                parts += [turn, np.array(body.position)]
            else:
                parts.append(np.zeros(3) if joint.kind == "ball" else np.array([joint.zero]))
    return np.concatenate(parts)
