"""Random mechanisms as USD files in random representations, read back and run.

`python -m campaigns.usd_trees --count 500` compares each file's mass matrix, forces and limits, as
the reader has them, with the equations of `campaigns.mechanisms`, which share no code with it.
`--engine newton` also runs each file there, with SI units and without
the engine's own behaviours, and expects that it agrees.
The exit code is 1 if any is wrong, or the engine refuses all.

The representation is drawn: units, up axis, joint axis with local frames, order of the two bodies,
principal axes or a tensor, drives and damping, nested or flat bodies below a moved root, and one
file, a layer over wrong numbers, a reference, or an instance.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from campaigns.mechanisms.drawn import draw
from campaigns.mechanisms.dynamics import MechanismDynamics, rotation
from campaigns.mechanisms.mechanism import MJCF, MechanismLink, RandomMechanism
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_system
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.rotations import to_quaternion

Array = NDArray[np.float64]

DEGREE = np.pi / 180

LARGEST = 2e-5
"""Largest relative difference that floats explain, with a chain of bodies that multiplies it."""

APIS = '"PhysicsRigidBodyAPI", "PhysicsMassAPI", "NewtonMassAPI"'


class UsdWriter:
    """A mechanism as USD text, in a representation that a generator draws.

    With `is_based`, its joints to the world are joints to a body that is fixed there.
    """

    def __init__(
        self,
        mechanism: RandomMechanism,
        rng: np.random.Generator,
        is_si: bool,
        is_based: bool = False,
    ) -> None:
        self.mechanism, self.rng, self.is_si, self.is_based = mechanism, rng, is_si, is_based
        self.unit = 1.0 if is_si else float(rng.choice([1.0, 0.01, 0.1]))
        self.mass = 1.0 if is_si else float(rng.choice([1.0, 0.001, 1000.0]))
        self.is_nested = bool(rng.integers(2))
        rests = [one.rest for one in mechanism.links]  # Newton moves targets into the limits
        self.limits = np.sort(rng.uniform(-3, 3, (len(mechanism.links), 2)), axis=1)
        self.limits += np.array([[-1, 1]]) * (abs(np.array(rests))[:, None] + 3)
        poses = MechanismDynamics(mechanism, np.float64).poses(np.zeros((len(self.limits), 1)))
        self._turns, self._origins = poses.turns[..., 0], poses.origins[..., 0]
        self._root = self._turn(), rng.normal(size=3)

    def _rotation(self, turn: tuple[float, ...]) -> Array:
        return np.asarray(rotation(turn, self.mechanism.format == MJCF, np.float64))

    def _turn(self) -> Array:
        matrix, _ = np.linalg.qr(self.rng.normal(size=(3, 3)))
        return np.asarray(matrix * np.sign(np.linalg.det(matrix)))

    def head(self, body: str) -> str:
        """Return a layer with the units and a default prim."""
        up = self.rng.choice(["Y", "Z"])
        return (
            f'#usda 1.0\n(\n    defaultPrim = "r"\n    metersPerUnit = {self.unit}\n'
            f'    kilogramsPerUnit = {self.mass}\n    upAxis = "{up}"\n)\n{body}'
        )

    def scene(self) -> str:
        """Return the scene with gravity."""
        gravity = np.array(self.mechanism.gravity)
        size = float(np.linalg.norm(gravity))
        return (
            f'def PhysicsScene "scene"\n{{\n    float physics:gravityMagnitude = {size / self.unit}'
            f"\n    vector3f physics:gravityDirection = {_words(gravity / (size or 1.0))}\n}}\n"
        )

    def robot(self) -> str:
        """Return the prim of the robot."""
        tops = self._children(-1) if self.is_nested else range(len(self.limits))
        joints = map(self._joint, range(len(self.limits)))
        prims = "".join([*map(self._body, tops), self._base() if self.is_based else "", *joints])
        xform = self._xform(*self._root)
        schemas = '(prepend apiSchemas = ["PhysicsArticulationRootAPI"])'
        return f'def Xform "r" {schemas}\n{{\n{xform}{prims}}}\n'

    def _base(self) -> str:
        place = self._xform(self._root[0].T, -self._root[0].T @ self._root[1])
        numbers = "float physics:mass = 1\nfloat3 physics:diagonalInertia = (1, 1, 1)\n"
        fixed = 'def PhysicsFixedJoint "fixed"\n{\nrel physics:body1 = </r/base>\n}\n'
        return f'def Xform "base" (prepend apiSchemas = [{APIS}])\n{{\n{place}{numbers}}}\n{fixed}'

    def _xform(self, turn: Array, origin: Array) -> str:
        if self.rng.integers(2):
            matrix = np.eye(4)
            matrix[:3, :3], matrix[3, :3] = turn.T, origin / self.unit
            rows = f"({', '.join(map(_words, matrix))})"
            order = 'uniform token[] xformOpOrder = ["xformOp:transform"]\n'
            return f"matrix4d xformOp:transform = {rows}\n{order}"
        return (
            f"double3 xformOp:translate = {_words(origin / self.unit)}\n"
            f"quatd xformOp:orient = {_words(to_quaternion(turn))}\n"
            'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]\n'
        )

    def _children(self, parent: int) -> list[int]:
        return [i for i, one in enumerate(self.mechanism.links) if one.parent == parent]

    def _body(self, i: int) -> str:
        link, above = self.mechanism.links[i], self._root
        if self.is_nested and link.parent >= 0:
            above = self._turns[link.parent], self._origins[link.parent]
        place = above[0].T @ self._turns[i], above[0].T @ (self._origins[i] - above[1])
        inner = "".join(map(self._body, self._children(i))) if self.is_nested else ""
        return (
            f'def Xform "body{i + 1}" (prepend apiSchemas = [{APIS}])\n{{\n{self._xform(*place)}'
            f"float physics:mass = {link.mass / self.mass}\n"
            f"point3f physics:centerOfMass = {_words(np.array(link.centre) / self.unit)}\n"
            f"{self._inertia(link)}{inner}}}\n"
        )

    def _inertia(self, link: MechanismLink) -> str:
        xx, yy, zz, xy, xz, yz = (*link.inertia, 0.0, 0.0, 0.0)[:6]
        turn = self._rotation(link.inertial_turn)
        tensor = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        tensor = tensor / (self.mass * self.unit**2)
        if self.rng.integers(2):
            six = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            return f"double[] newton:inertia = [{_words(six)[1:-1]}]\n"
        moments, axes = np.linalg.eigh(tensor)
        axes = axes * np.sign(np.linalg.det(axes))
        return (
            f"float3 physics:diagonalInertia = {_words(moments)}\n"
            f"quatf physics:principalAxes = {_words(to_quaternion(axes))}\n"
        )

    def _path(self, i: int) -> str:
        names = [f"body{i + 1}"]
        while self.is_nested and (i := self.mechanism.links[i].parent) >= 0:
            names.insert(0, f"body{i + 1}")
        return f"</r/{'/'.join(names)}>"

    def _joint(self, i: int) -> str:
        link, flipped = self.mechanism.links[i], bool(not self.is_si and self.rng.integers(2))
        axis = int(self.rng.integers(3))
        outer, inner = ("1", "0") if flipped else ("0", "1")
        line = np.array(link.axis) / np.linalg.norm(link.axis) * (-1 if flipped else 1)
        frame = np.linalg.qr(np.column_stack([line, self.rng.normal(size=(3, 2))]))[0]
        frame = frame * np.sign(frame[:, 0] @ line)
        frame[:, 2] *= np.sign(np.linalg.det(frame))
        frame = np.roll(frame, axis, axis=1)
        turn, anchor = self._rotation(link.turn), np.array(link.anchor)
        origin = np.array(link.position) + turn @ anchor
        places = (outer, turn @ frame, origin), (inner, frame, anchor)
        ends = [f"rel physics:body{inner} = {self._path(i)}\n"]
        above = self._path(link.parent) if link.parent >= 0 else "</r/base>" * self.is_based
        ends += [f"rel physics:body{outer} = {above}\n"] if above else []
        for end, matrix, origin in places:
            ends.append(f"point3f physics:localPos{end} = {_words(origin / self.unit)}\n")
            ends.append(f"quatf physics:localRot{end} = {_words(to_quaternion(matrix))}\n")
        kind, drive = ("Revolute", "angular") if link.hinge else ("Prismatic", "linear")
        return (
            f'def Physics{kind}Joint "q{i + 1}" (prepend apiSchemas = ["PhysicsDriveAPI:{drive}", '
            f'"NewtonJointAPI"])\n{{\nuniform token physics:axis = "{"XYZ"[axis]}"\n'
            f"{''.join(ends)}{self._numbers(i, drive)}}}\n"
        )

    def _numbers(self, i: int, drive: str) -> str:
        link = self.mechanism.links[i]
        inertia = self.mass * (self.unit**2 if link.hinge else 1)
        per = DEGREE if link.hinge else self.unit
        gain = inertia / (DEGREE if link.hinge else 1)
        damping = f"drive:{drive}:physics:damping" if self.rng.integers(2) else "newton:damping"
        lower, upper = self.limits[i] / per
        return (
            f"float {damping} = {link.damping / gain}\n"
            f"float newton:armature = {link.armature / inertia}\n"
            f"float drive:{drive}:physics:stiffness = {link.stiffness / gain}\n"
            f"float drive:{drive}:physics:targetPosition = {link.rest / per}\n"
            f"float physics:lowerLimit = {lower}\nfloat physics:upperLimit = {upper}\n"
        )

    def write(self, folder: Path) -> Path:
        """Write one file, or two, and return the root layer."""
        scene, robot, path = self.scene(), self.robot(), folder / "robot.usda"
        styles = "file", "over", "reference", "instance"
        style = styles[int(self.rng.integers(3 if self.is_si else 4))]
        inner = self.head(robot)
        if style == "over":
            wrong = robot.replace("float physics:mass = ", "float physics:mass = 9")
            (folder / "inner.usda").write_text(self.head(wrong))
            head = inner.partition(")\n")[0] + "    subLayers = [@inner.usda@]\n)\n"
            path.write_text(head + scene + robot)
        elif style == "file":
            path.write_text(inner + scene)
        else:
            (folder / "inner.usda").write_text(inner)
            flag = "\n    instanceable = true" if style == "instance" else ""
            body = f'def Xform "r" (\n    prepend references = @inner.usda@{flag}\n)\n{{\n}}\n'
            path.write_text(self.head(body + scene))
        return path


def _words(values: Sequence[float] | Array) -> str:
    return f"({', '.join(repr(float(one)) for one in values)})"


def problems(mechanism: RandomMechanism, writer: UsdWriter, path: Path) -> Iterator[str]:
    """Yield what differs between the file as it is read and the mechanism."""
    robot = read_robot(path)
    if robot.tree is None:
        yield f"no tree: {[one.sentence for one in robot.obstacles]}"
        return
    names, count = [one.name for one in robot.tree.links], len(mechanism.links)
    order = [names.index(f"q{i + 1}") for i in range(count)]
    rng = np.random.default_rng(0)
    q, v = rng.uniform(-1.5, 1.5, (4, count)), rng.uniform(-2, 2, (4, count))
    back = np.argsort(order)
    mass, force = TreeEquations(robot_system(robot)).mechanics(
        q[:, back], v[:, back], np.zeros_like(q)
    )
    truth = MechanismDynamics(mechanism, np.float64)
    wanted = truth.mass_matrix(q)
    inputs = np.linalg.solve(wanted, force[:, order][..., None])[..., 0]
    scale = np.sqrt(np.einsum("bii,bjj->bij", wanted, wanted))
    off = float(np.max(np.abs(mass[:, order][:, :, order] - wanted) / scale))
    expected = truth.acceleration(np.zeros(4), q.T, v.T).T
    size = np.max(np.abs(expected), initial=1e-9)
    moved = float(np.max(np.abs(inputs - expected)) / size)
    for what, share in (("mass matrix", off), ("accelerations", moved)):
        if not share <= LARGEST:
            yield f"{what} off by {share:.1e}"
    limits = np.array([robot.limits[0], robot.limits[1]]).T[order]
    if not np.allclose(limits, writer.limits, rtol=1e-5, atol=1e-6):
        yield f"limits {limits.tolist()} instead of {writer.limits.tolist()}"


def main(given: Sequence[str] | None = None) -> int:
    """Compare random files, and print those that are wrong."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.usd_trees", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="index of the first file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engine", default="", help="engine that runs each file")
    parser.add_argument("--keep", type=Path, help="folder for the files that are wrong")
    chosen, wrong, refused = parser.parse_args(given), 0, 0
    for index in range(chosen.first, chosen.first + chosen.count):
        drawn = draw(chosen.seed, index, 7, "mujoco")
        links = tuple(replace(one, reference=0.0) for one in drawn.links)
        mechanism = replace(drawn, links=links, drives=())
        rng = np.random.default_rng((chosen.seed, index, 58))
        is_based = chosen.engine == "physx"  # a joint to the world leaves its base free there
        writer = UsdWriter(mechanism, rng, is_si=bool(chosen.engine), is_based=is_based)
        with tempfile.TemporaryDirectory() as name:
            path = writer.write(Path(name))
            errors = list(problems(mechanism, writer, path))
            if chosen.engine and not errors:
                task = model_task(prepare_tree(path), chosen.engine)
                case = run_case(task)
                if case.outcome == "DIFFERS":
                    settings = task.load()[0].corrective_settings.values()
                    off = {key: value for one in settings for key, value in one.items()}
                    case = run_case(task.with_settings(**off))
                if case.outcome == "REFUSED":
                    refused += 1
                    print(f"{index}: {case.reason}", flush=True)
                is_right = case.outcome in ("AGREES", "REFUSED")
                errors += [] if is_right else [f"{case.outcome}: {case.reason}"]
            if errors and chosen.keep:
                shutil.copytree(name, chosen.keep / str(index), dirs_exist_ok=True)
        wrong += bool(errors)
        if errors:
            print(f"{index}: {'; '.join(errors)}", flush=True)
    print(f"{chosen.count} files, {wrong} wrong, {refused} refused by the engine")
    return int(wrong > 0 or refused == chosen.count)


if __name__ == "__main__":
    sys.exit(main())
