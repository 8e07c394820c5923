"""Numbers of the laws that a compiler resolves otherwise than the text of the file states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.mjcf_defaults import StatedPlace, Value, Values
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.bodies import ForceElement, powers
from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    Laws,
    SoftEquality,
    SoftFriction,
    SoftLimit,
)
from physics_crosscheck.reference.mechanism.rotations import from_quaternion
from ..law_attributes import JointForceLimit, attributes
from .read import NO_TURN
from .stated import Key, StatedLaws, StatedRow, surface_values
from .stated_drives import drive_values

ROUNDED, RESOLVED = 8 * float(np.finfo(float).eps), 1e-9
"""Largest relative difference of a number, and of one that follows from several."""

AS_WHOLE = {"pos": 1e-12, "quat": RESOLVED, "fullinertia": RESOLVED, "axis": 1e-12}
"""Attributes that are compared relative to their largest number, with the largest difference.

A compiler moves shapes with meshes, and finds principal axes.
"""


SMALLEST_PLACE = 0.1
"""Smallest coordinate that the rounding of a place is relative to, m."""


@dataclass(frozen=True, kw_only=True)
class MisreadNumber:
    """A number that a compiler resolves otherwise.

    Attributes:
        subject: its attribute and element.
        sentence: what differs.
        discrepancy: relative; 1 for words and for what only one side has.
        file, line: of the element.
    """

    subject: str
    sentence: str
    discrepancy: float
    file: Path
    line: int


@dataclass(frozen=True, kw_only=True)
class ReadingCheck:
    """The comparison of a file's text with its compiled laws.

    Attributes:
        compared: number of attributes that are equal in both, or differ.
        misread: those that differ.
        unread: what is not compared, in words.
        places: numbers of the file that the compared attributes follow from.
    """

    compared: int
    misread: tuple[MisreadNumber, ...]
    unread: tuple[str, ...]
    places: frozenset[StatedPlace] = frozenset()


def check_reading(path: Path, compiled: CompiledTree, model: LawModel) -> ReadingCheck:
    """Compare the numbers that the text of a file states with those of its compiled laws.

    Args:
        path: of the file.
        compiled: the same file in a compiler.
        model: its laws, on its bodies.

    """
    try:
        stated = StatedLaws(path)
    except EngineError as error:
        return ReadingCheck(compared=0, misread=(), unread=(f"all: {error.sentence}",))
    skipped = tuple(skipped_kinds(stated, compiled, model))
    kinds = [kind for kind, _ in skipped]
    expected = {key: row for key, row in stated.rows.items() if _kind(key) not in kinds}
    actual = {
        key: values
        for key, values in _compiled_rows(compiled, model, stated)
        if _kind(key) not in kinds
    }
    compared = sum(len(row.values) for row in expected.values())
    return ReadingCheck(
        compared=compared,
        misread=tuple(_misread(path, expected, actual, model)),
        unread=(*stated.unread, *(why for _, why in skipped)),
        places=frozenset(place for row in expected.values() for place in row.places),
    )


def _kind(key: Key) -> str:
    """Return the kind of elements that a table belongs to."""
    return key[0].rpartition(" ")[2]


_NOT_READ: Mapping[str, str] = {
    "body": "inertias of generated or fused bodies",
    "joint": "limits and friction of generated joints",
    "geom": "sizes and contact parameters of generated or fused shapes",
    "site": "generated or fused sites",
    "drive": "generated drives, and drives of other transmissions",
    "tendon": "limits and friction of generated tendons",
    "pair": "generated pairs of shapes",
    "equality": "generated equalities, and equalities of other kinds",
}


def skipped_kinds(
    stated: StatedLaws, compiled: CompiledTree, model: LawModel
) -> Iterator[tuple[str, str]]:
    """Yield kinds of elements that do not correspond one to one, each with a phrase."""
    laws = model.laws
    bodies, joints = [body.name for body in compiled.bodies], compiled.joints
    placed = [shape.name.partition(":")[::2] for shape in compiled.placed]
    geoms, sites = ([name for one, name in placed if one == kind] for kind in ("geom", "site"))
    drives = [one.name for one in compiled.actuators]
    kinds = (("body", bodies), ("joint", joints), ("geom", geoms), ("site", sites),
             ("drive", drives))  # fmt: skip
    for kind, names in kinds:
        mine = stated.names(kind)
        alike = len(mine) == len(names) and all(
            not one or one == other for one, other in zip(mine, names, strict=True)
        )
        alike &= kind != "drive" or len(names) == len(laws.drives)
        if not alike or (kind in ("geom", "site") and stated.fuses):
            yield kind, _NOT_READ[kind]
    for kind, count in (
        ("tendon", len(compiled.paths) - len(laws.drives)),
        ("pair", len(laws.pairs)),
        ("equality", len(laws.equalities)),
    ):
        if len(stated.names(kind)) != count:
            yield kind, _NOT_READ[kind]


def _compiled_rows(
    compiled: CompiledTree, model: LawModel, stated: StatedLaws
) -> Iterator[tuple[Key, Mapping[str, Values]]]:
    laws = model.laws
    yield (
        ("option", 0),
        {
            "timestep": (laws.step,),
            **({"integrator": (laws.integrator,)} if laws.integrator else {}),
            "cone": ("elliptic" if laws.elliptic else "pyramidal",),
            "impratio": (laws.friction_ratio,),
            "refsafe": (float(laws.safe),),
            "gravity": compiled.gravity,
        },
    )
    # Only those that the file states: inertias may follow from shapes, and places from a <frame>.
    placed = (row for row in _bodies_and_joints(compiled) if row[0] in stated.rows)
    yield from (*placed, *_resistances(laws))
    springs = {force.name: force for force in compiled.passive}
    for t, name in enumerate(stated.names("tendon")):
        if (spring := springs.get(name or f"tendon_{t}")) is not None:
            yield ("dynamics of tendon", t), {
                "stiffness": powers(spring.stiffness), "damping": powers(spring.damping),
                "springlength": spring.rest,
            }  # fmt: skip
    tendons = [key[1] for key in stated.rows if key[0] == "force of tendon"]
    for k, (_, limits) in enumerate(laws.sums):
        index = tendons[k] if k < len(tendons) else -1 - k
        yield ("force of tendon", index), {"actuatorfrcrange": limits}
    for t, path in enumerate(compiled.paths[: len(compiled.paths) - len(laws.drives)]):
        yield ("path of tendon", t), {"coef": _pairs(compiled, path)}
    for i, equality in enumerate(laws.equalities):
        yield ("equality", i), _equality(equality)
    for i, surface in enumerate(() if stated.overrides else laws.surfaces):
        yield ("geom", i), surface_values(surface)
    pairs = dict(enumerate(stated.pairs))
    for first, other, touch in () if stated.overrides else laws.pairs:
        index = next((i for i, shapes in pairs.items() if shapes == {first, other}), -1)
        pairs.pop(index, None)  # a file may state a pair twice, and both act
        yield ("pair", index), attributes(touch)
    for i, drive in enumerate(laws.drives):
        yield ("drive", i), {
            **_drive(drive), "gear": _pairs(compiled, compiled.paths[drive.path])
        }  # fmt: skip


_TENSOR = (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)
"""Entries of `fullinertia`."""


def _bodies_and_joints(compiled: CompiledTree) -> Iterator[tuple[Key, Mapping[str, Values]]]:
    """Yield frames, inertias and places of joints, also of those without effect on a motion."""
    for b, body in enumerate(compiled.bodies):
        yield ("place of body", b), {"pos": body.position, "quat": body.quaternion or NO_TURN}
        moments, turn = body.inertia[:3], body.inertia_quaternion or NO_TURN
        inertia = {"mass": (body.mass,), "pos": body.center, "diaginertia": moments}
        axes = from_quaternion(np.array(turn, dtype=float))
        tensor = axes @ np.diag(moments) @ axes.T
        full = tuple(float(tensor[place]) for place in _TENSOR)
        yield ("inertia of body", b), {**inertia, "quat": turn, "fullinertia": full}
    count = Counter[str]()
    for shape in compiled.placed:
        kind = shape.name.partition(":")[0]
        i, count[kind] = count[kind], count[kind] + 1
        frame = shape.frame
        yield (f"place of {kind}", i), {"pos": frame.position, "quat": frame.quaternion or NO_TURN}
        yield (f"size of {kind}", i), {"size": shape.size}
        yield (f"mesh of {kind}", i), {"scale": shape.scale}
    joints = (joint for body in compiled.bodies for joint in body.joints)
    for j, joint in enumerate(joints):
        yield ("place of joint", j), {"pos": joint.at}
        yield ("dynamics of joint", j), {
            "armature": (joint.armature,), "axis": joint.axis, "springref": (joint.rest,),
            "ref": (joint.zero,), "stiffness": powers(joint.stiffness),
            "damping": powers(joint.damping),
        }  # fmt: skip


def _resistances(laws: Laws) -> Iterator[tuple[Key, Mapping[str, Values]]]:
    """Yield limits and dry friction, and the force ranges of joints."""
    for limit in laws.limits:
        yield _place("limit", limit), attributes(limit)
    for friction in laws.frictions:
        yield _place("friction", friction), attributes(friction)
    for joint, (force, lifts) in laws.joint_ranges.items():
        yield ("force of joint", joint), attributes(JointForceLimit(force=force, lifts=lifts))


def _place(table: str, row: SoftLimit | SoftFriction) -> Key:
    kind, index = ("joint", row.joint) if row.joint >= 0 else ("tendon", row.path)
    return f"{table} of {kind}", index


def _equality(equality: SoftEquality) -> Mapping[str, Values]:
    values: dict[str, Values] = {**attributes(equality)}
    if equality.anchors is not None:
        weld = equality.turn_scale is not None
        values["anchor"] = equality.anchors[weld].position
    return values


_WORDS: Mapping[str, str] = {"exact filter": "filterexact"}


def _drive(drive: Actuator) -> Mapping[str, Values]:
    kinds = [_WORDS.get(drive.dynamics, drive.dynamics), drive.gain, drive.bias]
    return {
        **drive_values(kinds, drive.constants, drive.gains, drive.biases),
        "ctrlrange": drive.control_range or (),
        "actrange": drive.state_range or (),
        "forcerange": drive.force_range or (),
        "actearly": (float(drive.early),),
    }


def _pairs(compiled: CompiledTree, path: ForceElement) -> Values:
    """Return the joints of a path by index, each with its coefficient."""
    pairs = ((compiled.joints.index(name), share) for name, share in path.joints)
    return tuple(value for pair in sorted(pairs) for value in pair)


def _misread(
    path: Path,
    expected: Mapping[Key, StatedRow],
    actual: Mapping[Key, Mapping[str, Values]],
    model: LawModel,
) -> Iterator[MisreadNumber]:
    """Yield numbers that differ, and rows that only one side has."""
    inertias = _RestInertias(model)
    for key, row in expected.items():
        for name, numbers, there in _different(row.values, actual.get(key), key[1], inertias):
            file, line = row.element.place
            yield MisreadNumber(
                subject=f"{name} of {row.subject}",
                sentence=f"{name} of {row.subject} is {_words(numbers)} by the file, and"
                f" {_words(there)} as compiled",
                discrepancy=_difference(numbers, there),
                file=file or path,
                line=line or 0,
            )
    for table, index in sorted(actual.keys() - expected.keys()):
        if not table.startswith(("path", "drive")):
            yield MisreadNumber(
                subject=table,
                sentence=f"{table} #{index} acts as compiled, and not by the file",
                discrepancy=1.0,
                file=path,
                line=0,
            )


def _different(
    values: Mapping[str, Values],
    measured: Mapping[str, Values] | None,
    index: int,
    inertias: _RestInertias,
) -> Iterator[tuple[str, Values, Values]]:
    """Yield attributes whose numbers differ, by the file and as compiled."""
    for name, numbers in values.items():
        there = () if measured is None else measured.get(name)
        if there is None or name == "dampratio":
            continue
        accepted, least = [numbers], ROUNDED
        if name == "biasprm" and "dampratio" in values and len(there) > len(numbers):
            gain, ratio = float(values["gainprm"][0]), float(values["dampratio"][0])
            least = RESOLVED
            accepted = [
                (*numbers, -2 * ratio * float(np.sqrt(gain * inertia)))
                for inertia in inertias.of_drive(index)
            ]
        measure = _difference
        if name in AS_WHOLE:
            measure, least = _difference_of_whole, AS_WHOLE[name]
            if name == "pos":
                measure = partial(_difference_of_whole, least=SMALLEST_PLACE)
        if name == "quat":  # both signs are one orientation
            accepted = [numbers, tuple(-float(one) for one in numbers)]
        if min(measure(one, there) for one in accepted) > least:
            yield name, accepted[0], there


class _RestInertias:
    """Inertias that drives feel in the drawn configuration."""

    def __init__(self, model: LawModel) -> None:
        self._model = model

    @cached_property
    def _posture(self) -> Posture:
        home = self._model.home[None]
        return next(self._model.tree.postures(home, np.zeros_like(home)))

    def of_drive(self, index: int) -> Iterator[float]:
        """Yield 1/(J M^-1 J^T); then the sum of M_jj/J_j^2, the rule of older compilers."""
        posture = self._posture
        row = posture.rows[self._model.laws.drives[index].path]
        yield 1 / float(row @ posture.inverse @ row)
        moved = np.flatnonzero(row**2 > 1e-15)
        yield float(np.sum(np.diagonal(posture.mass)[moved] / row[moved] ** 2))


def _difference(first: Values, other: Values) -> float:
    """Return the largest relative difference; 1 for words, or for rows of other lengths."""
    if len(first) != len(other):
        return 1.0
    return max((_apart(one, two) for one, two in zip(first, other, strict=True)), default=0.0)


def _difference_of_whole(first: Values, other: Values, least: float = 0.0) -> float:
    """Return the largest difference, relative to the largest number of the first row."""
    size = max(*(abs(float(one)) for one in first), least)
    pairs = zip(first, other, strict=True)
    return max(abs(float(one) - float(two)) for one, two in pairs) / (size or 1.0)


def _apart(first: Value, other: Value) -> float:
    if isinstance(first, str) or isinstance(other, str):
        return float(first != other)
    size = max(abs(first), abs(other))
    return abs(first - other) / size if size else 0.0


def _words(values: Values) -> str:
    return " ".join(one if isinstance(one, str) else f"{one:.12g}" for one in values) or "none"
