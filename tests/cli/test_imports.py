"""Commands import only what they need: more would cost a second every time."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.sweep.command import DESIGNS
from physics_crosscheck.harness.extras.sweep.factors import Design
from physics_crosscheck.harness.interfaces.cli.commands import COMMANDS
from physics_crosscheck.harness.interfaces.cli.registry import built_in_commands
from physics_crosscheck.harness.planning.cache import _environment
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Outcome, read_results
from tests.commands import crosscheck
from tests.faults.known_folder import KNOWN_ANSWER, known_folder
from tests.records.made import case, results, verdict
from tests.robots.files import ARM, LAMP

ROOT = Path(__file__).parents[2]

HEAVY = (
    "numpy", "sympy", "scipy", "msgspec", "jinja2", "rich", "multiprocessing",
    "mujoco", "pybullet", "pymunk", "pinocchio",
)  # fmt: skip


def imported(
    folder: Path, *commands: str, among: tuple[str, ...] = HEAVY, path: tuple[Path, ...] = (ROOT,)
) -> list[str]:
    """Run command lines in one process, and return which names are imported after each."""
    script = (
        "import sys; from physics_crosscheck.harness.interfaces.cli.main import main\n"
        f"for words in {commands!r}:\n"
        "    try:\n        main(words.split())\n"
        "    except SystemExit:\n        pass\n"
        f"    names = {set(among)!r} & set(sys.modules)\n"
        "    print('imported after', words, *sorted(names))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))},
    )
    lines = done.stdout.splitlines()
    assert len([line for line in lines if line.startswith("usage: ")]) == sum(
        "--help" in words for words in commands
    )
    return [line for line in lines if line.startswith("imported after ")]


@pytest.mark.parametrize("words", ["{} --help", "{} --nonsense"])
def test_parsing_arguments_imports_no_heavy_package(words: str, tmp_path: Path) -> None:
    commands = ["--help", "--nonsense", "rnu", *map(words.format, built_in_commands())]
    assert imported(tmp_path, *commands) == [f"imported after {given}" for given in commands]


def test_built_in_command_does_not_search_for_plugins(tmp_path: Path) -> None:
    commands = [f"{name} --help" for name in COMMANDS]
    registry = "physics_crosscheck.harness.interfaces.cli.registry"
    there = imported(tmp_path, *commands, "--help", among=("importlib.metadata", registry))
    assert there[:-1] == [f"imported after {given}" for given in commands]
    assert registry in there[-1]


def test_resolution_is_read_without_sympy(tmp_path: Path) -> None:
    given = "gate nowhere --resolution 1e-7"
    assert imported(tmp_path, given, among=("sympy", "scipy")) == [f"imported after {given}"]


def test_commands_without_physics_import_none(tmp_path: Path) -> None:
    off = verdict(discrepancy=0.01, largest_discrepancy=0.01)
    record = results(case(Outcome.AGREES), case(Outcome.DIFFERS, verdict=off))
    (tmp_path / "results.json").write_text(encoded(record))
    commands = ["new arm", "engines", "report results.json"]
    physics = ("sympy", "scipy", "mujoco", "pybullet", "pymunk", "pinocchio")
    there = imported(tmp_path, *commands, among=physics)
    assert there == [f"imported after {given}" for given in commands]
    assert (tmp_path / "index.html").is_file()
    assert (tmp_path / "arm" / "system.py").is_file()


def test_cached_results_need_no_equations(tmp_path: Path) -> None:
    known_folder(tmp_path / "osc", {"good": ""})
    command = "run osc --cache cache --jobs 1"
    _environment.cache_clear()  # a test before may have had other engines
    assert crosscheck(*command.split(), cwd=tmp_path, known_engine=True).returncode == 0
    commands = [command, "audit osc --cache cache"]
    there = imported(
        tmp_path, *commands, among=("sympy", "scipy", "mpmath"), path=(ROOT, KNOWN_ANSWER)
    )
    assert there == [f"imported after {given}" for given in commands]
    assert read_results(tmp_path / "reports" / "results.json").cached == 2


@pytest.mark.slow
def test_engines_run_in_other_processes(tmp_path: Path) -> None:
    """Keep crashes and output of engines out of the calling process."""
    pytest.importorskip("pybullet")
    (tmp_path / "a.urdf").write_text(ARM)
    (tmp_path / "b.xml").write_text(LAMP)
    command = "compare a.urdf b.xml --engine-a pybullet --engine-b mujoco --json found.json"
    assert imported(tmp_path, command, among=("mujoco", "pybullet")) == [
        f"imported after {command}"
    ]
    assert (tmp_path / "found.json").is_file()


def test_designs_of_a_sweep_match_the_enumeration() -> None:
    assert {*DESIGNS, Design.ALL.value} == {one.value for one in Design}
    assert DESIGNS[0] == Design.LATIN.value
