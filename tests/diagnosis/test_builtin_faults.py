"""Faults in the built-in models: named from motions alone, through the real command."""

import json
import re
import shutil
import subprocess
import sys

import pytest

from harness.cases.prepare import prepare
from harness.diagnosis.task import DiagnosisTask
from harness.files.folders import builtin
from harness.files.model_files import model_files
from harness.mutation.mutate import SIZES, MutationTask, mutated, survey
from harness.mutation.text import mutation_lines


def crosscheck(*arguments, cwd):
    return subprocess.run(
        [sys.executable, "-m", "harness", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={"PATH": "", "PYTHONPATH": str(builtin().parent)},
    )


@pytest.fixture
def folder(tmp_path):
    def copy(name):
        shutil.copytree(builtin() / name, tmp_path / name)
        return tmp_path / name

    return copy


@pytest.mark.parametrize(("name", "file", "engine", "old", "new", "cause", "wanted"), [
    ("drum_pendulum", "mujoco.xml", "mujoco", 'diaginertia="0.024 0.024 0.0001"',
     'diaginertia="0.024 0.024012 0.0001"', "body[rod]/inertial@diaginertia[1]", 0.024),
    ("drum_pendulum", "robot.urdf", "pybullet", 'xyz="0 0 -0.3"', 'xyz="0 0 -0.30003"',
     "link[rod]/inertial/origin@xyz[2]", -0.3),
    ("free_pair", "space.py", "pymunk", "STIFFNESS = 38.0", "STIFFNESS = 38.000038", "STIFFNESS",
     38.0),
    ("anchored_pair", "robot.urdf.toml", "mujoco", "damping = 1.1", "damping = 1.16",
     "sidecar:spring[0].damping", 1.1),
])  # fmt: skip
def test_the_wrong_literal_is_named_with_file_line_and_value(
    folder, tmp_path, name, file, engine, old, new, cause, wanted
):
    path = folder(name) / file
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    line = text[: text.index(old)].count("\n") + 1
    done = crosscheck("run", path.parent, "--engine", engine, "--out", "out", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    model = file.removesuffix(".toml")
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    diagnosis = next(m["diagnosis"] for m in found["models"] if m["model"] == model)
    first = diagnosis["findings"][0]
    assert diagnosis["explained"]
    assert cause in (first["cause"], *first["tied_with"])
    told = next(f for f in diagnosis["findings"] if f["cause"] == cause)
    assert told["where"] == [f"{file}:{line}"]
    assert told["estimate"][0] == pytest.approx(wanted, abs=0.01 * abs(float_of(new) - wanted))
    assert re.search(rf"cause in {name}/{re.escape(model)} \[{engine}\]", done.stdout)
    # The audit reads the literal; the diagnosis did not.
    assert "audit of" in done.stdout


def float_of(text):
    """The last number of a replacement that is not zero, or 0.0001, the rod's own axis."""
    numbers = [float(n) for n in re.findall(r"-?\d+\.\d+", text)]
    return next(n for n in reversed(numbers) if n not in (0.0, 0.0001))


def test_audit_exits_1_for_a_literal_that_no_motion_depends_on(folder, tmp_path):
    path = folder("mass_spring_damper") / "mujoco.xml"
    text = path.read_text()
    path.write_text(re.sub(r'diaginertia="[\d. ]+"', 'diaginertia="0.03 0.03 0.03"', text))
    done = crosscheck("audit", path.parent, "--engine", "mujoco", cwd=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert re.search(r"finding +literal +\S*mujoco.xml:\d+", done.stdout)
    run = crosscheck("run", path.parent, "--engine", "mujoco", cwd=tmp_path)
    assert run.returncode == 1
    assert "6 AGREES" in run.stdout


def test_every_small_fault_of_a_literal_that_matters_is_caught_and_named():
    physics = prepare(builtin() / "mass_spring_damper")
    rows = []
    for sidecar in model_files(physics.folder):
        for engine in sidecar.engines:
            task = DiagnosisTask(
                physics.system, sidecar, engine, physics.motions, physics.scales, physics.variants
            )
            known = survey(task)
            small = [fault for fault in known.faults if fault.name in SIZES]
            rows += [mutated(MutationTask(task, known, fault)) for fault in small]
    seen = [row for row in rows if row.verdict != "unseen"]
    assert len(seen) == 3 * 3 * 4  # sizes, constants, pairings
    assert all(row.verdict == "named" and row.estimate_error < 0.01 for row in seen)
    assert "small faults: 36 of 36 caught, 36 named" in mutation_lines(rows)[-1]
