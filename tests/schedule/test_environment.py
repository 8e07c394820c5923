"""Default environment of workers: one BLAS thread and a malloc threshold; user settings win."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.jobs.environment import DEFAULTS, MAPPED_FROM

ROOT = Path(__file__).resolve().parents[2]

PROGRAM = """
import sys
from physics_crosscheck.harness.interfaces.cli.main import program
early = "numpy" in sys.modules
sys.argv = ["crosscheck", "engines"]
program()
from tests.schedule.test_environment import environment_summary
print(early, environment_summary(None))
"""

LIBRARY = """
from physics_crosscheck.harness.jobs import workers as jobs
from tests.schedule.test_environment import environment_summary, is_mapped, set_here

jobs.PRELOADED = jobs.PRELOADED_TO_DERIVE = ()
with jobs.Workers(1) as workers:
    before = set_here()
    mapped = workers.outcome(workers.submit(is_mapped, 12_000_000))
    print(workers.outcome(workers.submit(environment_summary, None)), set_here() == before, mapped)
"""

IS_MMAPPED = 2
"""Flag of a chunk in glibc's malloc/malloc.c."""


def is_mapped(size: int) -> bool | None:
    """Return whether freed memory is mapped again instead of taken from the heap.

    Return None if the C library is not glibc.
    """
    if sys.platform != "linux":
        return None
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    libc.free.argtypes = [ctypes.c_void_p]
    libc.free(libc.malloc(size))  # glibc raises its threshold here, unless one is set
    place = libc.malloc(size)
    size_and_flags = ctypes.c_size_t.from_address(place - ctypes.sizeof(ctypes.c_size_t)).value
    libc.free(place)
    return bool(size_and_flags & IS_MMAPPED)


def set_here() -> list[str]:
    return [os.environ.get(name, "unset") for name in DEFAULTS]


def environment_summary(_: object) -> str:
    """Return the variables and the number of threads that a large matrix product starts."""
    import numpy as np

    before = len(os.listdir("/proc/self/task"))
    matrix = np.ones((600, 600))
    matrix @ matrix
    return f"{','.join(set_here())} {len(os.listdir('/proc/self/task')) - before}"


def last_line(program: str, **given: str) -> str:
    clean = {name: value for name, value in os.environ.items() if name not in DEFAULTS}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**clean, "PYTHONPATH": str(ROOT), **given},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1]


def test_program_sets_the_defaults_before_importing_numpy() -> None:
    assert last_line(PROGRAM) == "False 1,1,1,1,1048576,disable,cpu,false 0"


def test_library_sets_the_defaults_in_its_workers_only() -> None:
    printed, _, mapped = last_line(LIBRARY).rpartition(" ")
    assert printed == "1,1,1,1,1048576,disable,cpu,false 0 True"
    assert mapped == ("True" if sys.platform == "linux" else "None")


@pytest.mark.parametrize(("program", "rest"), [(PROGRAM, "False "), (LIBRARY, "")])
def test_user_settings_are_kept(program: str, rest: str) -> None:
    given = {"OPENBLAS_NUM_THREADS": "2", MAPPED_FROM: str(2**25), "JAX_PLATFORMS": "cuda"}
    printed = last_line(program, **given)
    assert printed.startswith(f"{rest}2,1,1,1,{2**25},disable,cuda,false ")
    assert program is PROGRAM or printed.endswith(" False" if sys.platform == "linux" else " None")
