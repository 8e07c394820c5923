"""Preparation of both models: load them, pair their joints, and lock joints without a partner."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.compare.actuators import held_alike, pair_actuators
from physics_crosscheck.harness.compare.candidate import (
    FOLLOWERS,
    Candidate,
    CompareError,
    Facts,
    facts,
    smooth,
)
from physics_crosscheck.harness.compare.execute import Execute, ask
from physics_crosscheck.harness.compare.match import Match, match, spoken_for
from physics_crosscheck.harness.compare.partners import Partners, partners
from physics_crosscheck.harness.compare.placed import Placed, placed, positions, tree_of
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.robot import Omission
from physics_crosscheck.harness.modelfiles.robot_system import names_of
from physics_crosscheck.reference.mechanism.tree import WORLD

Maps = tuple[Mapping[str, str], Mapping[str, str]]


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """Input of a comparison.

    Attributes:
        a, b: as they run.
        facts: of both.
        match: of their coordinates.
        still: locked joints of A and of B, with their positions.
        notes: actions, a sentence each.
        uncompared: omissions that may differ, since no literals of one format show them.
    """

    a: Candidate
    b: Candidate
    facts: tuple[Facts, Facts]
    match: Match
    still: tuple[Mapping[str, float], Mapping[str, float]]
    notes: tuple[str, ...]
    uncompared: tuple[str, ...]


def prepare(
    execute: Execute, a: Candidate, b: Candidate, joints: Maps, include_constraints: bool
) -> Prepared:
    """Load two models and pair their joints.

    Raises:
        CompareError: for unpaired joints that cannot be locked, with the remedy.
        FailureError: if an engine fails.
    """
    if not include_constraints:
        a, b = smooth(a, b)
    (a, one), (b, other), floated = _loaded(execute, (a, b))
    readback = a.sidecar.readback, b.sidecar.readback
    names = one.coordinates, other.coordinates
    given = spoken_for(*names, joints, readback)
    found = partners(*names, given, _drawn(one, other))
    notes = [*_left_out(a, b, one, other, include_constraints), *floated]
    unlike = [] if include_constraints else list(_uncompared(a, b, one, other))
    still: list[Mapping[str, float]] = []
    for candidate, own, alone in zip((a, b), (one, other), found.alone, strict=True):
        held = _held(candidate, own, alone) if found.pairs else {}
        still.append(held)
        of = "B" if candidate.label == "A" else "A"
        notes += [
            f"joint {name} of {candidate.label} has no partner in {of}: held at {at:g}"
            for name, at in held.items()
        ]
    if still[0]:
        a = a.at(held=list(still[0]))
        one = ask(execute, a, facts, a)
    if still[1]:
        b = b.at(held=list(still[1]))
        other = ask(execute, b, facts, b)
    if not include_constraints:
        a, one, b, other, more = _actuated(
            execute, (a, b), (one, other), _joints(found, joints), bool(still[0] or still[1])
        )
        notes += more
        unlike += [note for note in more if note.startswith(NOT_COMPARED)]
    matched = _matched(one, other, joints, readback, found, still)
    return Prepared(
        a=a,
        b=b,
        facts=(one, other),
        match=matched,
        still=(still[0], still[1]),
        notes=tuple(notes),
        uncompared=tuple(unlike),
    )


def _loaded(
    execute: Execute, models: tuple[Candidate, Candidate]
) -> tuple[tuple[Candidate, Facts], tuple[Candidate, Facts], list[str]]:
    """Load both models; let the root of an unspecified URDF float if the other model's does."""
    found: dict[str, tuple[Candidate, Facts]] = {}
    notes = []
    for candidate in sorted(models, key=_may_float):
        if _may_float(candidate) and any(_floats(own) for _, own in found.values()):
            (other,) = found
            candidate = candidate.at(floating=True)
            notes.append(f"the root link of {candidate.label} moves freely, as that of {other}")
        found[candidate.label] = candidate, ask(execute, candidate, facts, candidate)
    return found[models[0].label], found[models[1].label], notes


def _may_float(candidate: Candidate) -> bool:
    """Return whether a URDF's root may float, since neither sidecar nor settings state it."""
    stated = "floating" in candidate.sidecar.spec(candidate.engine).settings
    return candidate.sidecar.model.suffix == ".urdf" and candidate.bare and not stated


def _floats(own: Facts) -> bool:
    """Return whether each body that the world carries moves freely."""
    links = () if own.robot is None or own.robot.tree is None else own.robot.tree.links
    kinds = [link.kind for link in links if link.parent == WORLD]
    return bool(kinds) and set(kinds) == {"free"}


def _actuated(
    execute: Execute,
    models: tuple[Candidate, Candidate],
    own: tuple[Facts, Facts],
    joints: Mapping[str, str],
    held: bool,
) -> tuple[Candidate, Facts, Candidate, Facts, tuple[str, ...]]:
    """Hold actuators at equal controls in both models, or switch them off.

    They are switched off if joints are locked, which removes the actuators on them, or if the
    other format has none. Settings of a sidecar are kept.
    """
    (a, b), (one, other) = models, own
    stated = any(_is_stated(*pair) for pair in zip(models, own, strict=True))
    if stated or not (one.actuators or other.actuators):
        return a, one, b, other, ()
    if held or one.compiled is None or other.compiled is None:
        return _without_actuators(execute, models, own, held)
    pairs = pair_actuators(one.actuators, other.actuators, joints)
    at = held_alike(one.compiled, other.compiled, pairs)
    # States that move in one engine only would differ without a difference of the files.
    move = all("activations" in engines()[candidate.engine].switches for candidate in models)
    found: list[tuple[Candidate, Facts]] = []
    for candidate, values in zip(models, at, strict=True):
        settings: dict[str, object] = {"controls": list(values.controls)}
        if values.states and move:
            settings["activations"] = list(values.states)
        acting = candidate.at(**settings)
        found.append((acting, ask(execute, acting, facts, acting)))
    notes = list(pairs.how)
    if pairs.pairs:
        notes.append(f"actuators ({len(pairs.pairs)}), each held at a control within its range")
    for candidate, its, alone in zip(models, own, pairs.alone, strict=True):
        count = sum(its.actuators[i].covered for i in alone)
        if count:
            who = f"actuators of {candidate.label} without a partner ({count})"
            notes.append(f"{who}, each held likewise")
    return *found[0], *found[1], tuple(notes)


def _without_actuators(
    execute: Execute,
    models: tuple[Candidate, Candidate],
    own: tuple[Facts, Facts],
    held: bool,
) -> tuple[Candidate, Facts, Candidate, Facts, tuple[str, ...]]:
    """Switch actuators off in both models."""
    why = "since joints are held" if held else "since the other file's format has none"
    found: list[tuple[Candidate, Facts]] = []
    notes = []
    for candidate, its in zip(models, own, strict=True):
        if its.actuators:
            count = len(its.actuators)
            notes.append(f"{NOT_COMPARED}: actuators ({count}) of {candidate.label}, {why}")
            off = candidate.at(actuators=False)
            found.append((off, ask(execute, off, facts, off)))
        else:
            found.append((candidate, its))
    return *found[0], *found[1], tuple(notes)


def _is_stated(candidate: Candidate, own: Facts) -> bool:
    """Return whether a sidecar states a file's actuators."""
    stated = candidate.sidecar.spec(candidate.engine).settings
    switched = {"controls", "actuators"} & set(stated) or not stated.get("smooth", False)
    return bool(own.actuators) and bool(switched)


def _joints(found: Partners, joints: Maps) -> dict[str, str]:
    """Return joints of A with their partners in B, by pairing and by the user's map.

    A free joint represents its coordinates.
    """
    pairs = {**found.pairs, **{name: text.lstrip("-") for name, text in joints[0].items()}}
    whole = {name.partition(":")[0]: its.partition(":")[0] for name, its in pairs.items()}
    return {**whole, **pairs}


def _matched(
    one: Facts,
    other: Facts,
    joints: Maps,
    readback: Maps,
    found: Partners,
    still: Sequence[Mapping[str, float]],
) -> Match:
    try:
        return match(one.coordinates, other.coordinates, joints, readback, found)
    except CompareError as error:
        if any(found.alone) and not any(still):
            message = f"{error}; none was found by name, order or geometry, and none can be held"
            raise CompareError(message) from None
        raise


def _drawn(one: Facts, other: Facts) -> tuple[Placed, Placed] | None:
    """Return both files' joints as drawn; None if one is not a tree of hinges and slides."""
    sides = []
    for own in (one, other):
        tree = tree_of(own.robot, own.coordinates)
        if tree is None or set(names_of(tree)) != set(own.coordinates):
            return None
        sides.append(placed(tree, positions(tree, own.coordinates, own.home)))
    return sides[0], sides[1]


def _held(candidate: Candidate, own: Facts, alone: Sequence[str]) -> dict[str, float]:
    """Return positions of unpaired joints to lock; {} for models whose sidecar declares couplings.

    There a joint may follow others.
    """
    if not candidate.bare or "held" not in engines()[candidate.engine].switches:
        return {}
    tree = tree_of(own.robot, own.coordinates)
    single = {} if tree is None else {link.name: link.kind for link in tree.links}
    return {
        name: float(own.home[own.coordinates.index(name)])
        for name in alone
        if single.get(name) in ("hinge", "slide")
    }


def _uncompared(a: Candidate, b: Candidate, one: Facts, other: Facts) -> Iterator[str]:
    """Yield omissions of files of two formats; position limits are read from both."""
    if a.sidecar.model.suffix == b.sidecar.model.suffix:
        return
    for candidate, own in ((a, one), (b, other)):
        parts = [_counted(part) for part in _parts(candidate, own) if part.what != LIMITS]
        if parts:
            yield f"{NOT_COMPARED}: {', '.join(parts)}, in {candidate.label}"


LIMITS = "limits of position"

NOT_COMPARED = "not compared"
"""Start of a note about omissions."""

ALWAYS = ("how ", "limits of effort", "limits of velocity")
"""Start of omissions that are made with all options."""

COUPLED = ("mimic", "equality", FOLLOWERS)
"""Start of omissions that couple joints."""


def _left_out(
    a: Candidate, b: Candidate, one: Facts, other: Facts, include_constraints: bool
) -> tuple[str, ...]:
    """Return notes about contacts and other omissions."""
    if include_constraints:
        return ("contacts, joint limits, dry friction and couplings of the files are included",)
    told = [_told(*pair) for pair in ((a, one), (b, other))]
    if a.sidecar.model.resolve() == b.sidecar.model.resolve() or told[0] == told[1]:
        return (f"{NOT_COMPARED}: {told[0]}",) if told[0] else ()
    return tuple(
        f"{NOT_COMPARED}: {text}, in {candidate.label}"
        for candidate, text in zip((a, b), told, strict=True)
        if text
    )


def _told(candidate: Candidate, own: Facts) -> str:
    """Format omissions, such as: contact geometry (12), dry friction (7)."""
    return ", ".join(map(_counted, _parts(candidate, own)))


def _parts(candidate: Candidate, own: Facts) -> list[Omission]:
    """Return what a model's motions leave out."""
    settings = candidate.sidecar.spec(candidate.engine).settings
    if own.robot is None or not settings.get("smooth", False):
        return []
    kept = COUPLED if settings.get("couplings", True) else ()
    return [one for one in own.robot.left_out if not one.what.startswith((*ALWAYS, *kept))]


def _counted(one: Omission) -> str:
    return one.what if one.count == 1 else f"{one.what} ({one.count})"
