"""Changes of a run since the baseline was accepted."""

import json
import shutil

import jsonschema
import pytest
from rich.console import Console

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.records.schema import schema
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import Results
from tests.gate.conftest import ignore_progress
from tests.standing import keep_default_engines, shorten_scenarios, without

pytestmark = pytest.mark.skipif(
    engines()["mujoco"].version() is None, reason="mujoco is not installed"
)


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Accept models; then refine one step, coarsen another, delete a model and keep one."""
    home = tmp_path_factory.mktemp("home")
    folder = home / "mass_spring_damper"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    keep_default_engines(folder)
    without(folder, "step", "resonance")
    shorten_scenarios(folder, 8)
    for end in ("", ".toml"):
        (folder / f"space.py{end}").unlink()
        for name in ("gone.xml", "left.xml"):
            shutil.copy(folder / f"mujoco.xml{end}", folder / f"{name}{end}")
    place = home / "baseline"
    given = ["--reason", "first", "--folder", str(folder), "--engine", "mujoco"]
    assert main(["accept", *given, "--baseline", str(place)]) == 0
    for name, old, new in (
        ("mujoco.xml", 'timestep="0.002"', 'timestep="0.001"'),
        ("robot.urdf.toml", "step = 0.002", "step = 0.004"),
    ):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    for name in ("gone.xml", "gone.xml.toml"):
        (folder / name).unlink()
    options = Options(("mujoco",), jobs=2, baseline=place)
    return run([folder], options, ignore_progress).results


def test_changes_are_listed_and_unchanged_models_are_not(changed: Results) -> None:
    jsonschema.validate(json.loads(encoded(changed)), schema(Results))
    assert changed.baseline is not None
    changes = {c.model: c for c in changed.baseline.changes}
    assert {name: change.label for name, change in changes.items()} == {
        "mujoco.xml": "improved", "robot.urdf": "changed, worse", "gone.xml": "gone",
    }  # fmt: skip
    assert changes["gone.xml"].status is Status.GONE
    for name in ("mujoco.xml", "robot.urdf"):
        assert "step 0.002 s -> " in "; ".join(changes[name].messages)


def test_terminal_lists_changes(changed: Results) -> None:
    console = Console(record=True, width=200)
    print_results(console, changed)
    text = console.export_text()
    assert "since " in text
    assert "changed, worse  XC515 mass_spring_damper/robot.urdf  free [mujoco]" in text
    assert ": step 0.002 s" in text
