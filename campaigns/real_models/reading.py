"""How much of a folder of URDFs is read.

Prints how many have a tree, what is in the way of the others, what is left out, and how many have
inertias that no body can have.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from harness.robots.inertias import impossible
from harness.robots.robot import Robot
from harness.robots.urdf import read_urdf_robot


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


def survey(folder: Path) -> str:
    """The tables of a folder, its folders included; each file counts once in a row."""
    robots = [read_urdf_robot(path) for path in sorted(folder.rglob("*.urdf"))]
    found = {robot.file: impossible(robot) for robot in robots}
    read = sum(robot.tree is not None for robot in robots)
    refused = [robot for robot in robots if robot.obstacles]
    return "\n\n".join([
        f"{len(robots)} files, {read} read, {len(refused)} with obstacles,"
        f" {sum(map(bool, found.values()))} with impossible inertias",
        table("degrees of freedom, files", Counter(map(freedoms, robots))),
        table("in the way, files", Counter(
            what for robot in refused for what in {kind(one.sentence) for one in robot.obstacles})),
        table("left out, files", Counter(
            what for robot in robots for what in {one.what for one in robot.left_out})),
        table("impossible inertias, files", Counter(
            what for one in found.values() for what in {finding.kind for finding in one})),
        "\n".join(str(one) for robot in refused for one in robot.obstacles),
    ])  # fmt: skip
