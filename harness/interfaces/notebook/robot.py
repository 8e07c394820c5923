"""`load`: the bodies and joints of a robot's file or of a folder, with their matrices."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from physics_crosscheck.harness.modelfiles.choice import named_model
from physics_crosscheck.harness.modelfiles.folders import FORMATS
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs, robot_system
from physics_crosscheck.harness.planning.options import check_text
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem, TreeSystem
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import NO_INERTIA, Place, SpatialInertia
from .markup import block, line, table
from .subject import Name, NotebookSubject, system_named
from .trajectory import MotionError


@dataclass(frozen=True, kw_only=True)
class RobotJoint:
    """A joint of a robot.

    Attributes:
        name: also the name of its coordinate.
        kind: "hinge", "slide", "ball" or "free".
        link: the link that it moves.
        parent: the link that carries it; None for the world.
        limits: lowest and highest position, rad or m; None without limits.
        damping: N s/m or N m s/rad; several values are the coefficients of powers.
    """

    name: str
    kind: str
    link: str
    parent: str | None
    limits: tuple[float, float] | None
    damping: float | tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotModel:
    """A robot as its file states it, without an engine.

    Positions `q` are arrays (n,) in the order of `coordinates`, or values by name; missing ones
    are zero.

    Attributes:
        file: the file or the folder.
        bodies: links with their numbers, parents first.
        system: the coordinates and the tree of its equations.
    """

    file: Path
    bodies: tuple[RigidBody, ...]
    system: TreeSystem

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.system.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the independent joint coordinates, (n,)."""
        return tuple(coordinate.name for coordinate in self.system.coordinates)

    @property
    def joints(self) -> tuple[RobotJoint, ...]:
        """Joints that move, in the order of the file's tree."""
        return tuple(
            RobotJoint(
                name=joint.name,
                kind=joint.kind,
                link=body.name,
                parent=body.parent,
                limits=joint.limits,
                damping=joint.damping,
            )
            for body in self.bodies
            for joint in body.joints
        )

    @property
    def masses(self) -> Mapping[str, float]:
        """Mass of each link, kg."""
        return {body.name: body.mass for body in self.bodies}

    @property
    def mass(self) -> float:
        """Mass of all links, kg."""
        return sum(self.masses.values())

    @property
    def gravity(self) -> Array:
        """Acceleration of gravity, m/s^2, (3,)."""
        return np.array(self.system.tree.gravity, dtype=float)

    @cached_property
    def inertia(self) -> SpatialInertia:
        """Mass, center of mass and inertia about it of all links, with all joints at zero.

        In the axes of the world: kg, m, (3,), and kg m^2, (3, 3).
        """
        tree = self.system.tree
        poses = Recursion(tree).poses(tree.zero[:, None]) if tree.links else []
        total = NO_INERTIA
        for body in self.bodies:
            index, frame = tree.frames[body.name]
            if index >= 0:
                pose = poses[index]
                outer = Place(np.asarray(pose.rotation)[..., 0], np.asarray(pose.origin)[..., 0])
                frame = outer.compose(frame)
            total = total.combined(body.spatial_inertia.in_frame(frame))
        return total

    def mass_matrix(self, q: ArrayLike | Mapping[str, float] = ()) -> Array:
        """Return M(q), (n, n)."""
        matrix: Array = self._equations.inertia(self._positions(q)[None])[0]
        return matrix

    def gravity_forces(self, q: ArrayLike | Mapping[str, float] = ()) -> Array:
        """Return the joint forces that hold the robot at rest, N or N m, (n,).

        They balance gravity and the springs of the file; no actuator acts.
        """
        positions = self._positions(q)
        rest = np.zeros_like(positions)
        forces: Array = self._equations.forces_for(positions, rest, rest)
        return forces

    @cached_property
    def _equations(self) -> TreeEquations:
        return TreeEquations(self.system)

    def _positions(self, given: ArrayLike | Mapping[str, float]) -> Array:
        names = self.coordinates
        if not isinstance(given, Mapping):
            q = np.array(given, dtype=float)
            if q.size and q.shape != (len(names),):
                raise MotionError(f"{len(names)} positions expected, got shape {q.shape}")
            return q if q.size else np.zeros(len(names))
        if unknown := [name for name in given if name not in names]:
            raise MotionError(f"no coordinate {unknown[0]!r}; there are {', '.join(names)}")
        return np.array([float(given.get(name, 0.0)) for name in names])

    def __repr__(self) -> str:
        joints, links = counted(len(self.joints), "joint"), counted(len(self.bodies), "link")
        return f"<{self.name} of {self.file}: {joints}, {links}, {self.mass:.4g} kg>"

    def _repr_html_(self) -> str:
        rows = [
            [escape(j.name), j.kind, escape(j.link), f"{self.masses[j.link]:.4g}", _range(j)]
            for j in self.joints
        ]
        heads = ("joint", "kind", "link", "mass (kg)", "limits")
        return block(line(repr(self), strong=True), table(heads, rows, text_columns=3))


def _range(joint: RobotJoint) -> str:
    return "" if joint.limits is None else f"{joint.limits[0]:.3g} to {joint.limits[1]:.3g}"


def _subject(name: Name) -> NotebookSubject:
    """Return the robot that a name refers to; a file in a system folder stands for itself."""
    check_text(name, "robot", path=True)
    model = named_model(str(name))
    if model is None or Path(model.model).suffix not in FORMATS:
        return system_named(name)
    return NotebookSubject(folder=None, file=model.folder / model.model)


def load(robot: Name, *, floating: bool | None = None) -> RobotModel:
    """Read a robot's file, or a folder that declares bodies, without an engine's motion.

    Args:
        robot: a URDF, SDFormat, MJCF or xacro file, a name such as `robot:panda`, or a folder.
        floating: whether the root link of a URDF moves freely.

    Raises:
        RobotError: for a file without equations, with its lines.
        MotionError, FolderError: if there is no such robot, or a folder declares energies.
    """
    subject = _subject(robot)
    if subject.file is not None:
        read = read_as_it_runs(subject.file, {"floating": floating, "actuators": False})
        system = robot_system(read)
        assert read.body_model is not None  # it has a tree
        return RobotModel(file=subject.file, bodies=read.body_model.bodies, system=system)
    declared = load_declaration(subject.place)
    if not isinstance(declared, MultibodySystem):
        raise MotionError(
            f"{subject.place} declares energies, not bodies; `solve` gives its motions"
        )
    return RobotModel(
        file=subject.place, bodies=tuple(declared.bodies), system=declared.tree_system
    )
