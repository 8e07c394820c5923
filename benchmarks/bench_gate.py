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


def timed(root: Path, *arguments: str) -> tuple[float, str]:
    environment = {**os.environ, "PYTHONPATH": str(builtin().parent), "CI": "1"}
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "physics_crosscheck", "gate", *arguments],
        cwd=root,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return time.perf_counter() - began, f"exit {done.returncode}; {done.stdout.splitlines()[-1]}"


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        shutil.copytree(builtin(), root / "models")
        baseline = builtin().parent / "reports" / "baseline"
        shutil.copytree(baseline, root / "reports" / "baseline")
        timed(root)
        unchanged = min(timed(root)[0] for _ in range(3))
        print(f"unchanged: {unchanged:.2f} s, {timed(root)[1]}")
        for folder in sorted(path.parent for path in root.glob("models/*/system.py")):
            path = folder / "mujoco.xml"
            text = path.read_text()
            path.write_text(text.replace("<worldbody>", "<!-- changed --><worldbody>"))
            seconds, summary = timed(root)
            path.write_text(text)
            more = seconds - unchanged
            verdict = "ok" if more <= LIMIT else "TOO SLOW"
            print(f"{folder.name}/mujoco.xml: {more:.2f} s more, {verdict}; {summary}")


if __name__ == "__main__":
    main()
