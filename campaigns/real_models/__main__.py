"""Every robot of some folders, read and checked: `python -m campaigns.real_models FOLDER...`.

Prints what is read, a line a case as it comes, and tables of what became of them; see the README.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from campaigns.real_models.files import robot_files
from campaigns.real_models.reading import Reading, kind, survey, table
from harness.records.case import Case
from harness.run import Options, run


def line(case: Case) -> str:
    """Such as: AGREES mujoco kuka_iiwa/model.urdf E 8.3e-13 U 2.6e-10."""
    where = f"{case.outcome:<10} {case.engine:<9} {case.folder}"
    if case.verdict is None or case.reason:
        return f"{where}: {case.reason}"
    found = case.verdict
    return f"{where} E {found.largest_discrepancy:.1e} U {found.largest_uncertainty:.1e}"


def outcomes(cases: Iterable[Case]) -> str:
    """How many files of each format came out how, by engine; and why others have no verdict."""
    rows: Counter[str] = Counter()
    why: Counter[str] = Counter()
    for case in cases:
        rows[f"{Path(case.model).suffix} {case.engine:<9} {case.outcome}"] += 1
        if case.verdict is None:
            reason = case.reason.removeprefix(f"{case.folder}: ")
            why[f"{case.engine:<9} {kind(reason)[:150]}"] += 1
    return "\n\n".join([table("outcomes, files", rows), table("no verdict, files", why)])


def judged(readings: Sequence[Reading], cases: Iterable[Case]) -> str:
    """How many of the robots that move have a verdict in one engine at least."""
    there = {case.folder for case in cases if case.verdict is not None}
    lines = []
    for suffix in (".urdf", ".xml"):
        own = [one for one in readings if one.file.suffix == suffix]
        robots = [one for one in own if one.moves and one.loads]
        count = sum(str(one.file) in there for one in robots)
        share = f" ({count / len(robots):.1%})" if robots else ""
        lines.append(
            f"{suffix}: {len(own)} files, {len(robots)} of them robots that move, {count} with a"
            f" verdict{share}"
        )
    return "\n".join(lines)


def main() -> None:
    """Print what is read, then a line a case, and the counts."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.real_models", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--jobs", type=int, default=0)
    parser.add_argument("--floating", action="store_true", help="the roots of URDFs move freely")
    options = parser.parse_args()
    began = time.perf_counter()
    files = [file for folder in options.folder for file in robot_files(folder)]
    readings = [Reading.of(file) for file in files]
    print(survey(readings), flush=True)
    robots = [one.file for one in readings if one.moves]

    def progress(done: int, total: int, case: Case | None) -> None:
        told = f"[{done}/{total}, {time.perf_counter() - began:.0f} s]"
        print(told, line(case) if case else "", flush=True)

    wanted = Options(jobs=options.jobs, floating=options.floating)
    cases = run((), wanted, progress, robots=robots).results.cases
    print(f"\n{outcomes(cases)}\n\n{judged(readings, cases)}")


if __name__ == "__main__":
    main()
