"""File of benchmark ratios by version of this package.

A ratio compares two times of one run, or is a count, so that the machine matters little. Smaller is
better. `ratios.json` is committed: run `make bench` after a change of version.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from physics_crosscheck.harness.numerics.version import VERSION

FILE = Path(__file__).with_name("ratios.json")

SLOWER = 1.25
"""Growth of a ratio that is reported. Two runs of one version differ by less on a busy machine."""

Ratios = Mapping[str, float]


def current_version() -> str:
    return f"{version('physics-crosscheck')}, numerics {VERSION}"


def read_ratios(file: Path = FILE) -> dict[str, dict[str, float]]:
    """Return the ratios by version, the oldest first."""
    if not file.exists():
        return {}
    ratios: dict[str, dict[str, float]] = json.loads(file.read_text(encoding="utf-8"))
    return ratios


def slower(ratios: Ratios, before: Ratios) -> list[str]:
    """Return a line for each ratio that grew."""
    return [
        f"slower: {name}: {ratio:.3g}, it was {before[name]:.3g}"
        for name, ratio in ratios.items()
        if name in before and ratio > SLOWER * before[name]
    ]


def store(ratios: Ratios, version_name: str, file: Path = FILE) -> list[str]:
    """Store the ratios of a version, and keep its others.

    Returns:
        A line for each ratio that grew since the version before it.
    """
    versions = read_ratios(file)
    earlier = [stored for name, stored in versions.items() if name != version_name]
    rounded = {name: float(f"{ratio:.3g}") for name, ratio in ratios.items()}
    versions[version_name] = {**versions.get(version_name, {}), **rounded}
    file.write_text(json.dumps(versions, indent=1) + "\n", encoding="utf-8")
    return slower(versions[version_name], earlier[-1]) if earlier else []
