"""Mass matrices of robot files against independent ones.

`python -m campaigns.real_models.masses FILE...` prints a line per file: the largest difference of
the reference's mass matrix from another one, relative to its largest element, at random positions.
For a URDF the other one is computed here, from the file's text, as a sum over all links of the
squares of their Jacobians. For an MJCF it is that of MuJoCo.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.expanded import XACRO, expand
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.rotations import from_quaternion
from physics_crosscheck.reference.mechanism.tree import Tree

Array = NDArray[np.float64]

POSITIONS = 3
"""Number of random positions."""


def _numbers(element: ElementTree.Element | None, key: str, default: str) -> Array:
    text = default if element is None else element.get(key, default)
    return np.array(text.split(), dtype=float)


def _rotation(axis: Array, angle: float) -> Array:
    """Return a rotation about a unit vector, by Rodrigues' formula."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew)


def _origin(element: ElementTree.Element | None) -> tuple[Array, Array]:
    roll, pitch, yaw = _numbers(element, "rpy", "0 0 0")
    x, y, z = np.eye(3)
    turn = _rotation(z, yaw) @ _rotation(y, pitch) @ _rotation(x, roll)
    return turn, _numbers(element, "xyz", "0 0 0")


def urdf_mass(file: Path, q: Mapping[str, float], root: Array) -> Array:
    """Return the mass matrix of a URDF, from its text.

    Args:
        file: the URDF.
        q: positions by the joints' names, which order the matrix; others are fixed.
        root: position and unit quaternion of a free root, whose velocities are the first ones,
            angular and linear along its own axes; empty for a fixed root.
    """
    robot = ElementTree.parse(file).getroot()
    joints = {one.find("child").get("link"): one for one in robot.findall("joint")}  # type: ignore[union-attr]
    order = [""] * (6 if len(root) else 0) + list(q)
    mass = np.zeros((len(order), len(order)))

    def place(link: str) -> tuple[Array, Array, list[tuple[int, bool, Array, Array]]]:
        """Return rotation and origin of a link, and the joints that carry it, in the world."""
        joint = joints.get(link)
        if joint is None and len(root):
            turn, origin = from_quaternion(root[3:]), root[:3]
            return turn, origin, [(i, i >= 3, turn[:, i % 3], origin) for i in range(6)]
        if joint is None:
            return np.eye(3), np.zeros(3), []
        turn, origin, carried = place(joint.find("parent").get("link", ""))  # type: ignore[union-attr]
        inner, offset = _origin(joint.find("origin"))
        turn, origin = turn @ inner, origin + turn @ offset
        name = joint.get("name", "")
        if name not in q:
            return turn, origin, carried
        axis = _numbers(joint.find("axis"), "xyz", "1 0 0")
        axis /= np.linalg.norm(axis)
        slides = joint.get("type") == "prismatic"
        carried = [*carried, (order.index(name), slides, turn @ axis, origin)]
        if slides:
            return turn, origin + turn @ axis * q[name], carried
        return turn @ _rotation(axis, q[name]), origin, carried

    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        turn, origin, carried = place(link.get("name", ""))
        inner, offset = _origin(inertial.find("origin"))
        about, center = turn @ inner, origin + turn @ offset
        keys = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")
        inertia = inertial.find("inertia")
        tensor = np.array([float(_numbers(inertia, key, "0")[0]) for key in keys]).reshape(3, 3)
        linear, angular = np.zeros((2, 3, len(order)))
        for i, slides, axis, anchor in carried:
            linear[:, i] = axis if slides else np.cross(axis, center - anchor)
            angular[:, i] = 0.0 if slides else axis
        (weight,) = _numbers(inertial.find("mass"), "value", "0")
        mass += weight * linear.T @ linear + angular.T @ (about @ tensor @ about.T) @ angular
    return mass


def mjcf_mass(file: Path, tree: Tree, q: Array) -> Array:
    """Return MuJoCo's mass matrix of an MJCF at its positions, along the tree's velocities.

    Those of a free joint are angular and linear, along its own axes. MuJoCo's are linear along the
    world's, and angular.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(file))
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    along = np.eye(model.nv)
    for link, positions, here in zip(tree.links, tree.positions, tree.velocities, strict=True):
        if link.kind == "free":
            along[here, here] = np.roll(np.eye(6), 3, axis=0)
            turn = from_quaternion(q[positions][3:])
            along[here.start : here.start + 3, here.start + 3 : here.stop] = turn
    return np.asarray(along.T @ mass @ along)


def difference(file: Path) -> float:
    """Return the largest difference of the mass matrices, relative to the largest element.

    Raises:
        ValueError: for a file without a tree.
    """
    file = expand(file) if file.suffix == XACRO else file
    tree = read_robot(file).tree
    if tree is None:
        raise ValueError(f"{file}: no tree")
    dynamics, rng, largest = Dynamics(tree), np.random.default_rng(0), 0.0
    for _ in range(POSITIONS):
        q = rng.normal(size=tree.nq)
        for link, here in zip(tree.links, tree.positions, strict=True):
            if link.kind in ("free", "ball"):  # a unit quaternion, last
                turn = q[here][-4:]
                q[here.stop - 4 : here.stop] = turn / np.linalg.norm(turn)
        if file.suffix == ".urdf":
            root = q[:7] if tree.links[0].kind == "free" else q[:0]
            names = [link.name for link in tree.links if link.kind != "free"]
            other = urdf_mass(file, dict(zip(names, q[len(root) :].tolist(), strict=True)), root)
        else:
            other = mjcf_mass(file, tree, q)
        ours = np.array(dynamics.mass(q), dtype=float)
        largest = max(largest, float(np.abs(ours - other).max() / np.abs(other).max()))
    return largest


def main() -> None:
    """Print a line per file."""
    for name in sys.argv[1:]:
        try:
            print(f"{difference(Path(name)):.1e} {name}", flush=True)
        except Exception as error:  # any file may be named
            print(f"no mass matrix: {name}: {type(error).__name__}: {error}", flush=True)


if __name__ == "__main__":
    main()
