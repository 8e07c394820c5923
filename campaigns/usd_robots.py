"""USD robots of public converters, against their sources and in an engine.

`python -m campaigns.usd_robots DIR --menagerie CLONE --tools VENV/bin` converts ten MJCFs of a
clone of google-deepmind/mujoco_menagerie and five URDFs of pybullet_data, by `mujoco_usd_converter`
and `urdf_usd_converter` of another environment, since these carry an OpenUSD of their own. Without
`--tools`, it checks what DIR already has: a folder for each robot, with `usd/*.usda` in it, and a
source beside that. USD files without a source are only run. Nothing is committed.

The table has the exit code, outcomes and codes of `compare` and `run` for each robot, and the first
line that does not agree.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pxr import Tf, Usd, UsdPhysics

from campaigns.real_models.packages import folder_of
from physics_crosscheck.harness.checks.plausibility.facts import RobotFacts
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.reference.dynamics.recursion import Recursion

MENAGERIE = (
    "kuka_iiwa_14/iiwa14.xml", "universal_robots_ur5e/ur5e.xml", "franka_emika_panda/panda.xml",
    "ufactory_xarm7/xarm7.xml", "unitree_h1/h1.xml", "unitree_g1/g1.xml", "booster_t1/t1.xml",
    "unitree_go2/go2.xml", "anybotics_anymal_c/anymal_c.xml", "shadow_hand/right_hand.xml",
)  # fmt: skip
URDFS = (
    "franka_panda/panda.urdf", "kuka_iiwa/model.urdf", "a1/a1.urdf", "laikago/laikago_toes.urdf",
    "xarm/xarm6_robot.urdf",
)  # fmt: skip
USD = (".usd", ".usda", ".usdc", ".usdz")


class UsdRobot(NamedTuple):
    """A USD file, and its source; None without one."""

    usd: Path
    source: Path | None

    @property
    def name(self) -> str:
        """Name of the robot: that of its folder if it has a source."""
        return self.usd.stem if self.source is None else self.source.parent.name


def convert(source: Path, tools: Path, folder: Path) -> str:
    """Copy a robot's folder and convert it there; return the converter's last words on failure."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source.parent, folder)
    (folder / "source").write_text(source.name, encoding="utf-8")
    program = "urdf_usd_converter" if source.suffix == ".urdf" else "mujoco_usd_converter"
    done = subprocess.run(
        [tools / program, source.name, "usd"],
        cwd=folder, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    (folder / "convert.log").write_text(done.stdout + done.stderr, encoding="utf-8")
    return (done.stderr or done.stdout).strip()[-200:] if done.returncode else ""


def robots_in(folder: Path) -> Iterator[UsdRobot]:
    """Yield the converted robots of a folder, and its other USD files with a rigid body."""
    for path in sorted(one for one in folder.rglob("*") if one.suffix in USD):
        home = path.parent.parent
        if path.parent.name == "usd" and (home / "source").is_file():
            yield UsdRobot(path, home / (home / "source").read_text(encoding="utf-8"))
        elif not any((one / "source").is_file() for one in path.parents) and _has_bodies(path):
            yield UsdRobot(path, None)


def _has_bodies(path: Path) -> bool:
    """Return whether a stage has rigid bodies or fails to open; ignore pointers of Git LFS."""
    if path.read_bytes().startswith(b"version https://git-lfs"):
        print(f"{path}: only a pointer of Git LFS", file=sys.stderr)
        return False
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        return True
    return any(prim.HasAPI(UsdPhysics.RigidBodyAPI) for prim in stage.TraverseAll())


def command(*words: object) -> tuple[int, str]:
    """Return the exit code and the output of `crosscheck`; 124 after ten minutes."""
    with tempfile.TemporaryDirectory() as out:
        program = "timeout", "600", sys.executable, "-m", "physics_crosscheck"
        line = [*program, *map(str, words), "--out", out]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def mass_difference(robot: UsdRobot) -> str:
    """Return how far the mass matrices of both files' hinges and slides are apart at most.

    Relative to the geometric mean of both diagonal elements, at 8 random states, with the joint.
    """
    sides = [read_robot(one) for one in (robot.source, robot.usd) if one is not None]
    trees = [one.tree for one in sides if one.tree is not None]
    if len(trees) < 2:
        return ""
    rows: list[dict[str, tuple[int, int]]] = []
    for tree in trees:
        places = zip(tree.links, tree.positions, tree.velocities, strict=True)
        rows.append({
            re.sub(r"_1$", "", link.name): (at.start, there.start)
            for link, at, there in places
            if there.stop - there.start == 1
        })  # fmt: skip
    names = [name for name in rows[0] if name in rows[1]]
    generator, worst, where = np.random.default_rng(0), 0.0, ""
    for _ in range(8):
        values = generator.uniform(-1, 1, len(names))
        masses = []
        for read, tree, row in zip(sides, trees, rows, strict=True):
            q = RobotFacts(read, tree).drawn.copy()
            q[[row[name][0] for name in names]] = values
            here = [row[name][1] for name in names]
            masses.append(Recursion(tree).mass(q)[np.ix_(here, here)])
        scale = np.sqrt(np.outer(np.diag(masses[0]), np.diag(masses[0])))
        apart = np.abs(masses[1] - masses[0]) / scale
        if apart.max() > worst:
            worst, where = float(apart.max()), names[int(np.argmax(apart.max(axis=0)))]
    return f"{worst:.1e} at {where}, {len(names)} joints"


def summary(code: int, text: str) -> str:
    """Return a cell: exit code, outcomes, message codes, and the first line that fails."""
    outcomes = Counter(re.findall(r"^ *(ok|FAIL|REFUSED|unresolved|ERROR|skipped)\b", text, re.M))
    codes = Counter(re.findall(r"\bXC\d{3}\b", text))
    counts = [f"{count} {name}" for name, count in (*outcomes.items(), *codes.items())]
    bad = re.search(r"^ *(?:FAIL|REFUSED|unresolved|ERROR).*", text, re.M)
    words = "" if bad is None else f"; {bad[0].strip()[:160]}"
    return f"{code}: {', '.join(counts)}{words}".replace("|", "/")


def main(given: Sequence[str] | None = None) -> None:
    """Convert robots, and print a row for each."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.usd_robots", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--menagerie", type=Path, help="clone of mujoco_menagerie")
    parser.add_argument("--tools", type=Path, help="folder with the converters' programs")
    parser.add_argument("--engine", default="newton")
    parser.add_argument("--masses", action="store_true", help="compare only mass matrices")
    chosen = parser.parse_args(given)
    sources = [chosen.menagerie / one for one in MENAGERIE if chosen.menagerie]
    urdfs = folder_of("pybullet")
    sources += [urdfs / one for one in URDFS if urdfs]
    for source in sources if chosen.tools else ():
        failure = convert(source, chosen.tools.absolute(), chosen.folder / source.stem)
        print(f"{source}: {failure or 'converted'}", file=sys.stderr, flush=True)
    print(f"| robot | M(q) | compare | {chosen.engine} |\n|---|---|---|---|", flush=True)
    for robot in robots_in(chosen.folder):
        masses = mass_difference(robot) if robot.source else ""
        if chosen.masses:
            print(f"| {robot.name} | {masses} | | |", flush=True)
            continue
        compared = command("compare", robot.source, robot.usd) if robot.source else (0, "")
        run = command("run", robot.usd, "--engine", chosen.engine)
        cells = robot.name, masses, summary(*compared), summary(*run)
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
