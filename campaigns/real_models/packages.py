"""Packages of PyPI that carry models, and where these are once one is installed."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

FOLDERS: Mapping[str, str] = MappingProxyType({
    "gymnasium": "gymnasium/envs/mujoco/assets",
    "dm-control": "dm_control",
    "pybullet": "pybullet_data",
    "example-robot-data": "cmeel.prefix/share/example-robot-data/robots",
})  # fmt: skip
"""Names in PyPI -> folders below site-packages."""


def folder_of(name: str) -> Path | None:
    """Where the models of a package are; None where it is not installed, or carries none here."""
    try:
        found = importlib.metadata.distribution(name).locate_file(FOLDERS[name])
    except (KeyError, importlib.metadata.PackageNotFoundError):
        return None
    folder = Path(str(found))
    return folder if folder.is_dir() else None
