"""Optional engines: tests run where they are installed, and report a skip elsewhere."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

from physics_crosscheck.engine import LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines, missing

EXTRAS = ("pinocchio", "drake", "dart", "idyntree")


H = 1e-4


def need(name: str) -> None:
    """Skip a test whose engine is not installed; fail it where it is required."""
    if engines()[name].version() is None:
        variable = "REQUIRE_PHYSX" if name == "physx" else "REQUIRE_ALL_ENGINES"
        refuse = pytest.fail if os.environ.get(variable) else pytest.skip
        refuse(missing(engines()[name]))


def load(
    name: str,
    text: str,
    folder: Path,
    gravity: float = 0.0,
    settings: Mapping[str, object] | None = None,
) -> LoadedModel:
    need(name)
    path = folder / f"{name}.urdf"
    path.write_text(text)
    values = {"step": H, "gravity": [0.0, 0.0, -gravity], **(settings or {})}
    return engines()[name].load(ModelSpec(path, settings=values))
