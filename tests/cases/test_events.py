"""Models whose contacts, limits and friction switch: verdicts in the engines."""

import io
import re
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from rich.console import Console

from physics_crosscheck import check
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare
from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.render.terminal.problems import print_problems
from physics_crosscheck.records import Case, CauseId

EVENTS = Path(__file__).parents[2] / "models" / "events"
MODELS = sorted(path.parent.name for path in EVENTS.glob("*/system.py"))


prepared = cache(prepare)
"""Prepares a folder once. Tests do not change a folder after preparing it."""


def tasks(folder: Path, *engines: str, ideal: bool = False) -> Iterator[SystemTask]:
    """Yield a task for each scenario of each model in the engines that it names."""
    target = prepared(folder, described=False, ideal=ideal)
    assert isinstance(target, PreparedSystem)
    for sidecar in model_files(folder):
        assert isinstance(sidecar, Sidecar)
        for engine in (one for one in sidecar.engines if one in (engines or ENGINES)):
            for scenario in target.motions:
                yield model_task(target, engine, sidecar, scenario=scenario)


ENGINES = "mujoco", "pybullet", "pymunk"


@pytest.fixture(scope="module")
def bounce(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the bouncing ball, dropped, with one bounce."""
    folder = tmp_path_factory.mktemp("events")
    copy = copy_of("bouncing_ball", folder, "system.py", "duration=1.5", "duration=0.6")
    file = copy / "system.py"
    thrown = re.compile(r'        Scenario\("thrown".*?duration=1.2\),\n', re.DOTALL)
    file.write_text(thrown.sub("", file.read_text()))
    return copy


def cases(folder: Path, *engines: str) -> list[Case]:
    """Judge every case of a folder, without an audit, a diagnosis or counted numbers."""
    return [run_case(task) for task in tasks(folder, *engines)]


def outcomes(folder: Path, engine: str) -> set[str]:
    """Return the outcomes of a folder's cases in an engine."""
    return {case.outcome.value for case in cases(folder, engine)}


def cause(folder: Path, engine: str) -> CauseId:
    """Return the first cause of a model that differs."""
    task = next(tasks(folder, engine))
    return diagnose_model(task).explanations[0].causes[0].id


def copy_of(name: str, folder: Path, file: str, old: str, new: str) -> Path:
    """Copy a built-in folder, with a change of a model file."""
    copy = folder / name
    shutil.copytree(EVENTS / name, copy)
    text = (copy / file).read_text()
    assert old in text
    (copy / file).write_text(text.replace(old, new))
    return copy


def test_bouncing_ball_agrees(bounce: Path) -> None:
    assert outcomes(bounce, "pymunk") == {"AGREES"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["ball_train", "buffered_cart", "filtered_motor", "saturated_servo", "soft_landing"]
)
def test_built_in_motion_with_events_agrees(name: str) -> None:
    """Judge quick ones; `make test-engines` judges all.

    The first scenario runs in every engine, the others in the first engine.
    """
    first, scenarios, engines = list[SystemTask](), set[str](), set[str]()
    for task in tasks(EVENTS / name):
        if task.engine not in engines or task.scenario not in scenarios:
            first.append(task)
        engines.add(task.engine)
        scenarios.add(task.scenario)
    for case in map(run_case, first):
        assert case.outcome.value == "AGREES", case.reason


def test_docs_page_lists_every_motion_in_every_engine() -> None:
    """Catch a model without a result, and a result without a model or a reason."""
    page = (EVENTS.parents[1] / "docs" / "method-events.md").read_text()
    rows = dict[str, list[tuple[str, str]]]()
    for line in page.splitlines():
        if line.startswith("| `") and line.count("|") == 6:
            name, _, *cells = (one.strip() for one in line.strip("|").split("|"))
            rows.setdefault(name.split("`")[1], []).extend(zip(ENGINES, cells, strict=True))
    assert sorted(rows) == MODELS
    for name, results in rows.items():
        files = (one for one in model_files(EVENTS / name) if isinstance(one, Sidecar))
        declared = {engine for one in files for engine in one.engines}
        for engine, cell in results:
            assert cell.startswith("cannot: ") == (engine not in declared), (name, engine, cell)


@pytest.mark.slow
def test_impact_that_depends_on_its_time_within_a_step_is_unresolved() -> None:
    (case,) = cases(EVENTS / "pendulum_stop", "pybullet")
    assert (case.outcome.value, case.kind) == ("UNRESOLVED", "not smooth")
    assert "no limit as the time step falls: after the event at t = 0.5782 s" in case.reason
    assert case.verdict is not None
    assert case.verdict.largest_uncertainty == pytest.approx(0.092, rel=0.05)


def test_rebound_that_vanishes_with_the_step_differs(bounce: Path) -> None:
    (case,) = cases(bounce, "pybullet")
    assert case.outcome.value == "DIFFERS"
    assert "z_dot is -0.000" in case.reason
    assert "by the place of the event in a step; the motion has 2." in case.reason


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "file", "old", "new", "engine"),
    [
        ("filtered_motor", "mujoco_exact.xml", 'dynprm="0.1"', 'dynprm="0.1000001"', "mujoco"),
        ("stopping_block", "robot.urdf", 'value="0.3"', 'value="0.3000003"', "pybullet"),
        ("buffered_cart", "mujoco.xml", '"-400 0"', '"-400.0004 0"', "mujoco"),
        ("saturated_servo", "mujoco.xml", 'range="-10 10"', 'range="-10 10.00001"', "mujoco"),
    ],
)
def test_fault_of_a_millionth_is_detected(
    tmp_path: Path, name: str, file: str, old: str, new: str, engine: str
) -> None:
    assert "DIFFERS" in outcomes(copy_of(name, tmp_path, file, old, new), engine)


def test_cause_of_a_wrong_restitution_is_named(bounce: Path, tmp_path: Path) -> None:
    changed = tmp_path / "bouncing_ball"
    shutil.copytree(bounce, changed)
    text = (changed / "space.py").read_text()
    (changed / "space.py").write_text(text.replace("RESTITUTION = 0.8", "RESTITUTION = 0.81"))
    assert cause(changed, "pymunk").subject == ("RESTITUTION",)


def test_rigid_equations_differ_by_the_rest_depth_of_a_soft_contact() -> None:
    results = check(EVENTS / "soft_landing", engines=["mujoco"], ideal=True)
    assert {case.outcome.value for case in results.cases} == {"DIFFERS"}
    (model,) = results.models
    assert model.diagnosis is not None
    (cause,) = model.diagnosis.explanations[0].causes
    assert (cause.kind, cause.subject) == ("law", ("the soft law of floor",))
    values = {(row.declared, row.quantity): row.value for row in model.acting}
    # (1 - d) g T^2 Z^2, with the numbers of the file.
    assert values[False, "rest depth"] == pytest.approx(0.1 * 9.81 * 0.02**2 * 0.7**2, rel=1e-9)
    assert values[True, "restitution"] == 0
    console = Console(width=80, file=io.StringIO(), record=True)
    print_problems(console, results)
    text = console.export_text()
    assert "rest depth 0.000192 m, creep 0.00341 m/s" in text
    assert "rigid: floor: friction 0, restitution 0" in text


@pytest.mark.slow
def test_changed_soft_law_is_not_a_cause_with_rigid_equations(tmp_path: Path) -> None:
    changed = copy_of("soft_landing", tmp_path, "mujoco.xml", 'solref="0.02', 'solref="0.021')
    diagnosis = diagnose_model(next(tasks(changed, "mujoco", ideal=True)))
    assert "law" not in {one.kind for fit in diagnosis.explanations for one in fit.causes}
