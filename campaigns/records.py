"""Store the records of every command for six systems and six robots, and compare two such stores.

`python -m campaigns.records store DIR` runs `run`, `gate`, `compare`, `mutate` and `sweep`, and
stores their records in DIR. `python -m campaigns.records diff OLD NEW` prints the values that
differ; its exit code is 1 if any does. Use both around a change that should change no result:

    python -m campaigns.records store /tmp/before     # in a checkout before the change
    python -m campaigns.records store /tmp/after
    python -m campaigns.records diff /tmp/before /tmp/after --rename global_error=error_at_dt
"""

from __future__ import annotations

import argparse
import json
import math
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from campaigns.real_models.packages import folder_of

ROOT = Path(__file__).parents[1]
ENGINES = ("mujoco", "pybullet", "pymunk")
SYSTEMS = ("models",)

ROBOTS: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "kuka": ("pybullet", "kuka_iiwa/model.urdf", ()),
    "panda": ("pybullet", "franka_panda/panda.urdf", ()),
    "cartpole": ("pybullet", "cartpole.urdf", ()),
    "a1": ("pybullet", "a1/a1.urdf", ("--floating",)),
    "ant": ("gymnasium", "ant.xml", ()),
    "humanoid": ("gymnasium", "humanoid.xml", ()),
}
"""Name -> package, file in it, options."""

PAIRS: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "arm": ("docs/cases/arm.urdf", "docs/cases/arm.xml", ()),
    "link": ("docs/cases/link.xml", "docs/cases/link_imported.xml", ()),
    "kuka": ("kuka", "kuka", ("--engine-a", "mujoco", "--engine-b", "pybullet")),
    "panda": ("panda", "panda", ("--engine-a", "mujoco", "--engine-b", "pybullet")),
    "humanoid": ("humanoid", "humanoid", ()),
}
"""Name -> two files, or names of robots, and options."""

PLACE = "checkout.txt"
"""File of a store with the path of its checkout, which the records contain."""

VOLATILE = re.compile(r"(^|_)(created|seconds|versions|version|date|mtime)$")
"""Keys whose values differ between two runs of the same code."""


def robot(name: str) -> Path:
    """Return the file of a robot, or of a model of this repository.

    Raises:
        SystemExit: if its package is not installed.
    """
    if name not in ROBOTS:
        return ROOT / name
    package, file, _ = ROBOTS[name]
    folder = folder_of(package)
    if folder is None:
        sys.exit(f"{package} is not installed: python -m pip install {package}")
    return folder / file


def commands(store: Path, parts: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield the name of each record and the command that writes it."""
    engines = [word for name in ENGINES for word in ("--engine", name)]
    models = [str(path.parent) for path in sorted((ROOT / "models").glob("*/system.py"))]
    if "run" in parts:
        yield "run/systems", ["run", *models, *engines, "--out", str(store / "run/systems")]
        for name, (_, _, options) in ROBOTS.items():
            out = ["--out", str(store / f"run/{name}")]
            yield f"run/{name}", ["run", str(robot(name)), *engines[:4], *options, *out]
    if "gate" in parts:
        yield "gate", ["gate", *models, *engines, "--all", "--out", str(store / "gate")]
    if "compare" in parts:
        for name, (a, b, options) in PAIRS.items():
            file = str(store / f"compare/{name}.json")
            pair = [str(robot(a)), str(robot(b))]
            yield f"compare/{name}", ["compare", *pair, *options, "--json", file]
    if "mutate" in parts:
        for folder in models:
            file = str(store / f"mutate/{Path(folder).name}.json")
            yield f"mutate/{Path(folder).name}", ["mutate", folder, "--json", file]
    if "sweep" in parts:
        vary = ["--vary", "k1=30:110", "--draws", "6", "--seed", "1"]
        system = str(ROOT / "models/anchored_pair")
        yield "sweep", ["sweep", system, *vary, "--out", str(store / "sweep")]


def store_records(store: Path, parts: Sequence[str]) -> int:
    """Run every command once, and store its records and its exit code.

    Returns:
        Number of commands with an exit code other than 0 and 1.
    """
    store.mkdir(parents=True, exist_ok=True)
    file = store / "exit_codes.json"
    codes = json.loads(file.read_text()) if file.exists() else {}
    failures = 0
    for name, words in commands(store, parts):
        (store / name).parent.mkdir(parents=True, exist_ok=True)
        ran = subprocess.run(
            [sys.executable, "-m", "physics_crosscheck", *words],
            cwd=ROOT, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        codes[name] = ran.returncode
        print(f"{name}: exit code {ran.returncode}", flush=True)
        if ran.returncode not in (0, 1):
            failures += 1
            print(ran.stderr[-2000:], file=sys.stderr)
    file.write_text(json.dumps(codes, indent=1, sort_keys=True))
    (store / PLACE).write_text(str(ROOT))
    return failures


Leaf = str | float | bool | None


def leaves(value: Any, path: str, renamed: Mapping[str, str]) -> Iterator[tuple[str, Leaf]]:
    """Yield each value of a record with its path, except values that differ in each run."""
    if isinstance(value, dict):
        for key, item in value.items():
            if not VOLATILE.search(key):
                yield from leaves(item, f"{path}.{renamed.get(key, key)}", renamed)
    elif isinstance(value, list):
        yield f"{path}#", len(value)
        for index, item in enumerate(value):
            yield from leaves(item, f"{path}[{index}]", renamed)
    else:
        yield path, value


def read_store(store: Path, renamed: Mapping[str, str]) -> dict[str, Leaf]:
    """Return all values of a store by file and path.

    Raises:
        SystemExit: if the folder is not a store.
    """
    if not (store / "exit_codes.json").is_file():
        sys.exit(f"{store} is not a store; run `python -m campaigns.records store {store}`")
    place = (store / PLACE).read_text() if (store / PLACE).is_file() else ""
    values: dict[str, Leaf] = {}
    for file in sorted([*store.rglob("*.json"), *store.rglob("*.jsonl")]):
        name = file.relative_to(store).as_posix()
        text = file.read_text().replace(str(store), "STORE")
        if place:
            text = text.replace(place, "CHECKOUT")
        texts = text.splitlines() if file.suffix == ".jsonl" else [text]
        records = [json.loads(one) for one in texts if one.strip()]
        if file.suffix == ".jsonl":  # workers end in any order
            records.sort(key=lambda one: json.dumps(one.get("index", one), sort_keys=True))
        for index, record in enumerate(records):
            values.update(leaves(record, f"{name}:{index or ''}", renamed))
    return values


def difference(old: Leaf, new: Leaf) -> float:
    """Return the relative difference of two numbers; infinity for other values that differ."""
    if type(old) is type(new) and old == new:
        return 0.0
    both = (old, new)
    if not all(isinstance(one, int | float) and not isinstance(one, bool) for one in both):
        return math.inf
    a, b = float(old), float(new)  # type: ignore[arg-type]
    return abs(a - b) / max(abs(a), abs(b), sys.float_info.min)


def kind(path: str) -> str:
    """Return a path without the indices of its lists."""
    return re.sub(r"\[\d+\]", "[]", re.sub(r":\d*\.", ":.", path))


def diff_lines(old: Mapping[str, Leaf], new: Mapping[str, Leaf], limit: int) -> list[str]:
    """Return a line for each kind of value that differs, most frequent first."""
    counts: Counter[str] = Counter()
    examples: dict[str, str] = {}
    largest: dict[str, float] = {}
    for path in old.keys() | new.keys():
        if path not in new or path not in old:
            row, example, size = f"{kind(path)} {'gone' if path in old else 'new'}", path, 0.0
        else:
            size = difference(old[path], new[path])
            if not size:
                continue
            row, example = kind(path), f"{path}: {old[path]!r} -> {new[path]!r}"
        counts[row] += 1
        if row not in examples or size > largest[row]:
            examples[row], largest[row] = example, size
    return [
        f"{count} x {row}  {examples[row][:limit]}"
        + (f"  ({largest[row]:.1e} relative)" if 0 < largest[row] < math.inf else "")
        for row, count in counts.most_common()
    ]


def main() -> int:
    """Store records, or compare two stores; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.records", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    chosen = parser.add_subparsers(dest="command", required=True)
    storing = chosen.add_parser("store", help="run every command and store its records")
    storing.add_argument("store", type=Path)
    every = ("run", "gate", "compare", "mutate", "sweep")
    storing.add_argument("--only", action="append", choices=every, help="run only this command")
    comparing = chosen.add_parser("diff", help="compare two stores")
    comparing.add_argument("old", type=Path)
    comparing.add_argument("new", type=Path)
    comparing.add_argument(
        "--rename", action="append", default=[], metavar="OLD=NEW", help="a key that was renamed"
    )
    comparing.add_argument("--width", type=int, default=160, help="characters of an example [160]")
    options = parser.parse_args()
    if options.command == "store":
        return int(store_records(options.store.resolve(), options.only or every) > 0)
    renamed = dict(text.split("=", 1) for text in options.rename)
    old, new = (
        read_store(options.old.resolve(), renamed),
        read_store(options.new.resolve(), renamed),
    )
    lines = diff_lines(old, new, options.width)
    print("\n".join(lines) or f"{len(old)} values are equal")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
