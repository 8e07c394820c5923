"""Confirm the gallery's cells by other means: the engine itself, and numpy on the file's text.

`python -m gallery.confirm STORE CLONES` prints a line for each fault and each cell that does not
follow its URDF, and writes what it confirms to `confirmed.toml`, where rows by hand stay. Each
engine loads the file by its own API, without the adapters of this program; shapes are left out.
Pinocchio's cells are printed in any case: they show how small the difference is where an engine
follows the file.

- *mass*: the engine's mass matrix against the one of `campaigns.real_models.masses`.
- *links*: masses and traces of inertias that the engine holds, against those of the file.
- *load*: the engine's own error.
- *step*: the largest product of time step and rate of a damper, from that mass matrix. An explicit
  step grows above 2.
- *text*: mass and principal moments of the link, from the file.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from campaigns.real_models.masses import Array, urdf_mass
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import read_results
from .__main__ import kept
from .robots import robot_files
from .site import CONFIRMED, Cell, Entry, confirmed

HEAD = "# Means that confirm cells which do not follow their file, by engine and version.\n"
MOVING = ("revolute", "continuous", "prismatic")
PRELUDE = "import json, sys\nf, q = sys.argv[1], json.loads(sys.argv[2])\n"
CONTROL = "pinocchio"
"""Engine whose cells are confirmed also where they follow the file."""

STEP = 0.002
"""Time step of robot files that state none, s."""

_PAIRS = "pairs = [(n, i) for n, i in pairs if n in q]\nnames = [n for n, _ in pairs]\n"
_MASS = _PAIRS + (
    "print('RESULT', json.dumps([names, [[float(M[i, j]) for _, j in pairs] for _, i in pairs]]))"
)
_LINKS = "print('RESULT', json.dumps([list(one) for one in links]))"

ASK = {
    "mujoco": "import mujoco as e, numpy\nm = e.MjModel.from_xml_path(f)\nd = e.MjData(m)\n"
    "pairs = [(m.joint(i).name, int(m.jnt_dofadr[i])) for i in range(m.njnt)]\n"
    "for n, i in q.items(): d.joint(n).qpos[:] = i\n"
    "e.mj_forward(m, d)\nM = numpy.zeros((m.nv, m.nv))\ne.mj_fullM(m, d, M)\n" + _MASS,
    "pinocchio": "import pinocchio as e, math\nm = e.buildModelFromUrdf(f)\np = e.neutral(m)\n"
    "pairs = [(n, m.idx_vs[m.getJointId(n)]) for n in q]\n"
    "for n, x in q.items():\n"
    "    i, k = m.idx_qs[m.getJointId(n)], m.nqs[m.getJointId(n)]\n"
    "    p[i:i + k] = [x] if k == 1 else [math.cos(x), math.sin(x)]\n"
    "M = e.crba(m, m.createData(), p)\nn = __import__('numpy')\nM = n.triu(M) + n.triu(M, 1).T\n"
    + _MASS,
    "drake": "from pydrake.all import MultibodyPlant, Parser\nm = MultibodyPlant(0.0)\n"
    "(one,) = Parser(m).AddModels(f)\nroot = m.GetBodyIndices(one)[0]\n"
    "if not any(m.get_joint(j).parent_body().index() == 0 for j in m.GetJointIndices()):\n"
    "    m.WeldFrames(m.world_frame(), m.get_body(root).body_frame())\nm.Finalize()\n"
    "c = m.CreateDefaultContext()\n"
    "for n, x in q.items(): m.SetPositions(c, (p := m.GetPositions(c), p.__setitem__("
    "m.GetJointByName(n).position_start(), x))[0])\n"
    "M = m.CalcMassMatrix(c)\npairs = [(n, m.GetJointByName(n).velocity_start()) for n in q]\n"
    + _MASS,
    "dart": "import dartpy as e\no = e.utils.DartLoaderOptions()\n"
    "o.mDefaultRootJointType = e.utils.DartLoaderRootJointType.FIXED\n"
    "l = e.utils.DartLoader()\nl.setOptions(o)\nm = l.parseSkeleton(f)\n"
    "for n, x in q.items(): m.getDof(n).setPosition(x)\nM = m.getMassMatrix()\n"
    "pairs = [(n, m.getDof(n).getIndexInSkeleton()) for n in q]\n" + _MASS,
    "idyntree": "import idyntree.bindings as e, numpy\nl = e.ModelLoader()\n"
    "assert l.loadModelFromFile(f)\nm = l.model()\nk = e.KinDynComputations()\n"
    "k.loadRobotModel(m)\n"
    "pairs = [(n, m.getJoint(m.getJointIndex(n)).getDOFsOffset()) for n in q]\n"
    "s = numpy.zeros(m.getNrOfDOFs())\nfor n, i in pairs: s[i] = q[n]\n"
    "k.setRobotState(s, numpy.zeros(len(s)), numpy.array([0, 0, -9.81]))\n"
    "M = e.MatrixDynSize(len(s) + 6, len(s) + 6)\nk.getFreeFloatingMassMatrix(M)\n"
    "M = M.toNumPy()[6:, 6:]\n" + _MASS,
    "pybullet": "import pybullet as e, numpy\ne.connect(e.DIRECT)\n"
    "b = e.loadURDF(f, useFixedBase=True, flags=e.URDF_USE_INERTIA_FROM_FILE)\n"
    "js = [e.getJointInfo(b, i) for i in range(e.getNumJoints(b))]\n"
    "js = [j[1].decode() for j in js if j[2] != e.JOINT_FIXED]\n"
    "M = numpy.array(e.calculateMassMatrix(b, [q.get(n, 0.0) for n in js]))\n"
    "pairs = [(n, i) for i, n in enumerate(js)]\n" + _MASS,
    "sapien": "import sapien as e\ns = e.Scene([e.physx.PhysxCpuSystem()])\n"
    "l = s.create_urdf_loader()\nl.fix_root_link = True\nlinks = [(k.name, float(k.mass), "
    "float(sum(k.inertia))) for k in l.load(f).links]\n" + _LINKS,
    "newton": "import newton as e\nb = e.ModelBuilder()\nb.add_urdf(f, floating=False)\n"
    "m = b.finalize(device='cpu')\nlinks = [(n.split('/')[-1], float(x), float(y.trace())) for "
    "n, x, y in zip(m.body_label, m.body_mass.numpy(), m.body_inertia.numpy())]\n" + _LINKS,
}  # fmt: skip
"""For each engine, code that loads the file `f` at the positions `q`, and prints what it holds."""


def ask(engine: str, text: str, q: dict[str, float]) -> Any:
    """Return what an engine holds of a URDF; text if it raises."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "robot.urdf")
        file.write_text(text)
        command = [sys.executable, "-c", PRELUDE + ASK[engine], str(file), json.dumps(q)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    answers = re.findall(r"(?m)RESULT (.*)$", done.stdout)
    printed = (done.stderr + done.stdout).splitlines()
    lines = [one for one in printed if one.strip() and not one.startswith("pybullet build")]
    errors = [one for one in lines if "rror:" in one]
    return json.loads(answers[0]) if answers else (errors or lines or ["no answer"])[0]


def moments(link: ElementTree.Element) -> tuple[float, Array]:
    """Return mass and principal moments of a link, kg and kg m^2; (3,)."""
    values = {key: float(v) for one in link.iterfind("inertial/*") for key, v in one.items()
              if key in ("value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")}  # fmt: skip
    keys = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")
    tensor = np.array([values.get(key, 0.0) for key in keys]).reshape(3, 3)
    return values.get("value", 0.0), np.linalg.eigvalsh(tensor)


def answer(engine: str, root: ElementTree.Element, path: Path) -> tuple[str, str]:
    """Return the means and what an engine holds of a robot, against its text."""
    names = [one.get("name", "") for one in root.iter("joint") if one.get("type") in MOVING]
    q = dict(zip(names, np.random.default_rng(0).uniform(-0.5, 0.5, len(names)), strict=True))
    held = ask(engine, ElementTree.tostring(root, "unicode"), q)
    if isinstance(held, str):
        return "load", f"the engine's own error: {held[:200]}"
    if engine in ("sapien", "newton"):
        stated = {one.get("name"): moments(one) for one in root.iter("link")}
        other = [
            f"{name} {mass:.3g} kg, {trace:.3g} kg m^2; the file {stated[name][0]:.3g} kg,"
            f" {stated[name][1].sum():.3g} kg m^2"
            for name, mass, trace in held
            if name in stated and not np.allclose([mass, trace], [stated[name][0],
               stated[name][1].sum()], rtol=1e-5, atol=1e-12)
        ]  # fmt: skip
        return "links" if other else "", f"the engine's own links: {'; '.join(other[:2])}"
    order, matrix = held
    own = urdf_mass(path, {name: q[name] for name in order}, np.array([]))
    worst = np.abs(np.array(matrix) - own).max(axis=1) / np.abs(own).max(axis=1)
    means = "mass" if worst.max() > 1e-9 else ""
    row = f"row of {order[int(worst.argmax())]}"
    return means, f"the engine's mass matrix, off by {worst.max():.1e} of numpy's in the {row}"


def rate(root: ElementTree.Element, path: Path) -> str:
    """Return the largest product of the time step and the rate of a damper, and its joint."""
    joints = {str(one.get("name")): one for one in root.iter("joint") if one.get("type") in MOVING}
    largest, joint = 0.0, ""
    for seed in range(5):
        draw = np.random.default_rng(seed).uniform(-1, 1, len(joints))
        mass = urdf_mass(path, dict(zip(joints, draw.tolist(), strict=True)), np.array([]))
        dampers = (one.find("dynamics") for one in joints.values())
        damping = [0.0 if one is None else float(one.get("damping", 0)) for one in dampers]
        rates, vectors = np.linalg.eig(np.linalg.solve(mass, np.diag(damping)))
        if (here := STEP * float(rates.real.max())) > largest:
            vector = np.abs(vectors[:, int(rates.real.argmax())])
            largest, joint = here, list(joints)[int(vector.argmax())]
    return f"step times rate of the damper by numpy: {largest:.3g} at {joint}; 2 is the limit"


def confirm(entry: Entry, path: Path) -> Iterator[tuple[Cell | None, str, str]]:
    """Yield each cell, or None for a fault of the file, with means and numbers."""
    root = ElementTree.parse(path).getroot()
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    for message in entry.faults:
        for link in root.iter("link"):
            if f"'{link.get('name')}'" in message:
                mass, own = moments(link)
                values = " ".join(f"{one:.4g}" for one in own)
                yield None, "text", f"{link.get('name')}: {mass:.4g} kg, {values} kg m^2"
    for cell in entry.cells.values():
        if "unstable" in cell.sentence:
            yield cell, "step", rate(root, path)
        elif cell.engine in ASK and (cell.outcome is not Outcome.AGREES or cell.engine == CONTROL):
            means, numbers = answer(cell.engine, root, path)
            is_load = means == "load" and cell.outcome is not Outcome.REFUSED
            yield cell, "" if is_load else means, numbers


def main() -> None:
    """Print a line for each fault and each of these cells, and write the confirmed ones."""
    store, clones, *names = sys.argv[1:]
    for file in (one for files in robot_files(names) for one in files if one.suffix == "urdf"):
        if (done := kept(file, Path(store))) is None:
            continue
        results, rows = read_results(Path(store) / file.slug / "results.json"), confirmed()
        path = Path(clones, file.owner, file.repository, file.path)
        for cell, means, numbers in confirm(Entry(file=file, done=done, results=results), path):
            engine = "the file" if cell is None else f"{cell.engine} {cell.version}"
            print(f"{file.slug} | {engine} | {means or 'NOT CONFIRMED'} | {numbers}", flush=True)
            if cell is not None and cell.outcome is not Outcome.AGREES:
                print(f"    {cell.outcome} {cell.sentence}", flush=True)
                if means:
                    rows.setdefault(file.slug, {}).setdefault(engine, numbers)
        CONFIRMED.write_text(HEAD + "".join(map(table, sorted(rows.items()))))


def table(rows: tuple[str, dict[str, str]]) -> str:
    """Return the cells of a robot as TOML."""
    lines = [f'"{cell}" = {json.dumps(text)}\n' for cell, text in sorted(rows[1].items())]
    return f'\n["{rows[0]}"]\n{"".join(lines)}'


if __name__ == "__main__":
    main()
