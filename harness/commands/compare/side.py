"""Contents of one of the two files: its tree at the common position, links and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.modelfiles.mjcf.stated import StatedLaws
from physics_crosscheck.harness.modelfiles.robot import LinkPart
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .candidate import Facts
from .equations import FileEquations
from .match import Match
from .placed import PlacedTree, placed, positions


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

    @cached_property
    def stated(self) -> StatedLaws | None:
        """The text of a compiled file; None for other files."""
        try:
            return None if self.facts.compiled is None else StatedLaws(self.file)
        except EngineError:
            return None

    @cached_property
    def root(self) -> XmlElement | None:
        """The root element of the file; None if it can't be read."""
        try:
            return self.stated.root if self.stated else Document(self.file).root
        except LocationError:
            return None

    @cached_property
    def _indices(self) -> Mapping[str, Mapping[str, int]]:
        """Indices of bodies and joints of a compiled file, by name."""
        model = None if self.facts.robot is None else self.facts.robot.body_model
        bodies = () if model is None else model.bodies
        joints = [joint.name for body in bodies for joint in body.joints]
        return {
            "body": {body.name: i for i, body in enumerate(bodies)},
            "joint": {name: i for i, name in enumerate(joints)},
        }

    def elements(self, kind: str, name: str) -> Sequence[XmlElement]:
        """Return the element of a joint or link, then its defaults; nothing if it is unknown."""
        if self.stated is not None:
            kind = "body" if kind == "link" else kind
            index = self._indices[kind].get(name)
            return () if index is None else self.stated.elements(kind, index)
        same = () if self.root is None else self.root.iter(kind)
        return [one for one in same if one.get("name") == name][:1]

    def frame_line(self, name: str) -> SourceLine | None:
        """Return the line of a site, or of the pose of a link on a fixed joint, if known."""
        elements = [] if self.root is None else list(self.root.iter())
        named = [e for e in elements if e.get("name") == name]
        places = [e for e in named if e.tag == "site"]
        for joint in (e for e in elements if e.tag == "joint"):
            child = joint.find("child")
            if child is not None and name in (child.get("link"), child.text.strip()):
                places.append(joint.find("origin") or joint)
        places += [e for e in named if e.tag in ("body", "link")]
        where, line = places[0].place if places else (None, None)
        return SourceLine(file=str(where or self.file), line=line) if line else None

    def limits(self, name: str) -> tuple[float, float]:
        """Return the bounds of a joint."""
        low, high = self.facts.limits[self.facts.coordinates.index(name)]
        return float(low), float(high)


KEYS: Mapping[str, tuple[str, ...]] = {
    "axis": ("axis@xyz", "axis/xyz", "@axis", "origin@rpy", "pose"),
    "anchor": ("origin@xyz", "pose", "@pos"),
    "zero": ("origin@rpy", "origin@xyz", "pose", "@ref"),
    "armature": ("@armature",),
    "damping": ("dynamics@damping", "axis/dynamics/damping", "@damping"),
    "stiffness": ("axis/dynamics/spring_stiffness", "@stiffness"),
    "rest": ("axis/dynamics/spring_reference", "@springref"),
    "range": ("limit@lower", "limit@upper", "axis/limit/lower", "axis/limit/upper", "@range"),
    "friction": ("dynamics@friction", "axis/dynamics/friction", "@frictionloss"),
    "effort": ("limit@effort", "axis/limit/effort", "@actuatorfrcrange"),
    "velocity": ("limit@velocity", "axis/limit/velocity"),
    "coupling": ("mimic@joint", "mimic@multiplier", "mimic@offset", "mimic", "axis/mimic"),
    "kind": ("@type",),
    "mass": ("inertial/mass@value", "inertial/mass", "inertial@mass"),
    "centre": ("inertial/origin@xyz", "inertial/pose", "inertial@pos"),
    "inertia": (
        *(f"inertial/inertia@{key}" for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
        *(f"inertial/inertia/{key}" for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
        "inertial/origin@rpy", "inertial@diaginertia", "inertial@fullinertia", "inertial@quat",
    ),
}  # fmt: skip
"""Places of the numbers of a property: tags, then an attribute, or the text."""

Lines = tuple[SourceLine | None, SourceLine | None]
"""The lines of A and of B, if known."""


def lines_of(a: ModelSide, b: ModelSide, what: str, names: tuple[str, str]) -> Lines:
    """Return the lines that state a property of a joint or link: of its first number that differs.

    Args:
        a, b: both files.
        what: a key of `KEYS`.
        names: of the joint or link in A and in B; empty for none.
    """
    kind = "link" if what in ("mass", "centre", "inertia") else "joint"
    chains = [model.elements(kind, name) for model, name in zip((a, b), names, strict=True)]
    spots_by_key = [{key: _spot(chain, key) for key in KEYS.get(what, ())} for chain in chains]
    texts = [{key: spot[0] for key, spot in one.items() if spot} for one in spots_by_key]
    keys = [key for key in spots_by_key[0] if texts[0].get(key) != texts[1].get(key)]
    return (
        _first_line(a.file, chains[0], spots_by_key[0], keys),
        _first_line(b.file, chains[1], spots_by_key[1], keys),
    )


_Spot = tuple[str, tuple[Path | None, int | None]]
"""A text of a file, and its place."""


def _spot(chain: Sequence[XmlElement], key: str) -> _Spot | None:
    """Return the text of the first element of a chain that states a key, and its place."""
    path, _, attribute = key.partition("@")
    for element in chain:
        target = element.find(path) if path else element
        if target is not None and (not attribute or attribute in target.attributes):
            place = target.attribute_place(attribute) if attribute else target.place
            return (target.get(attribute) if attribute else target.text), place
    return None


def _first_line(
    file: Path,
    chain: Sequence[XmlElement],
    spots_by_key: Mapping[str, _Spot | None],
    keys: Sequence[str],
) -> SourceLine | None:
    spots = [spots_by_key[key] for key in (*keys, *spots_by_key) if spots_by_key[key]]
    if not spots and chain:
        inner = chain[0].find("inertial") if chain[0].tag == "body" else None
        spots = [("", (inner or chain[0]).place)]
    where, line = spots[0][1] if spots and spots[0] else (None, None)
    return SourceLine(file=str(where or file), line=line) if line else None


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
