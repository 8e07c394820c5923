"""Advice about many robot files: counts by kind and collection, and a sample to judge by hand.

`python -m campaigns.plausibility OUT.json NAME=FOLDER...` writes all advice and prints a table.
`python -m campaigns.plausibility --sample 60 OUT.json` prints a random sample of the advice.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import get_args

from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.records.finding import PlausibilityKind

SUFFIXES = (".urdf", ".xml", ".sdf")

ROOTS = (b"<robot", b"<mujoco", b"<sdf")

Row = dict[str, object]


def robot_files(folder: Path) -> Iterator[Path]:
    """Yield the model files of a folder; skip scenes, which repeat the robot file they include."""
    for path in sorted(folder.rglob("*")):
        if path.suffix not in SUFFIXES or not path.is_file() or path.stem.startswith("scene"):
            continue
        if any(root in path.read_bytes()[:20000] for root in ROOTS):
            yield path


def advice_of(path: Path) -> Iterator[Row]:
    """Yield the advice about a file."""
    robot = read_robot(path)
    for finding in plausibility_findings(robot):
        if finding.severity == "advice" and finding.location is not None:
            yield {
                "kind": finding.kind,
                "line": str(finding.location),
                "subject": finding.subject,
                "message": finding.message,
            }


def measure(collections: dict[str, Path]) -> Row:
    """Return the counts of files by collection, the refused files, and all advice."""
    rows: list[Row] = []
    files: Counter[str] = Counter()
    refused: list[str] = []
    for name, folder in collections.items():
        for path in robot_files(folder):
            began = time.perf_counter()
            try:
                if read_robot(path).tree is None:
                    refused.append(str(path))
                    continue
                advice = list(advice_of(path))
            except Exception as error:  # one file must not end the campaign
                refused.append(f"{path}: {type(error).__name__}: {error}")
                continue
            files[name] += 1
            seconds = time.perf_counter() - began
            rows += [{"collection": name, "file": str(path), **row} for row in advice]
            print(f"{path}: {len(advice)} in {seconds:.1f} s", file=sys.stderr, flush=True)
    return {"files": files, "refused": refused, "advice": rows}


def table(results: Row) -> Iterator[str]:
    """Yield a Markdown table with a row per kind and a column per collection."""
    files, rows = results["files"], results["advice"]
    assert isinstance(files, dict)
    assert isinstance(rows, list)
    counts = Counter((row["kind"], row["collection"]) for row in rows)
    yield f"| kind | {' | '.join(f'{name} ({files[name]} files)' for name in files)} | all |"
    yield f"|---|{'---|' * (len(files) + 1)}"
    for kind in get_args(PlausibilityKind):
        cells = [counts[kind, name] for name in files]
        yield f"| {kind} | {' | '.join(map(str, [*cells, sum(cells)]))} |"
    flagged = Counter(row["collection"] for row in {row["file"]: row for row in rows}.values())
    cells = [flagged[name] for name in files]
    yield f"| files with advice | {' | '.join(map(str, [*cells, sum(cells)]))} |"


def sample(results: Row, count: int) -> list[Row]:
    """Draw advice at random, equally from all kinds; prefer files not yet drawn for the kind."""
    rows = results["advice"]
    assert isinstance(rows, list)
    generator = random.Random(20261127)
    generator.shuffle(rows)
    kinds: dict[object, list[Row]] = {}
    for row in sorted(rows, key=lambda row: _repeats(rows, row)):
        kinds.setdefault(row["kind"], []).append(row)
    drawn: list[Row] = []
    while len(drawn) < count and any(kinds.values()):
        drawn += [waiting.pop(0) for waiting in kinds.values() if waiting]
    return drawn[:count]


def _repeats(rows: Sequence[Row], row: Row) -> int:
    """Return how many earlier rows have the same file and kind."""
    before = rows[: rows.index(row)]
    return sum((one["file"], one["kind"]) == (row["file"], row["kind"]) for one in before)


def main(given: Sequence[str] | None = None) -> None:
    """Write the advice and print the table, or print a sample."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.plausibility", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--sample", type=int, help="print this many findings of OUT.json")
    parser.add_argument("out", type=Path, metavar="OUT.json")
    parser.add_argument("collections", nargs="*", metavar="NAME=FOLDER")
    chosen = parser.parse_args(given)
    if chosen.sample:
        results = json.loads(chosen.out.read_text(encoding="utf-8"))
        for i, row in enumerate(sample(results, chosen.sample), start=1):
            print(f"{i}. [{row['kind']}] {row['line']}: {row['message']}")
        return
    pairs = (argument.partition("=") for argument in chosen.collections)
    results = measure({name: Path(folder) for name, _, folder in pairs})
    chosen.out.write_text(json.dumps(results, indent=1), encoding="utf-8")
    print("\n".join(table(results)))


if __name__ == "__main__":
    main()
