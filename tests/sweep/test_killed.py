"""Resumption of a sweep that was killed, as by a power failure."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.sweep.store import done, parts, read_plan, read_rows
from physics_crosscheck.harness.records.outcome import Outcome
from tests.faults.known_folder import environment
from tests.sweep.made import swept_folder

# One row per part and block, so that a few cases already have a middle.
SMALL = """
import sys
from physics_crosscheck.harness.extras.sweep import plan, store
plan.BLOCK = store.PART = 1
from physics_crosscheck.harness.interfaces.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_killed_sweep_resumes_and_runs_each_case_once(tmp_path: Path) -> None:
    folder, out = swept_folder(tmp_path / "mass", "mujoco.xml"), tmp_path / "out"
    words = [str(folder), "--vary", "k=20:100", "--draws", "6", "--jobs", "1", "--out", str(out)]
    command = [sys.executable, "-c", SMALL, "sweep", *words]
    first = subprocess.Popen(command, env=environment(), stderr=subprocess.DEVNULL)
    until = time.monotonic() + 120
    while len(parts(out)) < 2 and time.monotonic() < until:
        time.sleep(0.02)
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    plan = read_plan(out)
    assert plan is not None
    finished = {path: path.read_bytes() for path in parts(out)}
    there = done(out)
    assert 2 <= sum(there) < 6, "the sweep must be killed in the middle"
    (out / "rows" / ".part-000099.parquet").write_bytes(b"half of a")  # killed as it wrote
    second = subprocess.run(
        command, env=environment(), check=False, timeout=300, capture_output=True
    )
    assert second.returncode == 0, second.stderr
    assert {path: path.read_bytes() for path in finished} == finished
    rows = list(read_rows(out))
    assert sorted(row.index for row in rows) == list(range(6))
    assert len({row.constants["k"] for row in rows}) == 6
    assert all(row.outcome is Outcome.AGREES for row in rows)
    assert not list((out / "rows").glob(".part-*"))
