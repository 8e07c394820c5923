"""The formats of robot files.

A new format is a package beside this module, and its line in `FORMATS`. The package has the
functions of `readers.Reader`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.documents.elements import xml_problem
from physics_crosscheck.harness.documents.expanded import RENAMED

HEAD_BYTES = 4096
"""Bytes of a file that contain its first element."""


@dataclass(frozen=True, kw_only=True)
class Format:
    """One format.

    Attributes:
        package: name of the package that reads it.
        is_xml: whether a file must be XML.
        strict: whether it must be well-formed; otherwise an engine's parser decides.
        head: pattern near the start of a robot's file; empty if only robots have the suffix.
    """

    package: str
    is_xml: bool = True
    strict: bool = True
    head: bytes = b""


FORMATS: Mapping[str, Format] = {
    ".urdf": Format(package="urdf"),
    ".sdf": Format(package="sdf"),
    ".xml": Format(package="mjcf", strict=False, head=rb"<mujoco(?!include)"),
}
"""Formats by suffix."""


def syntax_problem(file: Path) -> str:
    """Return why a robot's file is not XML, with its line and the remedy; empty if it may be, or
    has another syntax.
    """
    kind = FORMATS.get(file.suffix)
    return xml_problem(file, strict=kind.strict) if kind is not None and kind.is_xml else ""


def is_robot(file: Path) -> bool:
    """Return whether a file is a robot's: by its suffix and its first bytes."""
    kind = FORMATS.get(RENAMED.get(file.suffix, file.suffix))
    if kind is None or file.name.startswith("."):
        return False
    if not kind.head:
        return True
    if not file.is_file():  # opening a pipe could block
        return False
    try:
        with file.open("rb") as opened:
            return re.search(kind.head, opened.read(HEAD_BYTES)) is not None
    except OSError:
        return False
