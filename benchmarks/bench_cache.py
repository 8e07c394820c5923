"""Savings of a cache: `python -m benchmarks.bench_cache [FOLDER ...]`; default: built-in systems.

Whole processes, interpreter included: with an empty cache, with a full one, and after a comment in
a model file of each folder.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks.bench_gate import changed_text, timed
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.read import read_results

TIMES = 3


def run(root: Path) -> tuple[float, int, int]:
    """Return seconds, number of cases, and how many of them the cache had."""
    folders = [str(path.parent) for path in sorted(root.glob("models/*/system.py"))]
    seconds, _ = timed(root, "run", *folders, "--cache", "cache", "--out", "out")
    results = read_results(root / "out" / "results.json")
    return seconds, len(results.cases), results.cached


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        for folder in sys.argv[1:] or [path.name for path in builtin().iterdir()]:
            shutil.copytree(builtin() / folder, root / "models" / folder)
        cold, cases, _ = run(root)
        print(f"empty cache: {cold:.1f} s, {cases} cases")
        warm, _, cached = min(run(root) for _ in range(TIMES))
        print(f"full cache: {warm:.1f} s, {cached} cases reused, ratio {warm / cold:.3f}")
        for path in root.glob("models/*/mujoco.xml"):
            changed_text(path)
        changed, _, cached = run(root)
        ratio = changed / cold
        print(f"a model file changed: {changed:.1f} s, {cached} cases reused, ratio {ratio:.3f}")


if __name__ == "__main__":
    main()
