"""Workers start with one thread of BLAS and a threshold of malloc, unless a user sets others."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.jobs.environment import DEFAULTS, MAPPED_FROM

BESIDE = Path(__file__).resolve().parents[2]

PROGRAM = """
import sys
from physics_crosscheck.harness.interfaces.cli.main import program
early = "numpy" in sys.modules
sys.argv = ["crosscheck", "engines"]
program()
from tests.schedule.test_environment import found
print(early, found(None))
"""

LIBRARY = """
from physics_crosscheck.harness.jobs import workers as jobs
from tests.schedule.test_environment import found, is_mapped, set_here

jobs.PRELOADED = jobs.PRELOADED_TO_DERIVE = ()
with jobs.Workers(1) as workers:
    before = set_here()
    mapped = workers.outcome(workers.submit(is_mapped, 12_000_000))
    print(workers.outcome(workers.submit(found, None)), set_here() == before, mapped)
"""

IS_MMAPPED = 2
"""Flag of a chunk in glibc's malloc/malloc.c."""


def is_mapped(size: int) -> bool | None:
    """Return whether memory that was freed once is mapped anew, not taken from the heap.

    None where the C library is another than glibc.
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


def found(_: object) -> str:
    """What is set, and how many threads a product starts that is worth some to BLAS."""
    import numpy as np

    before = len(os.listdir("/proc/self/task"))
    matrix = np.ones((600, 600))
    matrix @ matrix
    return f"{','.join(set_here())} {len(os.listdir('/proc/self/task')) - before}"


def last_line(program: str, **given: str) -> str:
    clean = {name: value for name, value in os.environ.items() if name not in DEFAULTS}
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
    assert last_line(PROGRAM) == "False 1,1,1,1,1048576,disable,cpu,false 0"


def test_workers_of_a_library_have_one_and_the_library_is_left_as_it_was() -> None:
    printed, _, mapped = last_line(LIBRARY).rpartition(" ")
    assert printed == "1,1,1,1,1048576,disable,cpu,false 0 True"
    assert mapped == ("True" if sys.platform == "linux" else "None")


@pytest.mark.parametrize(("program", "rest"), [(PROGRAM, "False "), (LIBRARY, "")])
def test_what_a_user_has_set_stands(program: str, rest: str) -> None:
    given = {"OPENBLAS_NUM_THREADS": "2", MAPPED_FROM: str(2**25), "JAX_PLATFORMS": "cuda"}
    printed = last_line(program, **given)
    assert printed.startswith(f"{rest}2,1,1,1,{2**25},disable,cuda,false ")
    assert program is PROGRAM or printed.endswith(" False" if sys.platform == "linux" else " None")
