"""Which names of a command line are robots' files."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import FORMATS
from physics_crosscheck.harness.results.visible import odd_name, visible

_TOLD = f"{', '.join(FORMATS[:-1])} and {FORMATS[-1]}"


@dataclass(frozen=True)
class NamedRobots:
    """What names of a command line mean.

    Attributes:
        files: robots' files, each once.
        others: names that are none.
        faults: names of files that are not there, or that can't be checked alone -> what is said of
            each.
    """

    files: list[Path]
    others: list[str]
    faults: Mapping[str, str]


def robot_files(names: Sequence[str]) -> NamedRobots:
    """Those that are files, or would be by their endings, and the other names."""
    files, others, faults = list[Path](), list[str](), dict[str, str]()
    for name in names:
        path = Path(name)
        if path.suffix in FORMATS and not path.exists():
            faults[name] = f"{visible(name)}: there is no such file"
            continue
        if not path.is_file():
            others.append(name)
            continue
        if path.suffix not in FORMATS:
            formats = f"only {_TOLD} run without a folder; name one of these, or a system folder"
            faults[name] = f"{visible(name)}: {xacro_remedy(path) or formats}"
        elif (why := odd_name(name)) is not None:
            faults[name] = f"{visible(name)}: its name has {why}; rename it"
        elif path not in files:
            files.append(path)
    return NamedRobots(files, others, faults)


def xacro_remedy(file: Path) -> str:
    """Return how a robot is made of source for xacro; empty for any other file."""
    if file.suffix != ".xacro":
        return ""
    stem = file.name.removesuffix(".xacro")
    robot = file.with_name(stem if Path(stem).suffix == ".urdf" else f"{stem}.urdf")
    source, target = (visible(shlex.quote(str(one))) for one in (file, robot))
    return (
        "it is source for xacro, which no engine reads; expand it with"
        f" `xacro {source} > {target}`, and give {target}"
    )
