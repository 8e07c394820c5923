"""Bodies in 3-D: their positions, highlights, and lines in the file."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.checks.scene import body_lines, errors_record, scene_record
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.numerics.stepping import StepDefects
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.html.comparison import write_comparison
from physics_crosscheck.harness.render.html.scenes import three_code
from physics_crosscheck.records import CauseId, Diagnosis, Outcome, Results, SourceLine
from physics_crosscheck.reference.dynamics.tree_equations import TreeFrames
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.segments import Segments
from tests.compare.arm import MJCF
from tests.compare.asking import changed, compared
from tests.models import written
from tests.report.chromium import Browser, Tab
from tests.report.samples import changed_model, explanation, located, results
from tests.report.steps import needs_browser, sound, tab_to
from tests.report.test_first_screen import VISIBLE

STATES, WORST = 6, 3
WRONG = "left_knee"
CHAINS = {
    "leg": ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"),
    "arm": ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll",
            "wrist_pitch", "wrist_yaw"),
}  # fmt: skip


def humanoid() -> str:
    """Return an MJCF of a trunk with three joints, two legs and two arms: 29 hinges."""
    lines = ["<mujoco model='humanoid'>", "<worldbody>", "<body name='pelvis' pos='0 0 0.8'>"]
    lines += ["<geom type='box' size='0.1 0.12 0.06' mass='8'/>"]
    for prefix, y in (("left", 0.1), ("right", -0.1)):
        lines += _chain(prefix, CHAINS["leg"], (0, y, -0.1), (0, 0, -0.14))
    lines += _chain("waist", ("yaw", "roll", "torso"), (0, 0, 0.08), (0, 0, 0.1), close=False)
    for prefix, y in (("left", 0.2), ("right", -0.2)):
        lines += _chain(prefix, CHAINS["arm"], (0, y, 0.2), (0, np.sign(y) * 0.1, 0))
    return "\n".join([*lines, "</body>" * 4, "</worldbody>", "</mujoco>"]) + "\n"


def _chain(
    prefix: str,
    names: tuple[str, ...],
    start: tuple[float, ...],
    step: tuple[float, ...],
    close: bool = True,
) -> list[str]:
    lines, position = [], start
    for i, name in enumerate(names):
        body = f"{prefix}_{name}"
        mass = 2.97 if body == WRONG else 2.0
        lines += [
            f"<body name='{body}' pos='{' '.join(map(str, position))}'>",
            f"<joint name='{body}_joint' axis='{'1 0 0' if i % 2 else '0 1 0'}' range='-1 1'/>",
            f"<geom type='capsule' fromto='0 0 0 {' '.join(map(str, step))}' size='0.04'"
            f" mass='{mass}'/>",
        ]
        position = step
    return [*lines, "</body>" * len(names)] if close else lines


def states_of(tree: Tree, seed: int = 2) -> Segments:
    """Random states that move for a millisecond with random accelerations."""
    random = np.random.default_rng(seed)
    start = random.uniform(-0.8, 0.8, (STATES, 2 * tree.dof))
    segments = Segments.unsolved(start, 1e-3, np.zeros((STATES, 0)))
    rates: Array = random.uniform(-5, 5, (STATES, 2 * tree.dof))
    return Segments(**{**vars(segments), "end": start + 1e-3 * rates})


def humanoid_results(folder: Path) -> tuple[Results, Tree, Segments, Array]:
    """Return the file's results: tree, states, and differences of the engine at their ends."""
    text = humanoid()
    file = folder / "humanoid.xml"
    file.write_text(text)
    robot = read_robot(file)
    assert robot.tree is not None
    tree, states = robot.tree, states_of(robot.tree)
    scene = scene_record(tree, states, [part.link for part in robot.parts], robot.placed)
    names = tuple(link.name for link in tree.links)
    apart = np.random.default_rng(3).uniform(-1e-6, 1e-6, states.end.shape)
    apart[WORST] *= 100
    defects = StepDefects(defect=np.abs(apart), uncertainty=np.full_like(apart, 1e-12))
    lines = body_lines(file, [body.name for body in scene.bodies])
    errors = replace(errors_record(tree, states, names, defects, apart), lines=lines)
    line = next(i for i, row in enumerate(text.splitlines(), 1) if "2.97" in row)
    where = located(SourceLine(file="humanoid.xml", line=line), text, "2.97")
    cause = explanation(CauseId(kind="literal", subject=("geom[29]@mass",)), 1e-10, (), "there")
    shown = replace(cause.causes[0], nominal=2.97, estimate=2.0, locations=(where,))
    sample = results(1)
    changed = changed_model(
        sample, 0, model="humanoid.xml", text=text, folder=str(file),
        diagnosis=Diagnosis(explained=True, explanations=(replace(cause, causes=(shown,)),)),
    ).models[0]  # fmt: skip
    case = replace(
        sample.cases[0], model="humanoid.xml", folder=str(file), scenario="states", series=None,
        full_run=None, outcome=Outcome.DIFFERS, by_state=errors,
    )  # fmt: skip
    system = replace(sample.systems[0], folder=str(file), sketch=None, derivation=None, scene=scene)
    results_ = replace(sample, systems=(system,), models=(changed,), cases=(case,))
    return results_, tree, states, apart


CASE = "case-system_0/humanoid.xml/mujoco/states"
BOX = "document.querySelector('.view.current .scene')"
DRAWN = f"{BOX}?.dataset.built === 'scene' && {BOX}.querySelector('[data-frames]')"

WORST_STATE = f"""[...{BOX}.querySelectorAll('button')]
  .find((one) => one.textContent === 'Worst state').click()"""

Planted = tuple[Path, Tree, Segments, Array]


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Planted:
    folder = tmp_path_factory.mktemp("scene")
    results, tree, states, apart = humanoid_results(folder)
    path = folder / "index.html"
    write_report(path, results)
    return path, tree, states, apart


@pytest.fixture(scope="module")
def open_scene(browser: Browser) -> Iterator[Tab]:
    with browser.tab() as tab:
        yield tab


@pytest.fixture
def scene_tab(open_scene: Tab, planted: Planted) -> Iterator[Tab]:
    """Return the overview with the picture in its initial state."""
    open_scene.send("Page.bringToFront")
    open_scene.window(1440, 900)
    # Do not loop, which would keep a busy machine drawing.
    still = {"name": "prefers-reduced-motion", "value": "reduce"}
    open_scene.send("Emulation.setEmulatedMedia", features=[still])
    open_scene.open(f"{planted[0].as_uri()}#overview")
    open_scene.until(DRAWN)
    yield open_scene
    # Software rendering emits performance warnings.
    open_scene.problems = [one for one in open_scene.problems if "GL Driver Message" not in one]
    sound(open_scene, planted[0].as_uri())


def poses(tab: Tab) -> Array:
    """Return positions of all bodies, by the equations and in the engine, (2, bodies, 3)."""
    layers = tab.run(f"{BOX}.viewer.poses().map((layer) => layer.map((pose) => pose.slice(0, 3)))")
    return np.array(layers)


def expected(planted: Planted, state: int, time: float, factor: float) -> Array:
    """Return the same positions from the tree's kinematics."""
    _, tree, states, apart = planted
    n = tree.dof
    start, rates = states.start[state], (states.end - states.start)[state] / 1e-3
    moved = start[n:] * time + 0.5 * (rates[n:] + factor * apart[state, n:] / 1e-3) * time**2
    values = TreeFrames(tree, tuple(tree.frames))((start[:n] + moved)[None])
    places: Array = values.reshape(len(tree.frames), -1)[:, :3]
    return places


@needs_browser
def test_first_screen_has_link_line_and_fix(scene_tab: Tab) -> None:
    text = scene_tab.run(VISIBLE)
    line = next(i for i, row in enumerate(humanoid().splitlines(), 1) if "2.97" in row)
    for wanted in (WRONG, f"humanoid.xml:{line}", "2.97", "Copy patch"):
        assert wanted in text, wanted
    # Only the link with the lines that the cause names is highlighted.
    lit = f"[...{BOX}.viewer.lit].map((i) => {BOX}.viewer.data.bodies[i].name)"
    assert scene_tab.run(lit) == [WRONG]
    assert scene_tab.run(f"{BOX}.dataset.drawing") == ("solids" if three_code() else "projection")


@needs_browser
def test_long_path_fits_on_a_phone(scene_tab: Tab) -> None:
    scene_tab.window(390, 844)
    for view in ("overview", CASE):
        scene_tab.go(view)
        assert scene_tab.run("document.documentElement.scrollWidth") <= 390
    assert scene_tab.run("document.getElementById('matching').textContent") == "1 case"
    line = "[...document.querySelectorAll('.brief')].find((line) => line.innerText.includes('E'))"
    assert scene_tab.run(f"{line}.innerText").endswith("error\u00a0at\u00a0dt\u00a0–")


@needs_browser
def test_bodies_follow_kinematics_with_time_and_amplifier(scene_tab: Tab, planted: Planted) -> None:
    """Compare positions, which a wrong axis, parent, rotation order or error share changes."""
    (drawn,), tree = poses(scene_tab), planted[1]
    (frames,) = TreeFrames(tree, tuple(tree.frames))(np.zeros((1, tree.dof)))
    assert np.max(np.abs(drawn - frames.reshape(len(drawn), -1)[:, :3])) < 1e-5, "it opens as drawn"
    floor = scene_tab.run(f"{BOX}.viewer.floor[0].line[0][2]")
    assert -0.5 < floor - drawn[:, 2].min() < 0
    scene_tab.run(WORST_STATE)
    assert scene_tab.run(f"{BOX}.viewer.state") == WORST
    for state, time, power in ((WORST, 0.05, 1), (0, 0.02, 0), (STATES - 1, 0.1, 2.5)):
        scene_tab.run(f"{BOX}.viewer.set({{ playing: false, state: {state}, time: {time}, "
                      f"power: {power} }})")  # fmt: skip
        reference, engine = poses(scene_tab)
        for actual, factor in ((reference, 0.0), (engine, 10.0**power)):
            wanted = expected(planted, state, time, factor)
            assert np.max(np.abs(actual - wanted)) < 1e-5
    assert np.max(np.abs(engine - reference)) > 1e-3


@needs_browser
def test_lines_and_links_highlight_each_other(
    scene_tab: Tab, planted: Planted, tmp_path: Path
) -> None:
    scene_tab.go(CASE)
    scene_tab.until(DRAWN)
    names = list(planted[1].frames)
    line = next(i for i, row in enumerate(humanoid().splitlines(), 1) if "'right_elbow'" in row)
    place = scene_tab.run(f"""(() => {{ const row = {BOX}.querySelector('[data-line="{line}"]');
      row.scrollIntoView({{ block: "center" }}); const box = row.getBoundingClientRect();
      return [box.left + 90, box.top + 5]; }})()""")
    scene_tab.mouse("mouseMoved", *place)
    scene_tab.until(f"[...{BOX}.viewer.hovered].join() === '{names.index('right_elbow')}'")
    # A click on a link in the picture shows its lines.
    spot = scene_tab.run(f"""(() => {{ const viewer = {BOX}.viewer, at = viewer.drawing.canvas;
      viewer.set({{ playing: false }});
      at.scrollIntoView({{ block: "center" }});
      const project = viewer.camera.projection(at.clientWidth, at.clientHeight);
      const box = at.getBoundingClientRect(), body = {names.index(WRONG)};
      const [x, y] = project(placed(viewer, body)); return [x + box.left, y + box.top];
      function placed(one, i) {{ const [pose] = one.poses(); const p = pose[i];
        return [p[0], p[1], p[2]]; }} }})()""")
    scene_tab.mouse("mouseMoved", *spot)
    scene_tab.mouse("mousePressed", *spot, button="left", clickCount=1, buttons=1)
    scene_tab.mouse("mouseReleased", *spot, button="left", clickCount=1)
    chosen = scene_tab.run(f"{BOX}.viewer.chosen")
    assert chosen >= 0
    first = body_lines(written(tmp_path, "r.xml", humanoid()), names)[chosen][0][0]
    scene_tab.until(f"{BOX}.querySelector('.owned').dataset.line === '{first}'")
    href = scene_tab.run(f"{BOX}.querySelector('.editor').href")
    assert href.startswith("vscode://file/")
    assert href.endswith(f"humanoid.xml:{first}")


@needs_browser
def test_heat_map_and_sliders_work_by_mouse_and_keyboard(scene_tab: Tab, planted: Planted) -> None:
    scene_tab.go(CASE)
    scene_tab.until(DRAWN)
    scene_tab.run(f"""{BOX}.querySelector('[data-row="4"][data-state="2"]')
      .dispatchEvent(new MouseEvent("click", {{ bubbles: true }}))""")
    assert scene_tab.run(f"[{BOX}.viewer.state, {BOX}.viewer.chosen]") == [2, 5]
    scene_tab.run(f"{BOX}.querySelector('.heat').focus()")
    scene_tab.key("ArrowRight", 39)
    scene_tab.key("ArrowDown", 40)
    assert scene_tab.run(f"[{BOX}.viewer.state, {BOX}.viewer.chosen]") == [3, 6]
    readout = scene_tab.run(f"{BOX}.querySelector('.errors .readout').textContent")
    assert readout.startswith(f"{planted[1].links[5].name} at state 4: E ")
    before = scene_tab.run(f"{BOX}.viewer.power")
    scene_tab.run(f"{BOX}.querySelector('[aria-label=\"Amplify the error\"]').focus()")
    scene_tab.key("ArrowRight", 39)
    assert scene_tab.run(f"{BOX}.viewer.power") == before + 0.5
    yaw = scene_tab.run(f"{BOX}.viewer.camera.yaw")
    scene_tab.run(f"{BOX}.querySelector('canvas').focus()")
    scene_tab.key("ArrowRight", 39)
    assert scene_tab.run(f"{BOX}.viewer.camera.yaw") < yaw


@pytest.mark.slow
@needs_browser
def test_keyboard_reaches_wrong_link_line_and_controls(
    scene_tab: Tab, planted: Planted, tmp_path: Path
) -> None:
    viewer = f"{BOX}.viewer"
    scene_tab.changed = True
    scene_tab.open(planted[0].as_uri())
    scene_tab.until(DRAWN)
    tab_to(scene_tab, "#overview a[href^='#case-']")
    scene_tab.key("Enter", 13)
    scene_tab.until(f"document.querySelector('.view.current').id === '{CASE}'")
    scene_tab.until(DRAWN)
    scene_tab.run(WORST_STATE)
    tab_to(scene_tab, "canvas")
    yaw = scene_tab.run(f"{viewer}.camera.yaw")
    scene_tab.key("ArrowRight", 39)
    assert scene_tab.run(f"{viewer}.camera.yaw") < yaw
    for label, value, change in (
        ("Time", "time", -1), ("State", "state", -1), ("Amplify the error", "power", -1)
    ):  # fmt: skip
        tab_to(scene_tab, f"[aria-label='{label}']")
        before = scene_tab.run(f"{viewer}.{value}")
        scene_tab.key("ArrowLeft", 37)
        assert change * (scene_tab.run(f"{viewer}.{value}") - before) > 0, label
    # The first link in the list is the one that the cause names.
    tab_to(scene_tab, "[aria-label='Link']")
    scene_tab.key("ArrowDown", 40)
    scene_tab.until(f"{viewer}.data.bodies[{viewer}.chosen]?.name === '{WRONG}'")
    tab_to(scene_tab, ".editor")
    names = list(planted[1].frames)
    first = body_lines(written(tmp_path, "r.xml", humanoid()), names)[names.index(WRONG)][0][0]
    assert scene_tab.run("document.activeElement.href").endswith(f"humanoid.xml:{first}")
    tab_to(scene_tab, ".heat")
    state = scene_tab.run(f"{viewer}.state")
    scene_tab.key("ArrowRight", 39)
    assert scene_tab.run(f"{viewer}.state") == state + 1


@needs_browser
def test_without_webgl_a_projection_is_drawn(browser: Browser, planted: Planted) -> None:
    lost = """HTMLCanvasElement.prototype.getContext = new Proxy(
      HTMLCanvasElement.prototype.getContext, { apply: (call, canvas, [kind, ...more]) =>
        (kind.startsWith("webgl") ? null : call.apply(canvas, [kind, ...more])) });"""
    with browser.tab() as tab:
        tab.send("Page.addScriptToEvaluateOnNewDocument", source=lost)
        tab.open(planted[0].as_uri())
        tab.until(DRAWN)
        assert tab.run(f"{BOX}.dataset.drawing") == "projection"
        inked = f"""(() => {{ const at = {BOX}.querySelector("canvas");
          const bytes = at.getContext("2d").getImageData(0, 0, at.width, at.height).data;
          return bytes.filter((value, i) => i % 4 === 3 && value > 0).length; }})()"""
        assert tab.run(inked) > 1000
        sound(tab, planted[0].as_uri())


def test_page_without_bodies_has_no_scene_code(planted: Planted, tmp_path: Path) -> None:
    from tests.report.samples import results

    write_report(tmp_path / "index.html", results(1))
    page = (tmp_path / "index.html").read_text("utf-8")
    assert "pack-three" not in page
    assert "class Mechanism" not in page
    assert planted[0].stat().st_size < 1.5e6


def test_lines_of_bodies_in_each_format(tmp_path: Path) -> None:
    """Assign URDF joints to child links, and end an MJCF body where the next begins."""
    urdf = "<robot>\n<link name='a'/>\n<link name='b'>\n</link>\n"
    urdf += "<joint name='j'>\n<parent link='a'/>\n<child link='b'/>\n</joint>\n</robot>"
    assert body_lines(written(tmp_path, "r.urdf", urdf), ["a", "b"]) == (
        ((2, 2),),
        ((3, 4), (5, 8)),
    )
    bodies = "<body name='a'>\n<geom size='1'/>\n<body>\n</body>\n</body>\n"
    mjcf = f"<mujoco>\n<worldbody>\n{bodies}</worldbody>\n</mujoco>"
    assert body_lines(written(tmp_path, "r.xml", mjcf), ["a", "body_2"]) == (((3, 4),), ((5, 6),))
    assert body_lines(written(tmp_path, "not.xml", "<not"), ["a"]) == ()


@needs_browser
def test_closed_page_releases_its_picture(scene_tab: Tab) -> None:
    """Release pictures, because browsers drop the oldest of about 16."""
    held = "[...document.querySelectorAll('.scene')].filter((box) => box.viewer).length"
    for place in (CASE, "system-system_0"):
        scene_tab.go(place)
        scene_tab.until(DRAWN)
        scene_tab.until(f"{held} === 1")


def test_differences_below_their_uncertainty_are_not_drawn(planted: Planted) -> None:
    _, tree, states, apart = planted
    names = tuple(link.name for link in tree.links)
    for share, rows in ((0.5, 0), (2.0, tree.nv)):
        defects = StepDefects(defect=share * np.ones_like(apart), uncertainty=np.ones_like(apart))
        errors = errors_record(tree, states, names, defects, apart)
        assert len(errors.accelerations) == rows


@needs_browser
def test_compared_robots_are_drawn_over_each_other(browser: Browser, tmp_path: Path) -> None:
    file = written(tmp_path, "arm.xml", MJCF)
    other = changed(tmp_path / "b", file, ('pos="0 0 -0.4"', 'pos="0 0 -0.5"'))
    comparison = compared(file, other, pictured=True)
    path = tmp_path / "compare.html"
    write_comparison(path, comparison)
    with browser.tab() as tab:
        tab.window(390, 844)
        tab.open(path.as_uri())
        tab.until(DRAWN)
        places = tab.run(f"[2, 5].map((body) => {BOX}.viewer.poses()[0][body].slice(0, 3))")
        assert np.linalg.norm(np.subtract(*places)) == pytest.approx(0.1)
        assert tab.run("document.documentElement.scrollWidth") <= 390
        assert tab.run(f"[...{BOX}.viewer.lit].map((i) => {BOX}.viewer.data.bodies[i].name)") == [
            "hand"
        ]
        tab.problems = [one for one in tab.problems if "GL Driver Message" not in one]
        sound(tab, path.as_uri())
