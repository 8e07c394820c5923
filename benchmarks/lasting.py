"""Ratios of a version of this package, kept in a file beside those of the versions before it.

A ratio is of two times, or a count, of one run: so that machines, and what else they do, count
little. All are better the smaller they are. `ratios.json` is committed: whoever changes a version
runs `make bench`, and sees what became slower.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from physics_crosscheck.harness.numerics.version import VERSION

FILE = Path(__file__).with_name("ratios.json")

SLOWER = 1.25
"""A ratio that grew by more is told: on a busy machine two runs of one version are so far apart."""

Ratios = Mapping[str, float]


def this_version() -> str:
    return f"{version('physics-crosscheck')}, numerics {VERSION}"


def kept(file: Path = FILE) -> dict[str, dict[str, float]]:
    """Ratios by version, the oldest first."""
    if not file.exists():
        return {}
    found: dict[str, dict[str, float]] = json.loads(file.read_text(encoding="utf-8"))
    return found


def slower(ratios: Ratios, before: Ratios) -> list[str]:
    """A line for each ratio that grew."""
    return [
        f"slower: {name}: {ratio:.3g}, it was {before[name]:.3g}"
        for name, ratio in ratios.items()
        if name in before and ratio > SLOWER * before[name]
    ]


def keep(ratios: Ratios, of: str, file: Path = FILE) -> list[str]:
    """Keep the ratios of a version; what it had stays where there is no new one.

    Returns:
        What became slower since the version before it, or, where it is the first, nothing.
    """
    known = kept(file)
    earlier = [one for name, one in known.items() if name != of]
    known[of] = {**known.get(of, {}), **{name: float(f"{r:.3g}") for name, r in ratios.items()}}
    text = json.dumps(known, indent=1) + "\n"
    file.write_text(text, encoding="utf-8")
    return slower(known[of], earlier[-1]) if earlier else []
