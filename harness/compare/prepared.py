"""Both models as they are run: loaded, their joints paired, and those without a partner held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from harness.compare.candidate import FOLLOWERS, Candidate, CompareError, Facts, facts, smooth
from harness.compare.execute import Execute, ask
from harness.compare.match import Match, match, spoken_for
from harness.compare.partners import Partners, partners
from harness.compare.placed import Placed, placed, positions, tree_of
from harness.engines.registry import engines
from harness.robots.robot import LeftOut
from harness.robots.system import names_of

Maps = tuple[Mapping[str, str], Mapping[str, str]]


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """What a comparison begins with.

    Attributes:
        a, b: as they are run.
        facts: of both.
        match: of their coordinates.
        still: joints of A and of B that are held, and where.
        notes: what was done, a sentence each.
    """

    a: Candidate
    b: Candidate
    facts: tuple[Facts, Facts]
    match: Match
    still: tuple[Mapping[str, float], Mapping[str, float]]
    notes: tuple[str, ...]


def prepare(
    execute: Execute, a: Candidate, b: Candidate, joints: Maps, as_shipped: bool
) -> Prepared:
    """Load two models and pair their joints.

    Raises:
        CompareError: for joints without a partner that can't be held, with the remedy.
        FailureError: where an engine fails.
    """
    if not as_shipped:
        a, b = smooth(a, b)
    one, other = ask(execute, a, facts, a), ask(execute, b, facts, b)
    readback = a.sidecar.readback, b.sidecar.readback
    names = one.coordinates, other.coordinates
    given = spoken_for(*names, joints, readback)
    found = partners(*names, given, _drawn(one, other))
    notes = list(_left_out(a, b, one, other, as_shipped))
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
    if not as_shipped:
        a, one, b, other, more = _actuated(
            execute, (a, b), (one, other), bool(still[0] or still[1])
        )
        notes += more
    matched = _matched(one, other, joints, readback, found, still)
    return Prepared(
        a=a, b=b, facts=(one, other), match=matched, still=(still[0], still[1]), notes=tuple(notes)
    )


def _actuated(
    execute: Execute, models: tuple[Candidate, Candidate], own: tuple[Facts, Facts], held: bool
) -> tuple[Candidate, Facts, Candidate, Facts, tuple[str, ...]]:
    """Actuators held at controls, the same in both models; or switched off, where one has others.

    What a sidecar states of them stands.
    """
    (a, b), (one, other) = models, own
    asked = [_controls(*pair) for pair in zip(models, own, strict=True)]
    if asked[0] is None or asked[1] is None or not (asked[0] or asked[1]):
        return a, one, b, other, ()
    if asked[0] == asked[1] and not held:
        note = f"actuators ({len(asked[0])}), each held at a control within its range"
        same = list(asked[0])
        return a.at(controls=same), one, b.at(controls=same), other, (note,)
    found: list[tuple[Candidate, Facts]] = []
    notes = []
    for candidate, its in zip(models, own, strict=True):
        if its.actuators:
            notes.append(f"left out of {candidate.label}: actuators ({len(its.actuators)})")
            off = candidate.at(actuators=False)
            found.append((off, ask(execute, off, facts, off)))
        else:
            found.append((candidate, its))
    return *found[0], *found[1], tuple(notes)


def _controls(candidate: Candidate, own: Facts) -> tuple[float, ...] | None:
    """At which a file's actuators are held; None where a sidecar tells of them."""
    stated = candidate.sidecar.spec(candidate.engine).settings
    if {"controls", "actuators"} & set(stated) or not stated.get("smooth", False):
        return None if own.actuators else ()
    return own.robot.controls if own.robot is not None else ()


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
    """Both files' joints as they are drawn; None where one is no tree of hinges and slides."""
    sides = []
    for own in (one, other):
        tree = tree_of(own.robot, own.coordinates)
        if tree is None or set(names_of(tree)) != set(own.coordinates):
            return None
        sides.append(placed(tree, positions(tree, own.coordinates, own.home)))
    return sides[0], sides[1]


def _held(candidate: Candidate, own: Facts, alone: Sequence[str]) -> dict[str, float]:
    """Where joints without a partner are held; none in models whose sidecar declares couplings.

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


ALWAYS = ("how ", "limits of effort", "limits of velocity")
"""How begins what is left out whatever is asked."""

COUPLED = ("mimic", "equality", FOLLOWERS)
"""How begins what couples joints."""


def _left_out(
    a: Candidate, b: Candidate, one: Facts, other: Facts, as_shipped: bool
) -> tuple[str, ...]:
    """What is said of contacts and the like."""
    if as_shipped:
        return ("as shipped: with contacts, limits, dry friction and couplings as the files say",)
    told = [_told(*pair) for pair in ((a, one), (b, other))]
    if a.sidecar.model.resolve() == b.sidecar.model.resolve() or told[0] == told[1]:
        return (f"left out of both: {told[0]}",) if told[0] else ()
    return tuple(
        f"left out of {candidate.label}: {text}"
        for candidate, text in zip((a, b), told, strict=True)
        if text
    )


def _told(candidate: Candidate, own: Facts) -> str:
    """Such as: contact geometry (12), dry friction (7)."""
    settings = candidate.sidecar.spec(candidate.engine).settings
    if own.robot is None or not settings.get("smooth", False):
        return ""
    kept = COUPLED if settings.get("couplings", True) else ()
    parts = (one for one in own.robot.left_out if not one.what.startswith((*ALWAYS, *kept)))
    return ", ".join(map(_counted, parts))


def _counted(one: LeftOut) -> str:
    return one.what if one.count == 1 else f"{one.what} ({one.count})"
