"""A box with an arm that acts on everything: mesh, floor, limit, drive; another mass in MuJoCo."""

from pathlib import Path

import numpy as np
from msgspec.structs import replace

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.scene import errors_record, inertia_records
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.stepping import StepDefects
from physics_crosscheck.records import Outcome, Results
from tests.report.samples import changed_model, results

CORNERS = 24
"""Corners of each ring of the mesh, a prism."""

ARM = """<mujoco>
<compiler angle="radian"/>
<asset><mesh name="part" file="part.obj"/></asset>
<worldbody>
<geom type="plane" size="2 2 0.1"/>
<body name="base" pos="0 0 0.1">
<freejoint name="root"/>
<geom type="box" size="0.2 0.15 0.1" mass="3"/>
<body name="arm" pos="0 0 0.2">
<joint name="elbow" axis="0 1 0" range="-1 1" limited="true"/>
<inertial pos="0 0 0.2" mass="1" diaginertia="0.02 0.03 0.01"/>
<geom type="mesh" mesh="part" contype="0" conaffinity="0"/>
</body>
</body>
</worldbody>
<actuator>
<motor joint="elbow" gear="40" ctrlrange="-1 1" forcelimited="true" forcerange="-0.5 0.5"/>
</actuator>
</mujoco>
"""


def write_arm(folder: Path) -> Path:
    turns = 2 * np.pi * np.arange(CORNERS) / CORNERS
    rows = [(0.05 * np.cos(t), 0.05 * np.sin(t), z) for z in (0.0, 0.4) for t in turns]
    faces = []
    for i in range(CORNERS):
        a, b = i + 1, (i + 1) % CORNERS + 1
        faces += [(a, b, CORNERS + b), (a, CORNERS + b, CORNERS + a)]
        if 0 < i < CORNERS - 1:
            faces += [(1, b, a), (CORNERS + 1, CORNERS + a, CORNERS + b)]
    text = [f"v {x:.9f} {y:.9f} {z}" for x, y, z in rows] + [f"f {a} {b} {c}" for a, b, c in faces]
    (folder / "part.obj").write_text("\n".join(text))
    file = folder / "arm.xml"
    file.write_text(ARM)
    return file


def arm_results(folder: Path) -> Results:
    """Return the file's results, with steps and inertias of an engine with a heavier arm."""
    file = write_arm(folder)
    heavier = folder / "heavier.xml"
    heavier.write_text(
        ARM.replace('mass="1"', 'mass="1.5"').replace("0.02 0.03 0.01", "0.04 0.03 0.02")
    )
    target, engine = prepare_tree(file), engines()["mujoco"]
    check = check_whole_step(file, ModelSpec(heavier), "mujoco", 1e-9)
    assert check is not None
    loaded = engine.load(ModelSpec(heavier, settings=target.settings))
    assert target.record.scene is not None
    inertias = inertia_records(target.tree, target.record.scene.bodies, loaded.inertias)
    agrees = np.full_like(target.samples.start, 1e-15)
    defects = StepDefects(defect=agrees, uncertainty=10 * agrees)
    errors = errors_record(target.tree, target.samples, target.names, defects, None, inertias)
    sample = results(1)
    named = {"model": "arm.xml", "folder": str(file)}
    sample = changed_model(sample, 0, text=ARM, diagnosis=None, **named)
    case = replace(
        sample.cases[0], scenario="states", series=None, full_run=None, outcome=Outcome.DIFFERS,
        kind="whole step", by_state=errors, whole_step=check.record, **named,
    )  # fmt: skip
    system = replace(
        sample.systems[0], folder=str(file), sketch=None, derivation=None, scene=target.record.scene
    )
    return replace(sample, systems=(system,), cases=(case,))
