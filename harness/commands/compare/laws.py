"""Differences of limits, dry friction, contacts and drives, weighed by whole steps of A.

At states where rows of A act, A's law steps with B's numbers; the engine does not run again.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np
from msgspec.structs import replace as replace_fields

from physics_crosscheck.harness.checks.law_comparison import LawComparison, TreeLaw
from physics_crosscheck.harness.checks.law_states import SEED, evaluated_states
from physics_crosscheck.harness.engines.protocol import (
    EngineError,
    ModelSpec,
    WholeModel,
    WholeState,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.law_attributes import (
    ATTRIBUTES,
    ContactOptions,
    JointForceLimit,
    Row,
    with_attribute,
)
from physics_crosscheck.harness.modelfiles.mjcf.read import law_model
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs
from physics_crosscheck.harness.modelfiles.urdf.laws import ruled_model
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.reference.laws.soft import Part
from physics_crosscheck.reference.laws.step import LawModel, LawSolution
from physics_crosscheck.reference.mechanism.laws import (
    HardJoint,
    ImpulseLaws,
    ImpulseRules,
    Laws,
    SoftFriction,
    SoftLimit,
    SoftRules,
)
from physics_crosscheck.reference.mechanism.tree import TreeError
from .actuators import pair_actuators
from .candidate import Candidate, Facts
from .law_rows import (
    LEADING,
    Key,
    L,
    LawRow,
    SoftRows,
    hard_as_soft,
    shape_names,
    soft_as_hard,
    urdf_rows,
    with_row,
)
from .match import JointPair
from .side import apart, equal_values, make_property, values_shown

SAME = 8 * float(np.finfo(float).eps)
"""Relative difference of equal numbers."""

DEPTH = 0.01
"""Violation of a limit that only B has, rad or m."""


SPREADS, OUTWARD = (0.0, 0.3, 1.0, 1.0, 1.0), 5.0
"""Displacements of other joints at such a violation, rad or m, and outward speed for each of them.
"""


def compare_laws(
    models: tuple[Facts, Facts], pairs: tuple[JointPair, ...]
) -> tuple[ComparedProperty, ...] | None:
    """Return the numbers of the laws that differ, largest effect on a step of A first.

    Return None unless both engines act by a documented law.

    Args:
        models: A and B.
        pairs: of their joints.
    """
    try:
        b, a = (_load_laws(facts) for facts in reversed(models))  # A stays loaded
        if a is None or b is None or not _have_common_rows(a, b):
            return None
        rows = _rows(a, b, pairs)
        differences = tuple(_differences(*rows))
        return tuple(_weighed(a, differences)) if differences else ()
    except (TreeError, EngineError):
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class _LawSide:
    """A model with its laws, as an engine loads it with all its forces."""

    facts: Facts
    model: TreeLaw
    whole: WholeModel

    @property
    def file(self) -> Path:
        """The model file."""
        return self.facts.candidate.sidecar.model


def _have_common_rows(a: _LawSide, b: _LawSide) -> bool:
    """Return whether two files have rows in common: a compiled file has none of near-rigid laws."""
    kinds = {type(side.whole.rules) for side in (a, b)}
    return len(kinds) == 1 or kinds in ({NoneType, ImpulseRules}, {NoneType, SoftRules})


def _load_laws(facts: Facts) -> _LawSide | None:
    candidate = facts.candidate
    if not candidate.bare:
        return None
    spec = _shipped(candidate)
    whole = engines()[candidate.engine].load_whole(spec)
    if whole is None:
        return None
    model: TreeLaw | None
    if whole.rules is None:
        model = None if facts.compiled is None else law_model(facts.compiled)
        if model is not None and model.laws.uncovered:
            return None
    else:
        robot = read_as_it_runs(spec.path, {**spec.settings, "couplings": False})
        model = ruled_model(robot, whole.rules)
    return None if model is None else _LawSide(facts=facts, model=model, whole=whole)


def _shipped(candidate: Candidate) -> ModelSpec:
    """Return a model without the settings that the comparison adds, except its root."""
    spec = candidate.sidecar.spec(candidate.engine)
    added = candidate.given - {"floating"}
    return replace(
        spec, settings={key: value for key, value in spec.settings.items() if key not in added}
    )


def _rows(
    a: _LawSide, b: _LawSide, pairs: Sequence[JointPair]
) -> tuple[Mapping[Key, LawRow], Mapping[Key, LawRow]]:
    names_a, names_b = {pair.a: pair.a for pair in pairs}, {pair.b: pair.a for pair in pairs}
    soft_a, soft_b = _soft_sides(a, b, pairs, (names_a, names_b))
    mine, theirs = (
        list(soft.rows() if soft else urdf_rows(one.file, one.model, names))
        for one, soft, names in ((a, soft_a, names_a), (b, soft_b, names_b))
    )
    by_name = {pair.a: pair for pair in pairs}
    indices = {link.name: i for i, link in enumerate(a.model.tree.tree.links)}
    theirs = [_in_a(row, by_name, indices) for row in theirs]
    if SoftRules in {type(side.whole.rules) for side in (a, b)}:  # a URDF has no other rows
        mine, theirs = ([one for one in rows if one.key[:2] in _OF_JOINTS]
                        for rows in (mine, theirs))  # fmt: skip
    elif soft_a is not None and soft_b is None:
        theirs = list(hard_as_soft(theirs, soft_a))
        mine = [row for row in mine if row.key in {other.key for other in theirs}
                or row.key[:2] in _OF_JOINTS]  # fmt: skip
    elif soft_a is None and soft_b is not None:
        theirs = list(soft_as_hard({row.key: row for row in theirs}, soft_b, mine))
        mine = [row for row in mine if row.key[0] == "joints"]
    return {row.key: row for row in mine}, {row.key: row for row in theirs}


_OF_JOINTS = ("limits", "joint"), ("frictions", "joint")
"""First parts of the keys of the rows that all convex laws have."""


def _soft_sides(
    a: _LawSide,
    b: _LawSide,
    pairs: Sequence[JointPair],
    joint_names: tuple[Mapping[str, str], Mapping[str, str]],
) -> tuple[SoftRows | None, SoftRows | None]:
    compiled = [model_laws.facts.compiled for model_laws in (a, b)]
    both = [one if isinstance(model_laws.model, LawModel) else None
            for one, model_laws in zip(compiled, (a, b), strict=True)]  # fmt: skip
    shapes, same_bodies = frozenset[str](), False
    drives: tuple[Mapping[int, int], Mapping[int, int]]
    first, other = both
    if first is not None and other is not None:
        shapes = frozenset(shape_names(first)) & frozenset(shape_names(other)) - {""}
        same_bodies = len(first.bodies) == len(other.bodies)
        joints = {pair.a: pair.b for pair in pairs}
        drive_pairs = pair_actuators(first.actuators, other.actuators, joints).pairs
        drives = {i: i for i in drive_pairs}, {j: i for i, j in drive_pairs.items()}
    else:
        every = [{i: i for i in range(len(one.actuators))} if one else {} for one in both]
        drives = every[0], every[1]

    def rows(k: int) -> SoftRows | None:
        model, compiled_tree = (a, b)[k].model, both[k]
        if compiled_tree is None or not isinstance(model, LawModel):
            return None
        alike = len(compiled_tree.actuators) == len(model.laws.drives)
        return SoftRows(
            file=(a, b)[k].file,
            compiled=compiled_tree,
            model=model,
            joints=joint_names[k],
            shapes=shapes,
            drives=drives[k] if alike else {},
            same_bodies=same_bodies,
        )

    return rows(0), rows(1)


def _in_a(row: LawRow, pairs: Mapping[str, JointPair], indices: Mapping[str, int]) -> LawRow:
    if row.key[:2] in _OF_JOINTS and isinstance(row.row, SoftLimit | SoftFriction):
        row = replace(row, row=replace(row.row, joint=indices[row.key[-1]]))
    pair, limit = pairs.get(row.key[-1]), row.row
    if pair is None or not isinstance(limit, SoftLimit | HardJoint) or row.key[1] == "tendon":
        return row
    if limit.lower > limit.upper or (pair.slope, pair.offset) == (1.0, 0.0):
        return row
    lower, upper = sorted((end - pair.offset) / pair.slope for end in (limit.lower, limit.upper))
    return replace(row, row=replace(limit, lower=lower, upper=upper))


@dataclass(frozen=True, kw_only=True)
class _LawDifference:
    """An attribute of a row that differs."""

    attribute: str
    a: LawRow | None
    b: LawRow | None

    @cached_property
    def values(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The numbers of A and of B."""
        both = [() if row is None else row.values(self.attribute) for row in (self.a, self.b)]
        return both[0], both[1]

    @property
    def subject(self) -> str:
        """Its kind and name."""
        row = self.a or self.b
        assert row is not None
        return row.subject

    def applied(self, laws: L) -> L | None:
        """Return A's laws with B's numbers; None if these have no place there."""
        if self.a is None:
            assert self.b is not None
            table, index = self.b.key[0], self.b.index if self.b.key[0] == "joint_ranges" else -1
            return with_row(laws, table, index, self.b.row) if table in _ADDED else None
        table, index = self.a.key[0], self.a.index
        if self.b is None:
            return with_row(laws, table, index, None)
        current = _row_of(laws, self.a)
        return with_row(laws, table, index, with_attribute(current, self.attribute, self.b.row))


_ADDED = ("limits", "frictions", "joint_ranges")
"""Tables whose rows of joints A can take from B."""


def _row_of(laws: Laws | ImpulseLaws, row: LawRow) -> Row:
    """Return a row of laws that may have changed before."""
    table, index = row.key[0], row.index
    if isinstance(laws, Laws):
        if table == "options":
            return ContactOptions.from_laws(laws)
        if table == "joint_ranges":
            force, lifts = laws.joint_ranges[index]
            return JointForceLimit(force=force, lifts=lifts)
        if table == "pairs":
            return laws.pairs[index][2]
    rows: Sequence[Row] = getattr(laws, table)
    return rows[index]


def _differences(
    mine: Mapping[Key, LawRow], theirs: Mapping[Key, LawRow]
) -> Iterator[_LawDifference]:
    for key, row in mine.items():
        other = theirs.get(key)
        if other is None:
            continue
        for attribute in ATTRIBUTES[type(row.row)]:
            difference = _LawDifference(attribute=attribute, a=row, b=other)
            if not equal_values(*difference.values, SAME):
                yield difference
    removed = [row for key, row in mine.items() if key not in theirs]
    for row in sorted(removed, key=lambda row: -row.index):  # the indices of the rest stay
        if type(row.row) in LEADING:
            yield _LawDifference(attribute=LEADING[type(row.row)], a=row, b=None)
    for key, row in theirs.items():
        if key not in mine and type(row.row) in LEADING:
            yield _LawDifference(attribute=LEADING[type(row.row)], a=None, b=row)


def _weighed(a: _LawSide, differences: Sequence[_LawDifference]) -> Iterator[ComparedProperty]:
    groups: dict[tuple[object, ...], list[_LawDifference]] = {}
    for difference in differences:
        row = difference.a or difference.b
        assert row is not None
        key = row.key[0], difference.attribute, difference.values
        groups.setdefault(key, []).append(difference)
    every = list(groups.values())
    limits = [row for one in differences if one.attribute == "range" for row in (one.a, one.b)]
    effects = _effects(LawComparison(a.model, a.whole), every, limits)
    rows = [_property(one, effect) for group, effect in zip(every, effects, strict=True)
            for one in group]  # fmt: skip
    yield from sorted(rows, key=lambda row: -(row.effect or 0.0))


def _effects(
    comparison: LawComparison,
    groups: Sequence[Sequence[_LawDifference]],
    limits: Sequence[LawRow | None],
) -> Iterator[float | None]:
    """Yield the largest change of any component by each group, relative; None if it is unknown.

    A step of A takes the numbers of B, at states where rows of A act, and beyond these limits.
    """
    evaluated = evaluated_states(comparison)
    if not evaluated:
        yield from [None] * len(groups)
        return
    evaluated += comparison.evaluate(tuple(_at_limits(comparison, evaluated[0].state, limits)))
    scale, model = comparison.compare(evaluated).scale, comparison.laws
    expected = np.array([comparison.expected(one) for one in evaluated])
    touched = [set(one.surfaces) for each in evaluated for one in each.engine.contacts]
    parts = set[Part]()
    if isinstance(model, LawModel):
        solutions = [one.solution for one in evaluated if isinstance(one.solution, LawSolution)]
        parts = {part for one in solutions for part in model.acting(one)}
    for group in groups:
        laws: Any = _applied(group, model.laws)
        if laws is None:
            yield None
            continue
        changed = comparison.expected_by(model.under(laws), evaluated)
        effect = float(np.max(np.abs(changed - expected) / scale))
        acts = effect or all(_acts(one, model.laws, touched, parts) for one in group)
        yield effect if acts else None


def _acts(
    difference: _LawDifference,
    laws: Laws | ImpulseLaws,
    touched: Sequence[set[int]],
    parts: set[Part],
) -> bool:
    row = difference.a
    if row is None:
        return False
    table, index = row.key[0], row.index
    if table in ("options", "surfaces", "pairs"):
        wanted = {index} if table == "surfaces" else set[int]()
        if table == "pairs" and isinstance(laws, Laws):
            wanted = set(laws.pairs[index][:2])
        return any(wanted <= surfaces for surfaces in touched)
    kinds = PARTS.get(table, {}).get(difference.attribute, PARTS.get(table, {}).get(""))
    return any(part.kind == kinds and part.place == index for part in parts)


PARTS: Mapping[str, Mapping[str, str]] = {
    "limits": {"": "limit"},
    "frictions": {"": "dry friction"},
    "equalities": {"": "equality"},
    "drives": {"ctrlrange": "control", "": "force"},
    "joint_ranges": {"": "joint force"},
}
"""Kind of the part of the laws that a row is, by table and attribute."""


def _applied(group: Sequence[_LawDifference], laws: L) -> L | None:
    changed: L | None = laws
    for difference in group:
        changed = None if changed is None else difference.applied(changed)
    return changed


def _at_limits(
    comparison: LawComparison, state: WholeState, rows: Sequence[LawRow | None]
) -> Iterator[WholeState]:
    """Yield states beyond both ends of limits of joints, at rest and moving outward."""
    rng = np.random.default_rng(SEED)
    for row in rows:
        if row is None or not isinstance(row.row, SoftLimit | HardJoint):
            continue
        name, limit = row.key[-1], row.row
        if row.key[1] == "tendon" or name not in comparison.model.coordinates:
            continue
        place = comparison.model.coordinates.index(name)
        for sign, end in ((-1.0, limit.lower - DEPTH), (1.0, limit.upper + DEPTH)):
            for spread in SPREADS:  # elsewhere, so that other limits and equalities let it act
                z, m = state.z + spread * rng.normal(size=len(state.z)), state.m.copy()
                z[place], m[place] = end, sign * OUTWARD * spread
                yield state._replace(z=z, m=m)


_WORDS = {"cone": ("pyramidal", "elliptic"), "refsafe": ("disable", "enable")}
"""How a file states a switch that is off, and one that is on; others are false and true."""


def _property(difference: _LawDifference, effect: float | None) -> ComparedProperty:
    here, there = difference.values
    about, label, values = (
        difference.subject,
        difference.attribute,
        (values_shown(here), values_shown(there)),
    )
    unlike = [
        i
        for i, (x, y) in enumerate(zip(here, there, strict=False))
        if not equal_values([x], [y], SAME)
    ]
    single, i = len(here) == len(there) and len(unlike) == 1, unlike[0] if unlike else 0
    if single:
        label += f"[{i}]" if len(here) > 1 else ""
        here, there = (here[i],), (there[i],)
        if isinstance(here[0], bool):
            words = _WORDS.get(difference.attribute, ("false", "true"))
            values = words[here[0]], words[bool(there[0])]
        else:
            values = apart(float(here[0]), float(there[0]), 0.0)
    lines = [
        None if row is None else row.line(difference.attribute, i)
        for row in (difference.a, difference.b)
    ]
    message = f"{label} of {about}: {values[0]} in A, {values[1]} in B"
    if values == ("none", "none"):
        message = f"{about}: {'none' if difference.a is None else 'some'} in A, "
        message += f"{'none' if difference.b is None else 'some'} in B"
    record, _ = make_property(
        "law",
        about,
        message,
        a=float(here[0]) if single else None,
        b=float(there[0]) if single else None,
        lines=(lines[0], lines[1]),
        moves=False,
        relative=_relative(here, there),
    )
    return replace_fields(record, effect=number(effect))


def _relative(first: Sequence[float], other: Sequence[float]) -> float:
    if len(first) != len(other) or not first:
        return 1.0
    sizes = [(abs(x - y), max(abs(x), abs(y))) for x, y in zip(first, other, strict=True)]
    return max((float(miss / size) for miss, size in sizes if size), default=0.0)
