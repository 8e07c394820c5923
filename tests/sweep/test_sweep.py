"""Sweeps: factors and draws, rows, verdicts, invalid plans, failures and killed runs."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.extras.sweep.factors import (
    Design,
    Draws,
    SweepError,
    SweepOptions,
    draws,
    factor,
    factors,
    matching_factors,
)
from physics_crosscheck.harness.extras.sweep.main import planned, run_single, sweep
from physics_crosscheck.harness.extras.sweep.store import done, locked_rows, parts, read_rows
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.records.codes import case_code
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.load import load_system
from tests.faults.known_folder import ROOT, environment, one_scenario
from tests.models import edited
from tests.physics import copy_with_constants
from tests.sweep.made import options, plan_of, swept_folder

VARY = ("k=20:200:log", "m=0.8:2")


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2) as pool:
        yield pool


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept_folder(tmp_path_factory.mktemp("systems") / "mass", "mujoco.xml", "space.py")


def ignore_progress(*_: object) -> None:
    """Ignore progress."""


def rows_of(folder: Path, options: SweepOptions, out: Path, workers: Workers) -> list[SweepRow]:
    whole = plan_of(folder, options, workers)
    count = sweep(whole, out, workers, ignore_progress)
    results = sorted(read_rows(out), key=lambda row: row.index)
    assert [row.index for row in results] == list(range(whole.count))
    assert count == whole.count
    return results


def stable_fields(row: SweepRow) -> tuple[object, ...]:
    """Return the fields of a row that depend on its case only."""
    return (
        row.index, row.draw, row.name, row.integrator, row.step, row.constants, row.outcome,
        row.reason, row.discrepancy, row.uncertainty, row.digits, row.global_error, row.order,
        row.steps, row.command,
    )  # fmt: skip


@pytest.fixture(scope="module")
def rows(
    folder: Path, workers: Workers, tmp_path_factory: pytest.TempPathFactory
) -> list[SweepRow]:
    chosen = options(*VARY, steps=(0.001, 0.004))
    return rows_of(folder, chosen, tmp_path_factory.mktemp("rows"), workers)


def test_every_draw_runs_every_model_and_step_and_agrees(rows: list[SweepRow]) -> None:
    assert len(rows) == 3 * 2 * 2
    assert {(row.draw, row.engine, row.step) for row in rows} == {
        (draw, engine, step)
        for draw in range(3)
        for engine in ("mujoco", "pymunk")
        for step in (0.001, 0.004)
    }
    for row in rows:
        assert row.outcome is Outcome.AGREES, row.reason
        assert row.digits is not None
        assert row.digits > 9
        assert 0 < row.engine_seconds <= row.seconds
    for fine, coarse in zip(rows[::2], rows[1::2], strict=True):
        assert fine.global_error is not None
        assert coarse.global_error is not None
        assert coarse.global_error / fine.global_error == pytest.approx(4, rel=0.3)


def test_single_steps_decide_unless_thorough(
    rows: list[SweepRow], folder: Path, tmp_path: Path, workers: Workers
) -> None:
    by_engine = {row.engine: row.decided_by for row in rows}
    assert by_engine == {"mujoco": "single steps", "pymunk": "segments"}
    chosen = replace(options(*VARY, count=1), engines=("mujoco",), thorough=True)
    (thorough,) = rows_of(folder, chosen, tmp_path, workers)
    assert thorough.outcome is Outcome.AGREES
    assert thorough.decided_by == "segments"
    assert thorough.steps > 3 * next(row.steps for row in rows if row.engine == "mujoco")


def test_row_is_reproduced_from_its_index(
    rows: list[SweepRow], folder: Path, workers: Workers
) -> None:
    whole = plan_of(folder, options(*VARY, steps=(0.001, 0.004)), workers)
    for index in (1, 6, 11):
        assert stable_fields(run_single(whole, index, workers)) == stable_fields(rows[index])
    with pytest.raises(SweepError, match="--only 12: the plan has cases 0 to 11"):
        run_single(whole, 12, workers)


def written_by_hand(folder: Path, row: SweepRow, place: Path) -> tuple[Path, Sidecar]:
    """Create a folder that declares a row's constants, as a user would write it."""
    system = load_system(folder)
    original = read_sidecar(folder / f"{row.model}.toml")
    sidecar = copy_with_constants(system, original, row.constants, place)
    text = (folder / "system.py").read_text()
    declared = {c.name: c.value for c in system.constants}
    for name, value in row.constants.items():
        old = f'Constant("{name}", {declared[name]!r}'
        assert old in text
        text = text.replace(old, f'Constant("{name}", {value!r}')
    (place / "system.py").write_text(text)
    return place, sidecar


@pytest.mark.parametrize("index", [2, 5])
def test_row_has_the_verdict_of_a_run_with_its_constants(
    rows: list[SweepRow], folder: Path, index: int, tmp_path: Path
) -> None:
    row = rows[index]
    place, sidecar = written_by_hand(folder, row, tmp_path / "by_hand")
    prepared = prepare_system(place, described=False)
    stepped = {row.engine: {**sidecar.engine_settings.get(row.engine, {}), "step": row.step}}
    given = Sidecar(**{**vars(sidecar), "engine_settings": stepped})
    case = run_case(model_task(prepared, row.engine, given, scenario="free"))
    assert case.outcome is row.outcome
    assert case.verdict is not None
    assert case.verdict.decided_by == row.decided_by
    assert case.full_run is not None
    assert case.full_run.global_error == pytest.approx(row.global_error, rel=1e-6)
    assert row.discrepancy is not None
    assert row.uncertainty is not None
    assert case.verdict.discrepancy is not None
    assert abs(row.discrepancy - case.verdict.discrepancy) <= row.uncertainty < 1e-9
    assert case.verdict.order == (row.order and pytest.approx(row.order, rel=1e-3))


def test_wrong_model_differs_at_every_draw(workers: Workers, tmp_path: Path) -> None:
    folder = swept_folder(tmp_path / "mass", "mujoco.xml")
    model = folder / "mujoco.xml"
    assert 'damping="0.9"' in model.read_text()
    edited(model, 'damping="0.9"', 'damping="0.8"')
    results = rows_of(folder, options("k=20:60", count=2), tmp_path / "rows", workers)
    assert [row.outcome for row in results] == [Outcome.DIFFERS] * 2
    assert all("at the end of the segment" in row.reason for row in results)
    assert {row.code for row in results} == {case_code(Outcome.DIFFERS, "motion")}


def test_case_that_cannot_run_is_a_failed_row(
    folder: Path, workers: Workers, tmp_path: Path
) -> None:
    chosen = options("k=20:60", count=2, steps=(0.004, 1.5))
    results = rows_of(folder, chosen, tmp_path / "rows", workers)
    assert [row.outcome for row in results] == [Outcome.AGREES, Outcome.FAILED] * 4
    assert all("dt = 1.5 s is too long" in row.reason for row in results[1::2])
    assert {row.code for row in results[1::2]} == {case_code(Outcome.FAILED, "long step")}


@pytest.mark.workers
def test_case_that_ends_its_process_affects_no_other_case(workers: Workers, tmp_path: Path) -> None:
    folder = swept_folder(tmp_path / "mass", "space.py")
    model = folder / "space.py"
    text = model.read_text() + "\n\nimport os\n\nif STIFFNESS > 60:\n    os._exit(0)\n"
    model.write_text(text)
    results = rows_of(folder, options("k=20:100", count=5), tmp_path / "rows", workers)
    for row in results:
        dies = row.constants["k"] > 60
        assert row.outcome is (Outcome.FAILED if dies else Outcome.AGREES)
        assert not dies or "ends the process" in row.reason
    assert {row.outcome for row in results} == {Outcome.FAILED, Outcome.AGREES}


@pytest.mark.parametrize(
    ("invalid", "message"),
    [
        (options("kk=1:2"), "--vary kk: no system of these has such a constant; they have m, c, k"),
        (options("k=-1:2"), r"k=-1:2: .*system\.py declares k positive"),
        (
            SweepOptions(scenarios=("fast",)),
            "--scenario fast: unknown scenario; scenarios are free",
        ),
        (SweepOptions(integrators=("BDF",)), "--integrator BDF: no model has it; they have"),
    ],
)
def test_invalid_options_are_reported_with_valid_ones(
    invalid: SweepOptions, message: str, folder: Path, workers: Workers
) -> None:
    with pytest.raises(SweepError, match=message):
        plan_of(folder, invalid, workers)


def test_unbound_literal_is_reported_before_running(workers: Workers, tmp_path: Path) -> None:
    folder = swept_folder(tmp_path / "mass", "mujoco.xml")
    edited(folder / "mujoco.xml.toml", '"joint[x]@stiffness" = "k"\n', "")
    plan_of(folder, options("m=1:2"), workers)
    with pytest.raises(SweepError, match=r"mujoco\.xml\.toml: no number .* bound to k.*bind"):
        plan_of(folder, options("k=1:2"), workers)


def test_sweep_resumes_its_own_plan_only(folder: Path, workers: Workers, tmp_path: Path) -> None:
    chosen, out = options("k=20:60", count=4), tmp_path / "rows"
    whole = plan_of(folder, chosen, workers)
    sweep(whole, out, workers, ignore_progress)
    first = {row.index: row for row in read_rows(out)}
    (lost,) = parts(out)
    lost.unlink()
    sweep(whole, out, workers, ignore_progress)
    again = {row.index: row for row in read_rows(out)}
    assert {i: stable_fields(row) for i, row in again.items()} == {
        i: stable_fields(row) for i, row in first.items()
    }
    before = {path: path.read_bytes() for path in parts(out)}
    sweep(whole, out, workers, ignore_progress)
    assert {path: path.read_bytes() for path in parts(out)} == before
    with locked_rows(out), pytest.raises(SweepError, match="another sweep is writing to"):
        sweep(whole, out, workers, ignore_progress)
    other = plan_of(folder, options("k=20:60", count=4, seed=6), workers)
    with pytest.raises(SweepError, match=r"another plan \(seed: 5, now 6\); choose another --out"):
        sweep(other, out, workers, ignore_progress)


def test_systems_with_different_constants_can_share_a_sweep(
    folder: Path, workers: Workers, tmp_path: Path
) -> None:
    torsion = one_scenario("torsional_disc", tmp_path / "torsion", "free")
    for name in ("mujoco.xml", "mujoco.xml.toml"):
        shutil.copy(ROOT / "models" / "torsional_disc" / name, torsion / name)
    chosen = replace(options("m=1:2", "J=0.01:0.03", count=1), engines=("mujoco",))
    whole = planned(chosen, [folder, torsion], workers)
    sweep(whole, tmp_path / "rows", workers, ignore_progress)
    rows = {row.system: row for row in read_rows(tmp_path / "rows")}
    assert {name: set(row.constants) for name, row in rows.items()} == {
        "mass_spring_damper": {"m"},
        "torsional_disc": {"J"},
    }
    assert {row.outcome for row in rows.values()} == {Outcome.AGREES}


# One row per part and block, so that a few cases already have a middle.
SMALL = """
import os
import signal
import sys
from physics_crosscheck.harness.extras.sweep import plan, store
plan.BLOCK = store.PART = 1
"""
# Kill the process when its third part is written.
KILLED = """
close = store.Store.close
def close_and_die(self):
    close(self)
    if len(list(self._folder.glob("part-*"))) == 3:
        os.kill(os.getpid(), signal.SIGKILL)
store.Store.close = close_and_die
"""
RUN = """
from physics_crosscheck.harness.interfaces.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_killed_sweep_resumes_and_runs_each_case_once(tmp_path: Path) -> None:
    folder, out = swept_folder(tmp_path / "mass", "mujoco.xml"), tmp_path / "out"
    words = [str(folder), "--vary", "k=20:100", "--draws", "6", "--jobs", "1", "--out", str(out)]
    first = sweep_changed(SMALL + KILLED + RUN, words)
    assert first.returncode == -signal.SIGKILL, first.stderr
    finished = {path: path.read_bytes() for path in parts(out)}
    assert sum(done(out)) == 3
    (out / "rows" / ".part-000099.parquet").write_bytes(b"half of a")  # killed as it wrote
    second = sweep_changed(SMALL + RUN, words)
    assert second.returncode == 0, second.stderr
    assert {path: path.read_bytes() for path in finished} == finished
    rows = list(read_rows(out))
    assert sorted(row.index for row in rows) == list(range(6))
    assert len({row.constants["k"] for row in rows}) == 6
    assert all(row.outcome is Outcome.AGREES for row in rows)
    assert not list((out / "rows").glob(".part-*"))


def sweep_changed(script: str, words: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", script, "sweep", *words],
        env=environment(),
        check=False,
        timeout=300,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_ranges_and_lists_are_parsed() -> None:
    assert factor("k=10:30").value(0.25) == 15.0
    assert factor("k=10:1000:log").value(0.5) == pytest.approx(100.0)
    listed = factor("k=1,2,4")
    assert [listed.value(share) for share in (0.0, 0.34, 0.99, 1.0)] == [1.0, 2.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("k", "write NAME=LOW:HIGH"),
        ("k=", "write NAME=LOW:HIGH"),
        ("k=3:2", "3 is not below 2"),
        ("k=0:2:log", "values above zero"),
        ("k=1:2:lin", "only `:log`"),
        ("k=1:2:3:4", "only `:log`"),
        ("k=a:2", "'a' is not a number"),
        ("k=1,nan", "'nan' is not a finite number"),
        ("k=1,1", "twice"),
        ("k=x1:2", "either all"),
        ("k=xx1:x2", "'x1' is not a number"),
    ],
)
def test_invalid_range_is_rejected_with_a_hint(text: str, message: str) -> None:
    with pytest.raises(SweepError, match=f"--vary {text}.*{message}"):
        factor(text)


CONSTANTS = {"link[a]@mass": 2.0, "link[b]@mass": 0.5, "link[b]@ixy": 0.0, "x": -4.0}


def test_multiples_and_patterns_use_declared_values() -> None:
    light, heavy = matching_factors(factors(["link[*]@mass=x0.5:x1.5"]), CONSTANTS)
    assert (light.name, light.low, light.high) == ("link[a]@mass", 1.0, 3.0)
    assert (heavy.name, heavy.low, heavy.high) == ("link[b]@mass", 0.25, 0.75)
    (below,) = matching_factors(factors(["x=x1:x2"]), CONSTANTS)
    assert (below.low, below.high) == (-8.0, -4.0)
    (listed,) = matching_factors(factors(["x=x1,x3"]), CONSTANTS)
    assert listed.values == (-4.0, -12.0)
    # Zero has no multiples; brackets and dots of a name are literal.
    assert [
        match.name
        for match in matching_factors(factors(["*ix*=x1:x2", "link.a.@mass=1:2"]), CONSTANTS)
    ] == []


@pytest.mark.parametrize(("texts", "message"), [
    (["link[b]@ixy=x1:x2"], r"--vary link\[b\]@ixy: it is 0"),
    (["link[*]@mass=1:2", "link[a]@mass=1:2"], r"--vary link\[a\]@mass: two options mean it"),
    (["x=x1:x2:log"], "--vary x: it is below zero"),
    (["k=1:2", "k=3,4"], "k: it is varied twice"),
])  # fmt: skip
def test_factor_that_does_not_fit_is_rejected(texts: list[str], message: str) -> None:
    with pytest.raises(SweepError, match=message):
        matching_factors(factors(texts), CONSTANTS)


def test_range_without_draws_is_rejected() -> None:
    with pytest.raises(SweepError, match=r"--vary k: .*--draws N"):
        draws(factors(["m=1,2", "k=1:2"]), Design.LATIN, None, 0)


TWO = factors(["k=10:1000:log", "m=1:3"])
DESIGNS = (Design.LATIN, Design.SOBOL, Design.RANDOM)


def draws_of(design: Design, seed: int = 7, count: int = 32) -> Draws:
    return draws(TWO, design, count, seed)


@pytest.mark.parametrize("design", DESIGNS)
def test_draw_depends_only_on_seed_and_index(design: Design) -> None:
    forward = [draws_of(design).point_at(i) for i in range(32)]
    once = draws_of(design)
    assert [once.point_at(i) for i in reversed(range(32))] == forward[::-1]
    assert draws_of(design).point_at(19) == forward[19]
    assert draws_of(design, seed=8).point_at(19) != forward[19]
    assert all(10 <= point["k"] <= 1000 and 1 <= point["m"] <= 3 for point in forward)


@pytest.mark.parametrize("design", [Design.LATIN, Design.SOBOL])
def test_each_part_of_each_range_is_drawn_once(design: Design) -> None:
    points = [draws_of(design).point_at(i) for i in range(32)]
    logarithms = np.log([point["k"] / 10 for point in points]) / np.log(100)
    masses = np.array([(point["m"] - 1) / 2 for point in points])
    for shares in (logarithms, masses):
        assert sorted(np.floor(32 * shares).astype(int)) == list(range(32))


def test_listed_values_without_draws_are_combined() -> None:
    every = draws(factors(["a=1,2", "b=3,4,5"]), Design.LATIN, None, 0)
    points = [tuple(every.point_at(i).values()) for i in range(every.count)]
    assert points == [(a, b) for a in (1, 2) for b in (3, 4, 5)]


def test_no_factors_give_one_draw() -> None:
    none = draws((), Design.SOBOL, 50, 0)
    assert (none.count, none.point_at(0)) == (1, {})
