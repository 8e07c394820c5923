"""Rows of a file's laws: limits, dry friction, equalities, contacts and drives, with their lines.

Rows of two files are paired by the names of joints, shapes and tendons.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from physics_crosscheck.harness.checks.law_comparison import TreeLaw
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.urdf import UrdfFile, read_urdf
from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.law_attributes import (
    ContactOptions,
    JointForceLimit,
    Row,
    values_of,
)
from physics_crosscheck.harness.modelfiles.mjcf.misread import skipped_kinds
from physics_crosscheck.harness.modelfiles.mjcf.stated import (
    IMPEDANCE,
    REFERENCE,
    StatedLaws,
    StatedRow,
)
from physics_crosscheck.harness.modelfiles.mjcf.stated import Key as StatedKey
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.reference.laws.impulses import ImpulseModel
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    ContactParameters,
    HardJoint,
    ImpulseLaws,
    Laws,
    SoftEquality,
    SoftFriction,
    SoftLimit,
    Softness,
)
from .side import element_line

Key = tuple[str, ...]
"""A table of the laws, and the names by which rows of two files are paired."""


L = TypeVar("L", Laws, ImpulseLaws)


LEADING: Mapping[type, str] = {
    SoftLimit: "range", SoftFriction: "frictionloss", JointForceLimit: "actuatorfrcrange",
    SoftEquality: "polycoef", ContactParameters: "friction",
}  # fmt: skip
"""Attribute that names a row which only one file has."""


@dataclass(frozen=True, kw_only=True)
class LawRow:
    """One row.

    Attributes:
        key: pairs it with a row of another file.
        subject: its kind and name.
        index: in its table.
        row: its numbers.
        lines: of its attributes; that of its element under "".
    """

    key: Key
    subject: str
    index: int
    row: Row
    lines: Mapping[str, SourceLine] = field(default_factory=dict)

    def values(self, attribute: str) -> tuple[float, ...]:
        """Return the numbers of an attribute."""
        return values_of(self.row, attribute)

    def line(self, attribute: str, index: int = 0) -> SourceLine | None:
        """Return the line of a number of an attribute, or that of the element."""
        keys = (f"{attribute}[{index}]", attribute, "")
        return next((self.lines[key] for key in keys if key in self.lines), None)


def with_row(laws: L, table: str, index: int, row: Row | None) -> L:
    """Return laws with another row; index -1 adds it, and None removes it."""
    if isinstance(row, ContactOptions):
        return replace(laws, **{one.name: getattr(row, one.name) for one in fields(row)})
    if table == "joint_ranges" and isinstance(laws, Laws):
        ranges = {joint: value for joint, value in laws.joint_ranges.items() if joint != index}
        if isinstance(row, JointForceLimit):
            ranges[index] = row.force, row.lifts
        return replace(laws, joint_ranges=ranges)
    rows: list[Any] = list(getattr(laws, table))
    if table == "pairs":
        rows[index] = (*rows[index][:2], row)
    elif index < 0:
        rows.append(row)
    elif row is None:
        del rows[index]
    else:
        rows[index] = row
    changed: dict[str, Any] = {table: tuple(rows)}
    return replace(laws, **changed)


def shape_names(compiled: CompiledTree) -> list[str]:
    """Return the names of all shapes; some are empty."""
    return [one.name.partition(":")[2] for one in compiled.placed if one.name.startswith("geom:")]


@dataclass(frozen=True, kw_only=True)
class SoftRows:
    """Rows of a compiled file.

    Attributes:
        file: its path.
        compiled: the file.
        model: its laws.
        joints: names by which the other file calls joints; others have no partner.
        shapes: names of shapes that both files have.
        drives: paired drives, by index in the other file.
        same_bodies: whether both files have as many bodies.
    """

    file: Path
    compiled: CompiledTree
    model: LawModel
    joints: Mapping[str, str]
    shapes: frozenset[str]
    drives: Mapping[int, int]
    same_bodies: bool

    def rows(self) -> Iterator[LawRow]:
        """Yield all rows that may have a partner."""
        laws = self.model.laws
        yield self._row(("options",), "options", 0, ContactOptions.from_laws(laws), ("option", 0))
        tables: tuple[tuple[str, str, Sequence[SoftLimit | SoftFriction]], ...] = (
            ("limits", "limit", laws.limits),
            ("frictions", "friction", laws.frictions),
        )
        for table, word, rows in tables:
            for i, row in enumerate(rows):
                kind, place = ("joint", row.joint) if row.joint >= 0 else ("tendon", row.path)
                name = self._joint(place) if kind == "joint" else self._tendon(place)
                stated = (f"{word} of {kind}", place)
                if name is not None:
                    yield self._row((table, kind, name), f"{kind} {name}", i, row, stated)
        for joint, (force, lifts) in laws.joint_ranges.items():
            name = self._joint(joint)
            if name is not None:
                forces = JointForceLimit(force=force, lifts=lifts)
                stated = ("force of joint", joint)
                yield self._row(("joint_ranges", name), f"joint {name}", joint, forces, stated)
        count = Counter[Key]()
        for i, equality in enumerate(laws.equalities):
            key, subject = self._equality(equality)
            count[key] += 1
            same = () if count[key] == 1 else (f"#{count[key]}",)
            yield self._row((*key, *same), subject, i, equality, ("equality", i))
        yield from self._contacts(laws)
        for i, drive in enumerate(laws.drives):
            if i in self.drives:
                subject = self._drive(i)
                pair = ("drives", str(self.drives[i]))
                yield self._row(pair, subject, i, drive, ("drive", i))

    def _contacts(self, laws: Laws) -> Iterator[LawRow]:
        keys = self._shape_keys
        for i, surface in enumerate(laws.surfaces):
            subject = f"geom {shape_names(self.compiled)[i] or ' of '.join(keys[i][::-1])}"
            yield self._row(("surfaces", *keys[i]), subject, i, surface, ("geom", i))
        count = Counter[Key]()
        for i, (first, other, touch) in enumerate(laws.pairs):
            first_key, other_key = sorted((keys[first], keys[other]))
            count[key := ("pairs", *first_key, "", *other_key)] += 1
            same = () if count[key] == 1 else (f"#{count[key]}",)
            yield self._row((*key, *same), f"pair #{i + 1}", i, touch, ("pair", i))

    def _equality(self, equality: SoftEquality) -> tuple[Key, str]:
        """Return the key of an equality, what it holds, and its name for people."""
        if equality.anchors is not None:
            bodies = ["the world", *(one.name for one in self.compiled.bodies)]
            names = [bodies[anchor.body] for anchor in equality.anchors]
            kind = "connect" if equality.turn_scale is None else "weld"
        else:
            names = [self._joint(j) or "" for j in equality.joints]
            names += [self._tendon(t) for t in equality.paths]
            kind = "joint" if equality.joints else "tendon"
        subject = f"equality {kind} of {' and '.join(names)}"
        return ("equalities", kind, *sorted(names)), subject

    @cached_property
    def _shape_keys(self) -> list[Key]:
        keys: list[Key] = []
        count = Counter[str]()
        names = shape_names(self.compiled)
        for name, surface in zip(names, self.model.laws.surfaces, strict=True):
            if name in self.shapes:
                keys.append((name,))
                continue
            body = "ground"
            if surface.body:
                body = self.compiled.bodies[surface.body - 1].name
            if self.same_bodies and surface.body:
                body = body or f"#{surface.body}"
            count[body] += 1
            keys.append((body, f"#{count[body]}"))
        return keys

    def _joint(self, index: int) -> str | None:
        return self.joints.get(self.compiled.joints[index])

    def _tendon(self, index: int) -> str:
        stated = () if self._stated is None else self._stated.names("tendon")
        return (stated[index] if index < len(stated) else "") or f"#{index + 1}"

    def _drive(self, index: int) -> str:
        actuator = self.compiled.actuators[index]
        return f"actuator {actuator.name or f'on {actuator.on}'}"

    @cached_property
    def _stated(self) -> StatedLaws | None:
        try:
            return StatedLaws(self.file)
        except EngineError:
            return None

    @cached_property
    def _stated_rows(self) -> Mapping[StatedKey, StatedRow]:
        if self._stated is None:
            return {}
        kinds = [kind for kind, _ in skipped_kinds(self._stated, self.compiled, self.model)]
        return {
            key: row
            for key, row in self._stated.rows.items()
            if key[0].rpartition(" ")[2] not in kinds
        }

    def _row(self, key: Key, subject: str, index: int, row: Row, stated: StatedKey) -> LawRow:
        source, lines = self._stated_rows.get(stated), dict[str, SourceLine]()
        if source is not None:
            for element, name, word in source.places:
                spot = _line(self.file, element, name)
                lines |= {f"{name}[{word}]": one for one in spot.values()}
                if element is source.element or name not in lines:
                    lines |= spot
            lines |= _line(self.file, source.element, "")
        return LawRow(key=key, subject=subject, index=index, row=row, lines=lines)


def _line(file: Path, element: XmlElement | None, attribute: str) -> dict[str, SourceLine]:
    line = element_line(file, element, attribute)
    return {} if line is None else {attribute: line}


def urdf_rows(file: Path, model: TreeLaw, joints: Mapping[str, str]) -> Iterator[LawRow]:
    """Yield the rows of a URDF in an engine of impulses or of convex laws.

    Args:
        file: its path.
        model: its laws.
        joints: names by which the other file calls its joints.
    """
    urdf, links = read_urdf(Document(file)), model.tree.tree.links
    tables: list[tuple[str, str, Sequence[SoftLimit | SoftFriction | HardJoint]]]
    if isinstance(model, ImpulseModel):
        tables = [("joints", "limit", model.laws.joints)]
    else:
        tables = [("limits", "limit", model.laws.limits)]
        tables += [("frictions", "dynamics", model.laws.frictions)]
    for table, tag, rows in tables:
        for i, row in enumerate(rows):
            name = links[row.joint].name
            if name in joints:
                lines = _line(file, urdf.joints[name].element.find(tag), "")
                yield LawRow(key=(table, "joint", joints[name]), subject=f"joint {joints[name]}",
                             index=i, row=row, lines=lines)  # fmt: skip
    if isinstance(model, ImpulseModel):
        yield from _link_surfaces(file, urdf, model)
    elif isinstance(model, NearRigidModel):
        for i, (owner, index) in enumerate(model.rules.shapes, start=1):
            shape = urdf.links[owner].element.findall("collision")[index]
            stated = shape.find(model.rules.surface_tags[0]) or shape
            yield LawRow(key=("compliant", owner, str(index)),
                         subject=f"shape {index + 1} of link {owner}", index=i,
                         row=model.laws.compliant[i], lines=_line(file, stated, ""))  # fmt: skip


def _link_surfaces(file: Path, urdf: UrdfFile, model: ImpulseModel) -> Iterator[LawRow]:
    for i, surface in enumerate(model.laws.surfaces):
        name = model.laws.rules.bodies[i]
        link = urdf.links.get(name)
        if link is not None:
            contact = link.element.find("contact") or link.element
            lines = _line(file, contact, "")
            for child in contact.children:
                lines |= _line(file, child, child.tag)
            yield LawRow(key=("surfaces", name), subject=f"link {name}", index=i, row=surface,
                         lines=lines)  # fmt: skip


def hard_as_soft(rows: Sequence[LawRow], a: SoftRows) -> Iterator[LawRow]:
    """Yield limits and efforts of impulses as rows of a compiled file, which gives the rest."""
    theirs = {row.key[-1]: row for row in rows if row.key[0] == "joints"}
    mine = {row.key: row for row in a.rows()}
    for name, other in theirs.items():
        joint = other.row
        assert isinstance(joint, HardJoint)
        if joint.lower <= joint.upper:
            limit = mine.get(("limits", "joint", name))
            base = limit.row if limit else SoftLimit(
                joint=a.compiled.joints.index(name), lower=0.0, upper=0.0, margin=0.0,
                softness=Softness(reference=REFERENCE, impedance=IMPEDANCE),
            )  # fmt: skip
            assert isinstance(base, SoftLimit)
            soft = replace(base, lower=joint.lower, upper=joint.upper)
            yield replace(other, key=("limits", "joint", name), row=soft)
        if not joint.effort:
            continue
        for key, row in _forces_on(a, mine, name):
            both = -joint.effort, joint.effort
            limited: JointForceLimit | Actuator
            if isinstance(row, JointForceLimit):
                limited = replace(row, force=both)
            else:
                limited = replace(row, force_range=both)
            yield replace(other, key=key, row=limited)


def _forces_on(
    soft: SoftRows, rows: Mapping[Key, LawRow], name: str
) -> Iterator[tuple[Key, JointForceLimit | Actuator]]:
    """Yield the row that limits the force on a joint: its own range, or that of its only drive."""
    row = rows.get(("joint_ranges", name))
    if row is not None and isinstance(row.row, JointForceLimit):
        yield row.key, row.row
        return
    joint = {there: here for here, there in soft.joints.items()}[name]
    on = [i for i, one in enumerate(soft.compiled.actuators) if one.on == joint]
    if len(on) == 1 and on[0] < len(soft.model.laws.drives):
        drive = soft.model.laws.drives[on[0]]
        gear = soft.model.tree.paths[drive.path].joints
        if drive.force_range is not None and [abs(share) for _, share in gear] == [1.0]:
            yield ("drives", str(on[0])), drive


def soft_as_hard(
    rows: Mapping[Key, LawRow], b: SoftRows, mine: Sequence[LawRow]
) -> Iterator[LawRow]:
    """Yield limits and efforts of a compiled file as rows of impulses, which give the rest."""
    for target in mine:
        joint, name = target.row, target.key[-1]
        if not isinstance(joint, HardJoint):
            continue
        limit = rows.get(("limits", "joint", name))
        lines, changed = dict[str, SourceLine](), replace(joint, lower=1.0, upper=0.0)
        if limit is not None and isinstance(limit.row, SoftLimit):
            lines |= limit.lines
            changed = replace(joint, lower=limit.row.lower, upper=limit.row.upper)
        for key, row in _forces_on(b, rows, name):
            force = row.force if isinstance(row, JointForceLimit) else row.force_range
            if force is not None and -force[0] == force[1] and joint.effort:
                changed = replace(changed, effort=force[1])
                source = rows.get(key)
                line = source.line("forcerange") if source else None
                lines |= {"effort": line} if line else {}
        yield LawRow(key=target.key, subject=target.subject, index=-1, row=changed, lines=lines)
