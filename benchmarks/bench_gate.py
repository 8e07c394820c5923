"""Times of the gate on the built-in models: `python -m benchmarks.bench_gate`.

Whole processes, interpreter included: an unchanged repository, and one model file of each system
changed (a comment). Either may take 5 s, the second 5 s more than the first.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import builtin

LIMIT = 5.0


def timed(root: Path, *words: str) -> tuple[float, str]:
    """Run `crosscheck` in a folder; return the seconds, and its exit code and last line."""
    environment = {**os.environ, "PYTHONPATH": str(builtin().parent), "CI": "1"}
    command = [sys.executable, "-m", "physics_crosscheck", *words]
    began = time.perf_counter()
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True)
    seconds = time.perf_counter() - began
    return seconds, f"exit {done.returncode}; {done.stdout.splitlines()[-1]}"


def changed_text(path: Path) -> str:
    """Add a comment to an MJCF, and return its text before."""
    text = path.read_text()
    path.write_text(text.replace("<worldbody>", "<!-- changed --><worldbody>"))
    return text


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        shutil.copytree(builtin(), root / "models")
        baseline = builtin().parent / "reports" / "baseline"
        shutil.copytree(baseline, root / "reports" / "baseline")
        timed(root, "gate")
        unchanged, summary = min(timed(root, "gate") for _ in range(3))
        print(f"unchanged: {unchanged:.2f} s, {summary}")
        for folder in sorted(path.parent for path in root.glob("models/*/system.py")):
            path = folder / "mujoco.xml"
            text = changed_text(path)
            seconds, summary = timed(root, "gate")
            path.write_text(text)
            more = seconds - unchanged
            verdict = "ok" if more <= LIMIT else "TOO SLOW"
            print(f"{folder.name}/mujoco.xml: {more:.2f} s more, {verdict}; {summary}")


if __name__ == "__main__":
    main()
