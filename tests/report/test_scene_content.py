"""Meshes, inertia and forces in the picture of bodies."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.scene import body_lines, errors_record, inertia_records
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.modelfiles.mesh_files import decimated_mesh, read_mesh
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.numerics.stepping import StepDefects
from physics_crosscheck.harness.render.html import render, write_report
from physics_crosscheck.records import Outcome, Results, SourceLine
from tests.report.chromium import Browser, Tab
from tests.report.samples import changed_model, results
from tests.report.steps import needs_browser, sound
from tests.report.test_scene import BOX, DRAWN, WORST_STATE

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
    names = [body.name for body in target.record.scene.bodies]
    errors = replace(errors, lines=body_lines(file, names))
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


PLAIN_URDF = """<robot name="two"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 1"/>
<mass value="2"/><inertia ixx="0.03" iyy="0.02" izz="0.04" ixy="0" ixz="0" iyz="0.001"/></inertial>
<visual><geometry><mesh filename="gone.stl"/></geometry></visual></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


HARMLESS = ("GL Driver Message", "willReadFrequently")
"""Warnings on software rendering, and on this test's own reading of pixels."""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Results]:
    folder = tmp_path_factory.mktemp("arm")
    results = arm_results(folder)
    write_report(folder / "index.html", results)
    return folder / "index.html", results


@pytest.fixture(scope="module")
def arm_tab(browser: Browser, arm: tuple[Path, Results]) -> Iterator[Tab]:
    with browser.tab() as tab:
        tab.window(1440, 900)
        still = {"name": "prefers-reduced-motion", "value": "reduce"}
        tab.send("Emulation.setEmulatedMedia", features=[still])
        tab.open(arm[0].as_uri())
        tab.until(DRAWN)
        yield tab
        tab.problems = [one for one in tab.problems if not any(map(one.count, HARMLESS))]
        sound(tab, arm[0].as_uri())


@needs_browser
def test_meshes_inertias_and_forces_are_drawn(arm_tab: Tab, arm: tuple[Path, Results]) -> None:
    (system,), (case,) = arm[1].systems, arm[1].cases
    assert system.scene is not None
    assert case.whole_step is not None
    acting = case.whole_step.acting
    assert acting is not None
    # The file's mesh, not an ellipsoid.
    forms = arm_tab.run(f"{BOX}.viewer.around.map((points) => [0, 1, 2].map((i) => "
                        "Math.max(...points.map((point) => point[i]))))")  # fmt: skip
    assert np.allclose(forms[1], (0.05, 0.05, 0.4), atol=1e-5)
    # The engine's inertia differs, so it is shown and named.
    assert arm_tab.run(f"{BOX}.viewer.inertia")
    text = arm_tab.run(f"{BOX}.querySelector('.unequal').textContent")
    assert text == "The engine has another inertia of arm (mass 1.5 kg instead of 1)."
    # The worst state is the whole step: both robots, and a mark at each contact.
    arm_tab.run(WORST_STATE)
    arm_tab.run(f"{BOX}.viewer.draw()")  # now, and not before the next frame
    assert len(arm_tab.run(f"{BOX}.viewer.poses()")) == 2
    assert f"{len(acting.contacts)} contact" in arm_tab.run(
        f"{BOX}.querySelector('.acting').textContent"
    )
    inked = """(() => { const { viewer } = %s, { canvas, pen, colours } = viewer.marks;
      const project = viewer.camera.projection(canvas.clientWidth, canvas.clientHeight);
      return viewer.acting.contacts.map(({ point }) => { const [x, y] = project(point);
        return [...pen.getImageData(Math.round(x), Math.round(y), 1, 1).data]; }); })()""".replace(
        "%s", BOX
    )
    for red, green, blue, alpha in arm_tab.run(inked):
        assert (red, green, blue, alpha) == (0, 0x87, 0x5F, 255)
    # The sampled states have no marks.
    arm_tab.run(f"{BOX}.viewer.open(0)")
    arm_tab.until(f"{BOX}.querySelector('.acting').textContent === ''")
    arm_tab.until(
        """(() => { const { canvas, pen } = %s.viewer.marks;
      const { data } = pen.getImageData(0, 0, canvas.width, canvas.height);
      return data.every((value) => !value); })()""".replace("%s", BOX)
    )


@needs_browser
def test_all_bodies_are_inside_the_first_picture(arm_tab: Tab) -> None:
    outside = """(() => { const { viewer } = %s, { canvas } = viewer.drawing;
      viewer.fitted = ""; viewer.draw();
      const project = viewer.camera.projection(canvas.clientWidth, canvas.clientHeight);
      const points = viewer.poses().flatMap((poses) => poses.flatMap((pose, body) =>
        viewer.around[body].map((point) => project(placed(pose, point)))));
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      return points.filter(([x, y]) => !(x > 0 && x < width && y > 0 && y < height)).length;
      function placed([x, y, z, w, i, j, k], p) {
        const c = ([a, b, d], [e, f, g]) => [b * g - d * f, d * e - a * g, a * f - b * e];
        const t = c([i, j, k], p).map((v) => 2 * v), u = c([i, j, k], t);
        return [x, y, z].map((v, n) => v + p[n] + w * t[n] + u[n]);
      } })()""".replace("%s", BOX)
    for size in ((390, 844), (2000, 500), (1440, 900)):
        arm_tab.window(*size)
        assert arm_tab.run(outside) == 0, size


@needs_browser
def test_placeholder_larger_than_the_robot_shows_on_request(
    browser: Browser, arm: tuple[Path, Results], tmp_path: Path
) -> None:
    """Hide it, mark a cause without a shape by a dot, and keep labels from overlapping."""
    (system,), (case,) = arm[1].systems, arm[1].cases
    assert case.by_state is not None
    assert system.scene is not None
    large = tuple(
        replace(one, ellipsoid=(*one.ellipsoid[:7], 3.0, 3.0, 3.0)) if one.differs else one
        for one in case.by_state.inertias
    )
    base, body = system.scene.bodies
    bare = replace(body, shapes=(), ellipsoid=())
    lit = tuple(SourceLine(file="arm.xml", line=line) for line in (8, 11))
    changed = replace(
        arm[1],
        systems=(replace(system, scene=replace(system.scene, bodies=(base, bare))),),
        cases=(replace(case, by_state=replace(case.by_state, inertias=large), locations=lit),),
    )
    write_report(tmp_path / "index.html", changed)
    with browser.tab() as tab:
        tab.window(1440, 900)
        still = {"name": "prefers-reduced-motion", "value": "reduce"}
        tab.send("Emulation.setEmulatedMedia", features=[still])
        tab.open((tmp_path / "index.html").as_uri())
        tab.until(DRAWN)
        assert tab.run(f"{BOX}.viewer.inertia") == ""
        near = tab.run(f"{BOX}.viewer.camera.distance")
        assert "larger than the robot" in tab.run(f"{BOX}.querySelector('.unequal').textContent")
        select = f"[...{BOX}.querySelectorAll('select')][1]"
        tab.run(f"{select}.value = 'differing', {select}.dispatchEvent(new Event('change')), null")
        tab.until(f"{BOX}.viewer.camera.distance > 2 * {near}")
        assert tab.run(f"{BOX}.viewer.around[1].length")
        labels = f"[...{BOX}.querySelectorAll('.label')].map((one) => one.getBoundingClientRect())"
        tops = sorted(tab.run(f"{labels}.map(({{ top, bottom }}) => [top, bottom])"))
        assert len(tops) == 2
        assert tops[0][1] <= tops[1][0]


def test_marks_are_where_the_laws_act(arm: tuple[Path, Results]) -> None:
    whole = arm[1].cases[0].whole_step
    assert whole is not None
    assert whole.acting is not None
    acting = whole.acting
    assert acting.joints == ("root", "elbow")
    for contact in acting.contacts:
        assert abs(contact.point[2] or 0.0) < 0.02
        assert abs(abs(contact.normal[2] or 0.0) - 1) < 1e-6
    (limit,), (drive,) = acting.limits, acting.drives
    assert limit.upper is not None
    assert limit.lower is not None
    assert limit.upper - limit.lower == pytest.approx(2.0, abs=1e-4)
    assert limit.joint == drive.joint == 1
    assert drive.share is not None
    assert abs(drive.share) <= 1
    assert abs(drive.force or 0.0) <= 40 * 0.5 + 1e-6
    assert np.any(np.abs(np.array(acting.apart, float)) > 1e-3)


def test_reduced_mesh_keeps_its_size_and_is_closed(tmp_path: Path) -> None:
    write_arm(tmp_path)
    whole = read_mesh(tmp_path / "part.obj")
    for faces in (92, 40):
        mesh = decimated_mesh(tmp_path / "part.obj", faces)
        assert 0 < len(mesh.faces) <= faces
        assert np.allclose(np.ptp(mesh.points, axis=0), np.ptp(whole.points, axis=0), rtol=0.2)
    assert len(decimated_mesh(tmp_path / "part.obj", 92).faces) == len(whole.faces) == 92


@pytest.mark.parametrize("problem", ["missing", "empty", "unreadable", "not a regular file"])
def test_empty_mesh_is_named_and_replaced_by_ellipsoid(tmp_path: Path, problem: str) -> None:
    file = tmp_path / "two.urdf"
    file.write_text(PLAIN_URDF)
    if problem == "not a regular file":
        os.mkfifo(tmp_path / "gone.stl")
    elif problem != "missing":
        (tmp_path / "gone.stl").write_text("solid" if problem == "unreadable" else "")
    note = next(one for one in plausibility_findings(read_robot(file)) if one.severity == "note")
    assert f"gone.stl is {problem}" in note.message
    record = prepare_tree(file).record
    scene = record.scene
    assert scene is not None
    case = replace(results(1).cases[0], folder=record.folder)
    page = render(replace(results(1), systems=(record,), models=(), cases=(case,)))
    assert f"Not drawn: gone.stl is {problem}." in page
    assert not scene.meshes
    link = scene.bodies[1]
    assert not link.shapes
    assert len(link.ellipsoid) == 10


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_engines_report_the_inertia_of_the_file(tmp_path: Path, name: str) -> None:
    pytest.importorskip(name)
    file = tmp_path / "two.urdf"
    file.write_text(PLAIN_URDF.replace("gone.stl", "part.obj"))
    write_arm(tmp_path)
    robot = read_robot(file)
    settings = {**SETTINGS, "smooth": True} if name == "mujoco" else SETTINGS
    mine = engines()[name].load(ModelSpec(file, settings=settings)).inertias["arm"]
    stated = next(part for part in robot.parts if part.name == "arm").inertia
    assert mine.mass == pytest.approx(stated.mass)
    assert np.allclose(mine.center, stated.center)
    assert np.allclose(mine.inertia, stated.inertia, atol=1e-9)
