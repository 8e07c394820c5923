"""Every robot of a folder, read and checked: `python -m campaigns.real_models FOLDER [--jobs 2]`.

Of PyBullet's own robots: `python -c "import pybullet_data as d; print(d.getDataPath())"`.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

from campaigns.real_models.reading import survey
from harness.records.case import Case
from harness.robots.urdf import read_urdf_robot
from harness.run import Options, run


def moving(folder: Path) -> list[Path]:
    """URDFs that have a tree with joints, or that can't be read."""
    robots = [read_urdf_robot(path) for path in sorted(folder.rglob("*.urdf"))]
    return [one.file for one in robots if one.tree is None or one.tree.links]


def line(case: Case) -> str:
    """Such as: AGREES mujoco kuka_iiwa/model.urdf E 8.3e-13 U 2.6e-10."""
    where = f"{case.outcome:<10} {case.engine:<9} {case.folder}"
    if case.verdict is None or case.reason:
        return f"{where}: {case.reason}"
    found = case.verdict
    return f"{where} E {found.largest_discrepancy:.1e} U {found.largest_uncertainty:.1e}"


def main() -> None:
    """Print what is read, then a line a case, and the counts."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.real_models", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=0)
    options = parser.parse_args()
    print(survey(options.folder))
    files = moving(options.folder)
    results = run((), Options(jobs=options.jobs), lambda *_: None, robots=files).results
    print("\n".join(line(case) for case in results.cases))
    counts = Counter((case.engine, str(case.outcome)) for case in results.cases)
    print(f"{len(files)} robots, {results.seconds:.0f} s")
    for (engine, outcome), count in sorted(counts.items()):
        print(f"{engine:<10} {outcome:<10} {count}")


if __name__ == "__main__":
    main()
