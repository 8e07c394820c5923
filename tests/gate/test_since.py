"""What a run says of the baseline: known differences, and what changed since."""

from __future__ import annotations

import json
import shutil
from typing import NamedTuple

import jsonschema
import pytest
from rich.console import Console

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.interfaces.cli.accept import main
from physics_crosscheck.harness.interfaces.cli.commands import COMMANDS
from physics_crosscheck.harness.interfaces.cli.help import CommandParser
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.results import BaselineChanges, Results
from physics_crosscheck.harness.records.schema import schema
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.run import Options, run
from tests.gate.conftest import nothing
from tests.standing import brief, standing_only

pytestmark = pytest.mark.skipif(
    engines()["mujoco"].version() is None, reason="mujoco is not installed"
)


class Told(NamedTuple):
    """Results of runs as accepted, of changed files, of missing ones; and the table."""

    same: Results
    changed: Results
    gone: Results
    text: str


def changes(results: Results) -> BaselineChanges:
    assert results.baseline is not None
    return results.baseline


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Told:
    """A system with a model that agrees, accepted; then its step, a mass and a file are changed."""
    home = tmp_path_factory.mktemp("home")
    folder = home / "mass_spring_damper"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    standing_only(folder)
    brief(folder)
    (folder / "space.py").unlink()
    (folder / "space.py.toml").unlink()
    parser = CommandParser()
    parser.declare(COMMANDS["accept"])
    place = home / "baseline"
    given = ["--reason", "first", "--folder", str(folder), "--engine", "mujoco"]
    assert main(parser.parse_args([*given, "--baseline", str(place)])) == 0
    options = Options(("mujoco",), jobs=2, baseline=place)
    same = run([folder], options, nothing).results
    for name, old, new in (
        ("mujoco.xml", 'timestep="0.002"', 'timestep="0.001"'),
        ("robot.urdf.toml", "step = 0.002", "step = 0.004"),
    ):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    changed = run([folder], options, nothing).results
    for name in ("robot.urdf", "robot.urdf.toml"):
        (folder / name).unlink()
    gone = run([folder], options, nothing).results
    console = Console(record=True, width=200)
    print_results(console, changed)
    return Told(same, changed, gone, console.export_text())


@pytest.mark.slow
def test_nothing_is_told_where_nothing_changed(repository: Told) -> None:
    same = repository.same
    assert changes(same).changes == ()
    jsonschema.validate(json.loads(encoded(same)), schema(Results))


def test_a_better_and_a_worse_step_are_told_apart(repository: Told) -> None:
    changed = repository.changed
    jsonschema.validate(json.loads(encoded(changed)), schema(Results))
    kinds = {(c.model, c.label) for c in changes(changed).changes}
    assert kinds == {("mujoco.xml", "improved"), ("robot.urdf", "changed, worse")}
    assert all("step 0.002 s -> " in "; ".join(c.messages) for c in changes(changed).changes)


def test_what_is_gone_is_told(repository: Told) -> None:
    gone = repository.gone
    missing = [c for c in changes(gone).changes if c.status is Status.GONE]
    assert {c.model for c in missing} == {"robot.urdf"}
    assert len(missing) == 3


def test_the_terminal_lists_what_changed(repository: Told) -> None:
    text = repository.text
    assert "since " in text
    assert "changed, worse  XC515 mass_spring_damper/robot.urdf  free [mujoco]" in text
    assert ": step 0.002 s" in text
