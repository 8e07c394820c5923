"""What a cache saves: `python -m benchmarks.bench_cache [FOLDER ...]`; none: all built-in systems.

Whole processes, interpreter included: nothing known, all of it known, and one model file of each
folder changed (a comment).
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
from physics_crosscheck.harness.records.read import read_results

TIMES = 3


def timed(root: Path) -> tuple[float, int, int]:
    """Seconds, cases, and how many of them were had from the cache."""
    environment = {**os.environ, "PYTHONPATH": str(builtin().parent)}
    folders = [str(path.parent) for path in sorted(root.glob("models/*/system.py"))]
    began = time.perf_counter()
    subprocess.run(
        [
            sys.executable,
            "-m",
            "physics_crosscheck",
            "run",
            *folders,
            "--cache",
            "cache",
            "--out",
            "out",
        ],
        cwd=root,
        env=environment,
        capture_output=True,
        check=True,
    )
    seconds = time.perf_counter() - began
    found = read_results(root / "out" / "results.json")
    return seconds, len(found.cases), found.cached


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        for folder in sys.argv[1:] or [path.name for path in builtin().iterdir()]:
            shutil.copytree(builtin() / folder, root / "models" / folder)
        cold, cases, _ = timed(root)
        print(f"nothing known: {cold:.1f} s, {cases} cases")
        warm, _, cached = min(timed(root) for _ in range(TIMES))
        print(f"all known: {warm:.1f} s, {cached} had from the cache: {warm / cold:.3f} of it")
        for path in root.glob("models/*/mujoco.xml"):
            text = path.read_text()
            path.write_text(text.replace("<worldbody>", "<!-- changed --><worldbody>"))
        changed, _, cached = timed(root)
        print(f"a model file changed: {changed:.1f} s, {cached} had: {changed / cold:.3f} of it")


if __name__ == "__main__":
    main()
