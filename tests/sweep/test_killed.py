"""A sweep that is killed in the middle, as by a machine that loses its power."""

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

# A part a row, a row a block: so that there is a middle after a few cases.
SMALL = """
import sys
from physics_crosscheck.harness.extras.sweep import plan, store
plan.BLOCK = store.PART = 1
from physics_crosscheck.harness.interfaces.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_what_was_done_is_kept_and_the_rest_is_run_once(tmp_path: Path) -> None:
    folder, out = swept_folder(tmp_path / "mass", "mujoco.xml"), tmp_path / "out"
    asked = [str(folder), "--vary", "k=20:100", "--draws", "6", "--jobs", "1", "--out", str(out)]
    command = [sys.executable, "-c", SMALL, "sweep", *asked]
    first = subprocess.Popen(command, env=environment(), stderr=subprocess.DEVNULL)
    until = time.monotonic() + 120
    while len(parts(out)) < 2 and time.monotonic() < until:
        time.sleep(0.02)
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    plan = read_plan(out)
    assert plan is not None
    kept = {path: path.read_bytes() for path in parts(out)}
    there = done(out)
    assert 2 <= sum(there) < 6, "it was to be killed in the middle"
    (out / "rows" / ".part-000099.parquet").write_bytes(b"half of a")  # killed as it wrote
    second = subprocess.run(
        command, env=environment(), check=False, timeout=300, capture_output=True
    )
    assert second.returncode == 0, second.stderr
    assert {path: path.read_bytes() for path in kept} == kept
    rows = list(read_rows(out))
    assert sorted(row.index for row in rows) == list(range(6))
    assert len({row.constants["k"] for row in rows}) == 6
    assert all(row.outcome is Outcome.AGREES for row in rows)
    assert not list((out / "rows").glob(".part-*"))
