"""Cases that the gate runs, and the cost of an unchanged repository."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.commands.gate.survey import GateOptions, survey
from physics_crosscheck.harness.engines.pymunk import PymunkEngine
from physics_crosscheck.harness.numerics.version import VERSION
from physics_crosscheck.harness.records.diff import Status
from tests.gate.conftest import SYSTEM, Repository

ROOT = Path(__file__).parents[2]


def test_repeated_case_is_as_accepted(pristine: Repository) -> None:
    result = pristine.gate("pymunk", every=True)
    assert len(result.changes) == 2
    for change in result.changes:
        assert (change.status, change.kinds, change.messages) == (Status.SAME, (), ())
        assert change.case is not None
    record = result.record()
    assert record.passes
    assert {(one.system, one.model, one.engine, one.run) for one in record.cases} == {
        ("mass_spring_damper", "space.py", "pymunk", True)
    }
    assert {one.status for one in record.cases} == {"as accepted"}


def chosen(repository: Repository) -> set[tuple[str, str]]:
    """Return the models to run, with their engines."""
    state = survey([repository.folder], GateOptions(baseline=repository.baseline))
    return {(model, engine) for _, model, engine in state.chosen}


def test_only_cases_that_depend_on_a_change_run(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Run only cases of a changed file or engine, but all cases after a change of numerics."""
    assert chosen(repository) == set()
    repository.edit("mujoco.xml", "<worldbody>", "<!-- moved --><worldbody>")
    assert chosen(repository) == {("mujoco.xml", "mujoco")}
    monkeypatch.setattr(PymunkEngine, "version", lambda _: "99.0")
    assert chosen(repository) == {("mujoco.xml", "mujoco"), ("space.py", "pymunk")}
    monkeypatch.setattr("physics_crosscheck.harness.baseline.fingerprint.VERSION", VERSION + 1)
    assert len(chosen(repository)) == 4


def test_unchanged_repository_passes_without_sympy_or_an_engine(pristine: Repository) -> None:
    code = (
        "import sys; from physics_crosscheck.harness.interfaces.cli.main import main;"
        "code = main(['gate', '--out', sys.argv[1]]);"
        "names = {'sympy', 'scipy', 'mujoco', 'pybullet', 'pymunk'};"
        "print(code, *sorted(names & set(sys.modules)))"
    )
    out = pristine.root / "out"
    done = subprocess.run(
        [sys.executable, "-c", code, str(out)],
        cwd=pristine.root,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        timeout=1800,
        check=False,
    )
    assert done.stdout.splitlines()[-1] == "0", done.stdout + done.stderr


def test_change_of_a_file_that_code_reads_or_tests_for_runs_again(
    repository: Repository,
) -> None:
    """Run folders again whose code reads elsewhere, and others when a hidden file changes."""
    hidden, soft = repository.folder / ".mass", repository.root / "soft.txt"
    hidden.write_text("1.3")
    here = "__import__('pathlib').Path(__file__).parent"
    mass = f"float({here}.joinpath('.mass').open('r+').read())"
    repository.edit("space.py", "Body(MASS, ", f"Body({mass}, ")
    repository.accept("read from a file", result=repository.gate("pymunk"))
    for case, entry in read_baseline(repository.baseline)[SYSTEM].cases.items():
        assert (".mass" in entry.files) == (case.engine == "pymunk")
    assert {c.case for c in repository.gate("pymunk").changes} == {None}
    hidden.write_text("1.4")
    result = repository.gate("pymunk")
    assert {c.status for c in result.changes} == {Status.CHANGED}
    assert [(diff.file, diff.models) for diff in result.file_diffs] == [(".mass", ("space.py",))]
    hidden.write_text("1.3")
    stiffness = f"47.0 + 0.5 * {here}.joinpath('../../soft.txt').exists()"
    repository.edit("system.py", '"k", 47.0', f'"k", {stiffness}')
    repository.accept("depends on a file outside", result=repository.gate("pymunk"))
    result = repository.gate("pymunk")
    assert None not in {c.case for c in result.changes}
    assert {c.status for c in result.changes} == {Status.SAME}
    assert str(repository.root) not in repository.file.read_text()
    soft.touch()
    assert {c.status for c in repository.gate("pymunk").changes} == {Status.CHANGED}
