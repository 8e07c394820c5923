"""Contents of one of the two files: its tree at the common position, links and limits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.commands.compare.candidate import Facts
from physics_crosscheck.harness.commands.compare.equations import FileEquations
from physics_crosscheck.harness.commands.compare.match import Match
from physics_crosscheck.harness.commands.compare.placed import PlacedTree, placed, positions
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.modelfiles.robot import LinkPart
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelSide:
    """Contents of a file, and the placement of its bodies at the common position.

    Attributes:
        label: "A" or "B".
        file: that was read.
        facts: of the model as it runs.
        placed: the tree at the common position.
        parts: the file's links, by the link of the tree that contains them.
        springs: whether a sidecar adds springs to the file.
    """

    label: str
    file: Path
    facts: Facts
    placed: PlacedTree
    parts: tuple[tuple[LinkPart, ...], ...]
    springs: bool

    @property
    def tree(self) -> Tree:
        """The bodies and joints."""
        return self.placed.tree

    @property
    def equations(self) -> FileEquations:
        """The equations of the tree."""
        return FileEquations(self.tree, self.facts.coordinates)

    def joint_line(self, name: str) -> SourceLine | None:
        """Return the line of a joint's element, if known."""
        robot = self.facts.robot
        line = 0 if robot is None else robot.joint_lines.get(name, 0)
        return self._line(line, f"joint[{name}]")

    def part_line(self, part: LinkPart | None) -> SourceLine | None:
        """Return the line of a link's element, if known; in MJCF, of its `<inertial>` if any."""
        if part is None:
            return None
        return self._line(part.line, f"body[{part.name}]/inertial", f"body[{part.name}]")

    def _line(self, read: int, *addresses: str) -> SourceLine | None:
        """Return the line read, or if it is 0, as in an MJCF, that of the first address found."""
        lines = (line_of(self.file, address) for address in addresses)
        line = read or next(filter(None, lines), None)
        return SourceLine(file=str(self.file), line=line) if line else None

    def limits(self, name: str) -> tuple[float, float]:
        """Return the bounds of a joint."""
        low, high = self.facts.limits[self.facts.coordinates.index(name)]
        return float(low), float(high)


def model_side(facts: Facts, z: Array) -> ModelSide | None:
    """Return a file at a position, or None if it is not a tree with the engine's coordinates.

    Args:
        facts: of the model as it runs.
        z: positions of its coordinates, (nz,).
    """
    robot, tree = facts.robot, facts.whole_tree
    if robot is None or tree is None:
        return None
    parts: list[list[LinkPart]] = [[] for _ in tree.links]
    for part in robot.parts:
        if part.body != WORLD:
            parts[part.body].append(part)
    return ModelSide(
        label=facts.candidate.label,
        file=facts.candidate.sidecar.model,
        facts=facts,
        placed=placed(tree, positions(tree, facts.coordinates, z)),
        parts=tuple(map(tuple, parts)),
        springs=bool(facts.candidate.sidecar.springs),
    )


@dataclass(frozen=True, kw_only=True)
class JointPair:
    """Two joints related by a line: B's position is slope * A's + offset."""

    a: str
    b: str
    slope: float
    offset: float


def pairs_of(match: Match, source_names: tuple[str, ...]) -> tuple[JointPair, ...]:
    """Return pairs of joints of A and B that a match relates by lines.

    Args:
        match: of coordinates.
        source_names: names of the source's coordinates.
    """
    if not match.constant:
        return ()
    zero = np.zeros((1, len(source_names)))
    slopes, offsets = match.slopes(zero)[0], match.value(zero)[0]
    pairs = []
    for name, row, offset in zip(match.names, slopes, offsets, strict=True):
        (places,) = np.nonzero(row)
        if len(places) != 1:
            continue
        source, slope = source_names[places[0]], float(row[places[0]])
        if match.source == "A":
            pairs.append(JointPair(a=source, b=name, slope=slope, offset=float(offset)))
        else:
            pairs.append(
                JointPair(a=name, b=source, slope=1 / slope, offset=-float(offset) / slope + 0.0)
            )
    return tuple(pairs)
