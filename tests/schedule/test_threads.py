"""BLAS has one thread in each process, unless a user has set another number."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from harness.schedule.threads import COUNTS

BESIDE = Path(__file__).resolve().parents[2]

PROGRAM = """
import sys
from physics_crosscheck.main import main
early = "numpy" in sys.modules
sys.argv = ["crosscheck", "engines"]
main()
from tests.schedule.test_threads import found
print(early, found(None))
"""

LIBRARY = """
from harness.schedule.limits import Limits
from harness.schedule.workers import Workers
from tests.schedule.test_threads import found, set_here

with Workers(1, limits=Limits(seconds=60)) as workers:
    before = set_here()
    print(workers.outcome(workers.submit(found, None)), set_here() == before)
"""


def set_here() -> list[str]:
    return [os.environ.get(name, "unset") for name in COUNTS]


def found(_: object) -> str:
    """What is set, and how many threads a product starts that is worth some to BLAS."""
    import numpy as np

    before = len(os.listdir("/proc/self/task"))
    matrix = np.ones((600, 600))
    matrix @ matrix
    return f"{','.join(set_here())} {len(os.listdir('/proc/self/task')) - before}"


def last_line(program: str, **given: str) -> str:
    clean = {name: value for name, value in os.environ.items() if name not in COUNTS}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**clean, "PYTHONPATH": str(BESIDE), **given},
        cwd=BESIDE,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1]


def test_the_program_has_one_and_says_so_before_numpy_is_imported() -> None:
    assert last_line(PROGRAM) == "False 1,1,1,1 0"


def test_workers_of_a_library_have_one_and_the_library_is_left_as_it_was() -> None:
    assert last_line(LIBRARY) == "1,1,1,1 0 True"


@pytest.mark.parametrize(("program", "rest"), [(PROGRAM, "False "), (LIBRARY, "")])
def test_what_a_user_has_set_stands(program: str, rest: str) -> None:
    assert last_line(program, OPENBLAS_NUM_THREADS="2").startswith(f"{rest}2,1,1,1 ")
