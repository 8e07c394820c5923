"""Processor time of a process."""

from __future__ import annotations

import contextlib
import os
import subprocess
from pathlib import Path

STARVED = 0.005
"""Smallest share of the processor that a busy process gets, even on the busiest machine."""


def processor_seconds(pid: int) -> float:
    """Return the processor time of all its threads so far, seconds; 0 if unknown."""
    with contextlib.suppress(OSError, IndexError, ValueError):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    with contextlib.suppress(OSError, ValueError):  # macOS: [[days-]hours:]minutes:seconds
        answer = subprocess.run(
            ["ps", "-o", "time=", "-p", str(pid)], capture_output=True, text=True, check=False
        ).stdout.strip()
        days, _, rest = answer.rpartition("-")
        seconds = 0.0
        for part in rest.split(":"):
            seconds = 60 * seconds + float(part)
        return 86400 * float(days or 0) + seconds
    return 0.0


def is_waiting(used: float, elapsed: float) -> bool:
    """Return whether a process used so little processor time that it must be sleeping or stuck."""
    return used < STARVED * elapsed
