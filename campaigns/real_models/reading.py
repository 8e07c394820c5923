"""How much of a list of robots' files is read.

How many have a tree, what is in the way of the others, what is left out, and how many have inertias
that no body can have.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.robots.inertias import impossible
from harness.robots.named import read_robot
from harness.robots.robot import Robot

STILL = "it has no joint that moves"
REFUSED = "can't load it"


@dataclass(frozen=True)
class Reading:
    """What reading a file gave, without its arrays.

    Attributes:
        file: that was read.
        tree: whether it has one.
        freedoms: of its tree, in classes.
        obstacles: with file and line.
        kinds: of its obstacles, without names and numbers.
        left_out: kinds of what is.
        impossible: kinds of impossible inertias.
    """

    file: Path
    tree: bool
    freedoms: str
    obstacles: tuple[str, ...]
    kinds: frozenset[str]
    left_out: frozenset[str]
    impossible: frozenset[str]

    @staticmethod
    def of(file: Path) -> Reading:
        """Read it."""
        robot = read_robot(file)
        return Reading(
            file=file,
            tree=robot.tree is not None,
            freedoms=freedoms(robot),
            obstacles=tuple(map(str, robot.obstacles)),
            kinds=frozenset(kind(one.sentence) for one in robot.obstacles),
            left_out=frozenset(one.what for one in robot.left_out),
            impossible=frozenset(one.kind for one in impossible(robot)),
        )

    @property
    def moves(self) -> bool:
        """Whether anything of it moves, as far as is known."""
        return self.freedoms != "none" and STILL not in self.kinds

    @property
    def loads(self) -> bool:
        """Whether the engine that compiles its format takes it; parts of others it does not."""
        return not any(REFUSED in one for one in self.kinds)


def kind(sentence: str) -> str:
    """A sentence without the names and numbers of its file."""
    return re.sub(r"(?<!\w)'[^']*'|(?<!\w)\"[^\"]*\"|\b\d+\b", "*", sentence)


def freedoms(robot: Robot) -> str:
    """Of the tree, in classes."""
    if robot.tree is None:
        return "no tree"
    nv = robot.tree.nv
    return "none" if nv == 0 else "1 to 30" if nv <= 30 else "more than 30"


def table(title: str, counts: Counter[str]) -> str:
    """One line a kind, the most frequent first."""
    lines = [f"  {count:6}  {what}" for what, count in counts.most_common()]
    return "\n".join([title, *(lines or ["    none"])])


def survey(found: Sequence[Reading]) -> str:
    """The tables of all; each file counts once in a row."""
    read = sum(one.tree for one in found)
    refused = [one for one in found if one.obstacles]
    return "\n\n".join([
        f"{len(found)} files, {read} read, {len(refused)} with obstacles,"
        f" {sum(bool(one.impossible) for one in found)} with impossible inertias",
        table("degrees of freedom, files", Counter(one.freedoms for one in found)),
        table("in the way, files", Counter(what for one in refused for what in one.kinds)),
        table("left out, files", Counter(what for one in found for what in one.left_out)),
        table("impossible inertias, files",
              Counter(what for one in found for what in one.impossible)),
        "\n".join(what for one in refused for what in one.obstacles),
    ])  # fmt: skip
