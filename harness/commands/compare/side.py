"""Contents of one of the two files, their differences, and the equations of its tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.scene import scene_record
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.modelfiles.mjcf.stated import StatedLaws
from physics_crosscheck.harness.modelfiles.readers import names_of
from physics_crosscheck.harness.modelfiles.robot import LinkPart
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.harness.records.scene import Scene
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.assemble import tree_system
from physics_crosscheck.reference.mechanism.chart import Coupled
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from physics_crosscheck.reference.solving.collocation import ReferenceError
from physics_crosscheck.reference.solving.samples import ends_of
from physics_crosscheck.reference.solving.segments import Segments
from .alignment import PlacedTree, placed, positions
from .candidate import Facts

Difference = tuple[ComparedProperty, Tree | None]
"""A difference of two files, and A's tree with B's value; None if no tree shows it."""


def make_property(
    kind: str,
    about: str,
    message: str,
    *,
    a: float | None = None,
    b: float | None = None,
    lines: tuple[SourceLine | None, SourceLine | None] = (None, None),
    moves: bool = True,
    relative: float = 1.0,
    changed: Tree | None = None,
) -> Difference:
    """Return a difference.

    Args:
        kind: such as "mass", "centre", "inertia", "axis", "damping", "range", "frame".
        about: the joint or link; empty for the whole model.
        message: a sentence.
        a, b: the values, for single numbers.
        lines: of A and of B, if known.
        moves: whether it is part of the equations of motion.
        relative: the relative difference; 1 for anything without a size.
        changed: A's tree with B's value.
    """
    record = ComparedProperty(
        kind=kind,
        about=about,
        message=message,
        a=number(a),
        b=number(b),
        where_a=lines[0],
        where_b=lines[1],
        moves=moves,
        relative=number(relative),
    )
    return record, changed


def shown(here: float, there: float) -> str:
    """Format two numbers with enough digits to show their difference."""
    text_a, text_b = apart(here, there, 0.0)
    share = f" ({percent((there - here) / here)})" if here and there else ""
    return f"{text_a} in A, {text_b} in B{share}"


def apart(here: float, there: float, doubt: float) -> tuple[str, str]:
    """Format both numbers with enough digits to show the difference; uncertain ones are 0."""
    here, there = (0.0 if abs(x) <= doubt else x for x in (here, there))
    size = max(abs(here), abs(there))
    share = abs(here - there) / size if size else 0.0
    digits = int(np.clip(np.ceil(-np.log10(share)) + 2, 4, 17)) if share > 0 else 17
    return f"{here:.{digits}g}", f"{there:.{digits}g}"


def values_shown(values: Sequence[float | str]) -> str:
    """Format a row of numbers and words."""
    text = " ".join(one if isinstance(one, str) else f"{float(one):.9g}" for one in values)
    return f"({text})" if len(values) > 1 else text or "none"


def equal_values(
    here: Sequence[float | str], there: Sequence[float | str], tolerance: float
) -> bool:
    """Return whether two rows of numbers and words are equal, up to a relative tolerance."""
    return len(here) == len(there) and all(
        x == y
        if isinstance(x, str) or isinstance(y, str)
        else abs(x - y) <= tolerance * max(abs(x), abs(y))
        for x, y in zip(here, there, strict=True)
    )


def element_line(file: Path, element: XmlElement | None, attribute: str = "") -> SourceLine | None:
    """Return the line of an attribute, or else of its element; None if it is unknown."""
    if element is None:
        return None
    stated = attribute in element.attributes
    where, line = element.attribute_place(attribute) if stated else element.place
    return SourceLine(file=str(where or file), line=line) if line else None


def percent(share: float) -> str:
    """Format a relative change."""
    if abs(share) >= 1e-4:
        return f"{100 * share:+.3g} %"
    return f"{share:+.1e}"


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelSide:
    """Contents of a file, and the placement of its bodies at the common position.

    Attributes:
        file: that was read.
        facts: of the model as it runs.
        position: of the tree's coordinates, (nv,).
        placed: the tree at the common position.
        parts: the file's links, by the link of the tree that contains them.
        springs: whether a sidecar adds springs to the file.
    """

    file: Path
    facts: Facts
    position: Array
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
        model = None if self.facts.robot is None else self.facts.robot.body_model
        bodies = () if model is None else model.bodies
        joints = [joint.name for body in bodies for joint in body.joints]
        return {
            "body": {body.name: i for i, body in enumerate(bodies)},
            "joint": {name: i for i, name in enumerate(joints)},
        }

    @cached_property
    def _stage(self) -> UsdStage | None:
        try:
            is_stage = self.file.suffix in USD_SUFFIXES
            settings = self.facts.candidate.settings
            return UsdStage(self.file, settings) if is_stage else None
        except LocationError:
            return None

    def stage_values(self, what: str, name: str) -> Mapping[str, tuple[object, SourceLine]]:
        """Return what layers of a stage state for a property of a joint or link, by attribute."""
        stage, rows = self._stage, {}
        if stage is None:
            return {}
        prims = stage.bodies if what in ("mass", "centre", "inertia") else stage.joints
        for attribute in STAGE_KEYS.get(what, ()):
            if (value := stage.stated(prims.get(name), attribute)) is not None:
                file, line, _ = stage.place(prims[name], attribute)
                rows[attribute] = value, SourceLine(file=str(file), line=line)
        return rows

    def stage_numbers(self) -> dict[str, dict[str, tuple[float | str, ...]]]:
        """Return bounds and dry frictions of a stage by joint and property, in SI units."""
        rows: dict[str, dict[str, tuple[float | str, ...]]] = {}
        if (stage := self._stage) is None:
            return rows
        for name, prim in stage.joints.items():
            is_hinge, row = prim.GetTypeName() == "PhysicsRevoluteJoint", rows.setdefault(name, {})
            if force_range := stage.actuator_force(prim):
                low, high = force_range
                row["effort"] = (high,) if low == -high else (low, high)
            turn, arm = (np.pi / 180, stage.unit) if is_hinge else (stage.unit, 1.0)
            force = stage.mass_unit * stage.unit * arm
            for what, unit in (("friction", force), ("effort", force), ("velocity", turn)):
                for value, _ in self.stage_values(what, name).values():
                    if isinstance(value, float) and value and np.isfinite(value):
                        row[what] = (value * unit,)
        return rows

    def prim_line(self, kind: str, name: str) -> SourceLine | None:
        """Return the line of the prim of a joint or link in a stage; None in other files."""
        stage = self._stage
        prims = {} if stage is None else stage.bodies if kind == "link" else stage.joints
        if stage is None or name not in prims:
            return None
        file, line, _ = stage.place(prims[name])
        return SourceLine(file=str(file), line=line)

    def gravity_line(self, is_turned: bool) -> SourceLine | None:
        """Return the line of gravity's size or direction in a stage; None in other files."""
        if self._stage is None:
            return None
        file, line, _ = self._stage.gravity_place(is_turned=is_turned)
        return SourceLine(file=str(file), line=line)

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
        return element_line(self.file, places[0] if places else None)

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

_GAINS = "drive:angular:physics:{0} drive:linear:physics:{0}".format
STAGE_KEYS: Mapping[str, Sequence[str]] = {
    "mass": ("physics:mass", "physics:density"),
    "centre": ("physics:centerOfMass",),
    "inertia": ("newton:inertia", "physics:diagonalInertia", "physics:principalAxes"),
    "axis": ("physics:localRot0", "physics:localRot1", "physics:axis"),
    "zero": ("physics:localRot0", "physics:localRot1"),
    "anchor": ("physics:localPos0", "physics:localPos1"),
    "armature": ("newton:armature",),
    "friction": ("newton:friction",),
    "damping": ("newton:damping", *_GAINS("damping").split()),
    "stiffness": _GAINS("stiffness").split(),
    "rest": _GAINS("targetPosition").split(),
    "effort": _GAINS("maxForce").split(),
    "range": ("physics:lowerLimit", "physics:upperLimit"),
    "velocity": ("newton:velocityLimit",),
}
"""Attributes of the numbers of a property in USD."""

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
    stages = [one.stage_values(what, name) for one, name in zip((a, b), names, strict=True)]
    here, there = (
        [place for key, (value, place) in rows.items() if (value,) != other.get(key, ())[:1]]
        for rows, other in (stages, stages[::-1])
    )
    first, other = (
        next(iter(rows), None) or side.prim_line(kind, name)
        or _first_line(side.file, chain, spots, keys)
        for rows, side, name, chain, spots
        in zip((here, there), (a, b), names, chains, spots_by_key, strict=True)
    )  # fmt: skip
    return first, other


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
        position=z[[facts.coordinates.index(name) for name in names_of(tree)]],
        file=facts.candidate.sidecar.model,
        facts=facts,
        placed=placed(tree, positions(tree, facts.coordinates, z)),
        parts=tuple(map(tuple, parts)),
        springs=bool(facts.candidate.sidecar.springs),
    )


def side_scene(model: ModelSide) -> Scene:
    """Return the scene of a model at its position."""
    robot = model.facts.robot
    assert robot is not None  # it has a tree
    links = (part.link for part in robot.parts)
    return scene_record(model.tree, None, links, robot.placed, model.position)


class FileEquations:
    """Equations of a tree whose n coordinates determine the nz coordinates of an engine.

    Attributes:
        equations: of the tree.
        kept: index of each of its coordinates among the engine's, (n,).
        matrix, offset: the engine's positions are `matrix @ q + offset`, (nz, n) and (nz,).
    """

    def __init__(self, tree: Tree, names: Sequence[str]) -> None:
        order, coupled = [names.index(name) for name in names_of(tree)], Coupled(tree)
        self.equations = TreeEquations(tree_system(name="", title="", source="", tree=tree))
        self.kept = np.array(order)[coupled.kept]
        self.matrix, self.offset = np.zeros((len(names), len(self.kept))), np.zeros(len(names))
        self.matrix[order], self.offset[order] = coupled.matrix, coupled.offset

    def expanded(self, states: Array) -> tuple[Array, Array]:
        """Return states (K, 2n) as the engine's positions and velocities, (K, nz) each."""
        n = len(self.kept)
        return states[:, :n] @ self.matrix.T + self.offset, states[:, n:] @ self.matrix.T

    def reduced(self, states: Array) -> Array:
        """Return the coordinates' states, (K, 2n), of the engine's, (K, 2nz)."""
        nz = len(self.offset)
        return states[:, [*self.kept, *(nz + i for i in self.kept)]]

    def accelerations(self, runs: Segments) -> Array:
        """Return accelerations at the starts of runs under their forces, (K, nz)."""
        start, n = self.reduced(runs.start), len(self.kept)
        forces = runs.start_inputs @ self.matrix
        pushed = self.equations.pushed_acceleration(start[:, :n], start[:, n:], forces)
        return pushed @ self.matrix.T

    def ends(self, runs: Segments) -> Array:
        """Return the end states of runs under forces on the engine's coordinates, (K, 2nz).

        They are not a number if the equations cannot be solved.
        """
        forces, start = runs.start_inputs @ self.matrix, self.reduced(runs.start)
        try:
            ends = ends_of(self.equations, start, forces, runs.length, stiff=True)
            return np.hstack(self.expanded(ends))
        except ReferenceError:
            return np.full((len(start), 2 * len(self.offset)), np.nan)
