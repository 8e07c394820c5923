"""Resumption of a sweep that was killed, as by a power failure."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.sweep.store import done, parts, read_rows
from physics_crosscheck.records import Outcome
from tests.faults.known_folder import environment
from tests.sweep.made import swept_folder

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
flush = store.Store.flush
def flush_and_die(self):
    flush(self)
    if len(list(self._folder.glob("part-*"))) == 3:
        os.kill(os.getpid(), signal.SIGKILL)
store.Store.flush = flush_and_die
"""
RUN = """
from physics_crosscheck.harness.interfaces.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_killed_sweep_resumes_and_runs_each_case_once(tmp_path: Path) -> None:
    folder, out = swept_folder(tmp_path / "mass", "mujoco.xml"), tmp_path / "out"
    words = [str(folder), "--vary", "k=20:100", "--draws", "6", "--jobs", "1", "--out", str(out)]
    first = sweep(SMALL + KILLED + RUN, words)
    assert first.returncode == -signal.SIGKILL, first.stderr
    finished = {path: path.read_bytes() for path in parts(out)}
    assert sum(done(out)) == 3
    (out / "rows" / ".part-000099.parquet").write_bytes(b"half of a")  # killed as it wrote
    second = sweep(SMALL + RUN, words)
    assert second.returncode == 0, second.stderr
    assert {path: path.read_bytes() for path in finished} == finished
    rows = list(read_rows(out))
    assert sorted(row.index for row in rows) == list(range(6))
    assert len({row.constants["k"] for row in rows}) == 6
    assert all(row.outcome is Outcome.AGREES for row in rows)
    assert not list((out / "rows").glob(".part-*"))


def sweep(script: str, words: list[str]) -> subprocess.CompletedProcess[str]:
    """Run a sweep with changed modules."""
    return subprocess.run(
        [sys.executable, "-c", script, "sweep", *words],
        env=environment(),
        check=False,
        timeout=300,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
