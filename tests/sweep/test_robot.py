"""Sweeps of robot files, whose numbers are drawn by address."""

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
from tests.robots.files import joint, link
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
        assert row.reason.startswith(f"{urdf}: MuJoCo can't load it")
        assert "drawn-" not in row.reason
