"""What is run, and what an unchanged repository costs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from harness.baseline.changes import Status
from harness.numerics.version import VERSION
from tests.gate.conftest import Repository

ROOT = Path(__file__).parents[2]


def test_a_case_that_was_run_again_is_as_accepted(pristine: Repository) -> None:
    found = pristine.gate("pymunk", every=True)
    assert len(found.changes) == 3
    for change in found.changes:
        assert (change.status, change.kinds, change.messages) == (Status.SAME, (), ())
        assert change.case is not None
    record = found.record()
    assert record.passes
    assert {(one.system, one.model, one.engine, one.run) for one in record.cases} == {
        ("mass_spring_damper", "space.py", "pymunk", True)
    }
    assert {one.status for one in record.cases} == {"as accepted"}


def test_another_version_of_the_numerics_runs_everything_again(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("harness.baseline.fingerprint.VERSION", VERSION + 1)
    found = repository.gate("pymunk")
    assert {c.status for c in found.changes} == {Status.WITHIN}
    assert all(c.case is not None for c in found.changes)


def test_an_unchanged_repository_passes_without_sympy_or_an_engine(pristine: Repository) -> None:
    code = (
        "import sys; from harness.cli.main import main;"
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
        timeout=120,
        check=False,
    )
    assert done.stdout.splitlines()[-1] == "0", done.stdout + done.stderr
