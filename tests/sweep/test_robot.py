"""Sweeps of robot files, and of folders that declare bodies: their numbers are drawn."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.extras.sweep import trees as swept_trees
from physics_crosscheck.harness.extras.sweep.case import run_block, swept
from physics_crosscheck.harness.extras.sweep.factors import SweepError
from physics_crosscheck.harness.extras.sweep.main import summary, sweep
from physics_crosscheck.harness.extras.sweep.plan import CasePlan
from physics_crosscheck.harness.extras.sweep.planned import Block
from physics_crosscheck.harness.extras.sweep.store import read_plan, read_rows
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.harness.render.html.sweep import render_sweep
from physics_crosscheck.records import Outcome
from tests.models import written
from tests.mutation.test_trees import MODEL, SYSTEM
from tests.robots.files import inertial, joint, link
from tests.sweep.made import options, plan_of

MASS = "link[fore]/inertial/mass@value"
DAMPING = "joint[elbow]/dynamics@damping"
VARY = (f"{MASS}=0.5:8:log", f"{DAMPING}=0.05:0.4")
URDF = "\n".join((
    '<robot name="arm">', link("base"), link("upper"), link("fore"),
    joint("shoulder", "base", "upper", '<axis xyz="0 1 0"/>'),
    joint("elbow", "upper", "fore",
          '<origin xyz="0 0 -1"/><axis xyz="0 1 0"/><dynamics damping="0.1"/>'),
    "</robot>",
))  # fmt: skip
MJCF = """<mujoco model="arm">
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -1" size="0.05" mass="2"/>
      <body name="fore" pos="0 0 -1">
        <joint name="elbow" axis="0 1 0" damping="0.1"/>
        <geom name="rod" type="capsule" fromto="0 0 0 0 0 -0.8" size="0.04" mass="1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2) as pool:
        yield pool


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    file = written(tmp_path, "arm.urdf", URDF)
    return file


def whole(file: Path, workers: Workers, *vary: str, engines: tuple[str, ...]) -> CasePlan:
    return plan_of(file, replace(options(*(vary or VARY)), engines=engines), workers)


def rows_of(plan: CasePlan, place: Path, workers: Workers) -> list[SweepRow]:
    sweep(plan, place, workers, lambda *_: None)
    return sorted(read_rows(place), key=lambda row: row.index)


def only_block(plan: CasePlan) -> Block:
    (block,) = plan.blocks(bytes(plan.count))
    return block


def test_drawn_numbers_agree_in_every_engine_and_in_a_run(
    urdf: Path, workers: Workers, tmp_path: Path
) -> None:
    plan = whole(urdf, workers, engines=("mujoco", "pybullet"))
    rows = rows_of(plan, tmp_path / "rows", workers)
    assert len(rows) == 6
    assert {(row.draw, row.engine) for row in rows} == {
        (draw, engine) for draw in range(3) for engine in ("mujoco", "pybullet")
    }
    for row in rows:
        assert row.outcome is Outcome.AGREES, row.reason
        assert row.digits is not None
        assert row.digits > 9
        assert row.steps > 0
        assert set(row.constants) == {MASS, DAMPING}
    record = read_plan(tmp_path / "rows")
    assert record is not None
    page = render_sweep(summary(record, rows))
    assert "arm: larger of E and U</h2>" in page
    assert f"Larger of E and U over {DAMPING}" in page
    last = rows[-1]
    numbers = robot_numbers(urdf, {})
    values: Mapping[int, float] = {
        i: last.constants[number.address]
        for i, number in enumerate(numbers.numerals)
        if number.address in last.constants
    }
    copy = copy_with_texts(urdf, numbers.texts(values), tmp_path / "copy")
    assert f'damping="{last.constants[DAMPING]!r}"' in copy.read_text()
    assert judge(model_task(prepare_tree(copy), last.engine)).outcome is last.outcome


def test_copy_without_the_drawn_numbers_differs(
    urdf: Path, workers: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unchanged(file: Path, _: Mapping[Path, bytes], __: Path) -> Path:
        return file

    monkeypatch.setattr(swept_trees, "copy_with_texts", unchanged)
    swept.cache_clear()
    rows = run_block(only_block(whole(urdf, workers, engines=("mujoco",))))
    assert [row.outcome for row in rows] == [Outcome.DIFFERS] * 3


def test_mjcf_is_swept(workers: Workers, tmp_path: Path) -> None:
    file = written(tmp_path, "arm.xml", MJCF)
    plan = whole(file, workers, "geom[rod]@mass=0.5:4", engines=("mujoco",))
    rows = run_block(only_block(plan))
    assert [row.outcome for row in rows] == [Outcome.AGREES] * 3
    assert len({row.discrepancy for row in rows}) == 3


def test_pattern_matches_all_numbers_of_a_kind(urdf: Path, workers: Workers) -> None:
    plan = whole(urdf, workers, "link[*]/inertial/mass@value=x0.8:x1.25", engines=("mujoco",))
    named = tuple(f"link[{name}]/inertial/mass@value" for name in ("base", "upper", "fore"))
    assert plan.constants == named
    rows = run_block(only_block(plan))
    assert [row.outcome for row in rows] == [Outcome.AGREES] * 3
    for row in rows:
        assert all(1.6 <= row.constants[name] <= 2.5 for name in named)


def test_invalid_draw_is_a_failed_row(urdf: Path, workers: Workers) -> None:
    swept_options = replace(options(f"{MASS}=-2,3"), engines=("mujoco",), count=None)
    bad, good = run_block(only_block(plan_of(urdf, swept_options, workers)))
    assert bad.outcome is Outcome.FAILED
    assert urdf.name in bad.reason
    assert good.outcome is Outcome.AGREES


def test_steps_do_not_multiply_sampled_states(urdf: Path, workers: Workers) -> None:
    swept_options = replace(options(*VARY, steps=(0.001, 0.002)), engines=("mujoco",))
    assert plan_of(urdf, swept_options, workers).count == 3


def test_unknown_address_is_reported_with_similar_ones(urdf: Path, workers: Workers) -> None:
    with pytest.raises(SweepError, match=r"link\[fore\]/inertial/mass@value, .* more"):
        whole(urdf, workers, "link[fore]/inertial/mass=1:2", engines=("mujoco",))


def test_unusable_files_exit_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = written(tmp_path, "arm.urdf", "<robot/>")
    assert main(["sweep", str(robot), "--out", str(tmp_path / "out")]) == 2
    assert f"{robot}:1: it has no <link>" in capsys.readouterr().err
    assert main(["sweep", str(tmp_path / "none.urdf")]) == 2
    assert "there is no such file" in capsys.readouterr().err


def test_engine_errors_name_the_user_file(urdf: Path, workers: Workers) -> None:
    wrong = "link[fore]/inertial/inertia@ixx=100:200"  # above the sum of the other two moments
    rows = run_block(only_block(whole(urdf, workers, wrong, engines=("mujoco",))))
    for row in rows:
        assert row.outcome is Outcome.FAILED
        assert row.reason.startswith(f"{urdf}:4: MuJoCo can't load it")
        assert "drawn-" not in row.reason


DRAWN_MASS, DRAWN_DAMPING = "body[arm]/inertial@mass=1:4", "joint[swing]@damping=0.05:0.4"

BRANCHES = """from physics_crosscheck import Joint, MultibodySystem, RigidBody


def arm(name: str, mass: float, damping: float, parent: str | None = None) -> RigidBody:
    return RigidBody(
        name=name, parent=parent, position=(0.0, 0.0, 0.2), mass=mass, center=(0.3, 0.0, 0.0),
        inertia=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
        joints=(Joint(name=f"j_{name}", kind="hinge", axis=(0.0, 1.0, 0.0), damping=damping),),
    )


base = arm("base", 2.0, 0.1)
system = MultibodySystem(
    name="branches", title="two arms on one", source="a test", gravity=(0.0, 0.0, -9.81),
    bodies=(base, arm("left", 1.0, 0.2, "base"), arm("right", 3.0, 0.3, "base")),
)
"""
HINGE = (
    '<joint name="j_{0}" axis="0 1 0" damping="{1}"/>'
    '<inertial mass="{2}" pos="0.3 0 0" diaginertia="0.1 0.2 0.3"/>'
)
OTHER_ORDER = (
    '<mujoco><option timestep="0.002"/><worldbody><body name="base" pos="0 0 0.2">'
    + HINGE.format("base", 0.1, 2)
    + '<body name="right" pos="0 0 0.2">' + HINGE.format("right", 0.3, 3) + "</body>"
    + '<body name="left" pos="0 0 0.2">' + HINGE.format("left", 0.2, 1) + "</body>"
    + "</body></worldbody></mujoco>"
)  # fmt: skip
SWING = "\n".join((
    '<robot name="swing"><link name="world"/>',
    link("arm", inertial("2.0", "0.1 0.2 0.3", origin='<origin xyz="0.3 0 0"/>')),
    joint("swing", "world", "arm",
          '<origin xyz="0 0 1"/><axis xyz="0 1 0"/><dynamics damping="0.1"/>'),
    "</robot>",
))  # fmt: skip


def model(folder: Path, name: str, text: str, more: str = "") -> None:
    (folder / name).write_text(text)
    sidecar = f'engines = ["mujoco"]\n\n[settings]\nsmooth = true\n{more}'
    (folder / f"{name}.toml").write_text(sidecar)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Create one arm on a hinge: its declared bodies and an MJCF."""
    folder = tmp_path / "swing"
    folder.mkdir()
    (folder / "system.py").write_text(SYSTEM)
    model(folder, "m.xml", MODEL)
    return folder


def plan(folder: Path, workers: Workers, *vary: str) -> CasePlan:
    return plan_of(folder, replace(options(*vary), engines=("mujoco",)), workers)


def rows(whole: CasePlan) -> list[SweepRow]:
    swept.cache_clear()
    return [row for block in whole.blocks(bytes(whole.count)) for row in run_block(block)]


def test_drawn_numbers_of_a_model_file_agree_and_move_the_arm(
    folder: Path, workers: Workers
) -> None:
    results = rows(plan(folder, workers, DRAWN_MASS, DRAWN_DAMPING))
    assert [row.outcome for row in results] == [Outcome.AGREES] * 3
    assert len({row.discrepancy for row in results}) == 3
    assert {row.scenario for row in results} == {"states"}
    assert all(1 <= row.constants["body[arm]/inertial@mass"] <= 4 for row in results)


def test_wrong_number_in_a_drawn_copy_differs(
    folder: Path, workers: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def copy_with_fault(file: Path, texts: Mapping[Path, bytes], place: Path) -> Path:
        copy = copy_with_texts(file, texts, place)
        copy.write_text(
            copy.read_text().replace('diaginertia="0.1 0.2', 'diaginertia="0.1 0.20001')
        )
        return copy

    monkeypatch.setattr(swept_trees, "copy_with_texts", copy_with_fault)
    results = rows(plan(folder, workers, DRAWN_MASS))
    assert [row.outcome for row in results] == [Outcome.DIFFERS] * 3


def test_joints_in_another_order_are_matched_by_name(folder: Path, workers: Workers) -> None:
    (folder / "system.py").write_text(BRANCHES)
    model(folder, "m.xml", OTHER_ORDER)
    results = rows(plan(folder, workers, "joint[j_left]@damping=0.1:2"))
    assert [row.outcome for row in results] == [Outcome.AGREES] * 3
    assert [row.outcome for row in rows(plan(folder, workers))] == [Outcome.AGREES]


def test_model_without_varied_numbers_is_skipped(folder: Path, workers: Workers) -> None:
    model(folder, "m.urdf", SWING)
    whole = plan(folder, workers, DRAWN_MASS)
    assert whole.left_out == ("swing/m.urdf [mujoco] has none of the varied numbers",)
    assert {row.model for row in rows(whole)} == {"m.xml"}
    both = rows(plan(folder, workers, "*mass*=x0.5:x2"))
    assert {(row.model, *row.constants) for row in both} == {
        ("m.xml", "body[arm]/inertial@mass"),
        ("m.urdf", "link[arm]/inertial/mass@value"),
    }
    assert {row.outcome for row in both} == {Outcome.AGREES}


def test_address_with_two_values_is_rejected(folder: Path, workers: Workers) -> None:
    model(folder, "other.xml", MODEL.replace('mass="2.0"', 'mass="2.5"'))
    with pytest.raises(SweepError, match=r"inertial@mass is 2\.0 or 2\.5, depending on the model"):
        plan(folder, workers, DRAWN_MASS)


SPRING = "\n[[spring]]\njoints = { swing = 1 }\nstiffness = 1.0\ndamping = 0\nrest = 0\n"


@pytest.mark.parametrize(
    ("name", "text", "more"),
    [
        ("m.xml", MODEL.replace('mass="2.0"', 'mass="2.00001"'), ""),
        ("m.urdf", SWING, SPRING),  # it would need the spring's effect at each drawn mass
    ],
)
def test_file_that_differs_from_the_declaration_is_rejected(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, more: str
) -> None:
    if more:
        spring = 'name="swing", kind="hinge", stiffness=1.0,'
        declared = SYSTEM.replace('name="swing", kind="hinge",', spring)
        (folder / "system.py").write_text(declared)
    model(folder, name, text, more)
    arguments = ["sweep", str(folder / name), "--vary", "*mass*=1:4", "--draws", "2"]
    assert main([*arguments, "--out", str(folder.parent / "out")]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert f"{name}: the file alone differs from system.py by" in message
    assert "crosscheck run" in message
