"""Savings of a cache: `python -m benchmarks.bench_cache [FOLDER ...]`; default: built-in systems.

Whole processes, interpreter included: with an empty cache, with a full one, and after a comment in
a model file of each folder.
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
    """Return seconds, number of cases, and how many of them the cache had."""
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
    results = read_results(root / "out" / "results.json")
    return seconds, len(results.cases), results.cached


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        for folder in sys.argv[1:] or [path.name for path in builtin().iterdir()]:
            shutil.copytree(builtin() / folder, root / "models" / folder)
        cold, cases, _ = timed(root)
        print(f"empty cache: {cold:.1f} s, {cases} cases")
        warm, _, cached = min(timed(root) for _ in range(TIMES))
        print(f"full cache: {warm:.1f} s, {cached} cases reused, ratio {warm / cold:.3f}")
        for path in root.glob("models/*/mujoco.xml"):
            text = path.read_text()
            path.write_text(text.replace("<worldbody>", "<!-- changed --><worldbody>"))
        changed, _, cached = timed(root)
        ratio = changed / cold
        print(f"a model file changed: {changed:.1f} s, {cached} cases reused, ratio {ratio:.3f}")


if __name__ == "__main__":
    main()
