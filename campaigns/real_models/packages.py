"""Packages of PyPI with models, and the folders of the installed ones."""

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
    """Return the folder of a package's models; None if it is unknown or not installed."""
    try:
        location = importlib.metadata.distribution(name).locate_file(FOLDERS[name])
    except (KeyError, importlib.metadata.PackageNotFoundError):
        return None
    folder = Path(str(location))
    return folder if folder.is_dir() else None
