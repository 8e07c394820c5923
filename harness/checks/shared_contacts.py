"""Contacts without a closed form, compared between the engines of one file.

All engines put its joints at the same postures. A difference changes no outcome; any normal bounds
the depth of two shapes from above, and so may show which engine's depth is wrong.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence

import numpy as np
from msgspec.structs import replace

from physics_crosscheck.harness.engines.protocol import WholeState
from physics_crosscheck.harness.records.base import number, rounded
from physics_crosscheck.harness.records.case import Case, Touch, WholeStep
from physics_crosscheck.harness.results.status import counted, listed
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.solids import distance, gap
from physics_crosscheck.reference.mechanism.laws import ContactPoint
from .contacts import ROUGH, Pair, TouchingShapes, extent_of
from .law_comparison import M, S, WholeStepComparison
from .law_states import SEED

POSTURES, DIGITS = 16, 10
"""Number of postures, and digits of the recorded numbers."""

ALIKE = (2 * ROUGH) ** 0.5
"""Turn of a normal, rad, and relative shift of a point, that change a depth by `ROUGH` or less."""


def shared_contacts(
    touching: TouchingShapes, comparison: WholeStepComparison[M, S]
) -> tuple[tuple[str, ...], tuple[Touch, ...]]:
    """Return digests of postures in the file's ranges, and the deepest contacts there.

    Both are empty if all pairs of shapes have closed forms, or one is a floor that the file lacks.
    """
    model, names = comparison.model, {i: comparison.shape_name(i) for i in touching.unknown}
    names |= {one.surface: one.shape.name for one in touching.shapes if one.shape}
    shapes = {one.surface: one for one in touching.shapes}
    home = next(comparison.postures([next(iter(model.starts))]))
    solids = {i: one.in_world(home) for i, one in shapes.items()}
    pairs = {
        pair
        for pair in touching.allowed
        if set(pair) <= set(names)
        and (touching.unknown & set(pair) or distance(*(solids[i] for i in pair)) is None)
    }
    digests, touches = list[str](), list[Touch]()
    for digest, state, posture in _postures(comparison) if pairs else ():
        digests.append(digest)
        deepest = dict[Pair, ContactPoint]()
        for contact in sorted(model.contacts(state), key=lambda touch: touch.distance):
            pair = min(contact.surfaces), max(contact.surfaces)
            if pair in pairs and contact.distance < 0:
                deepest.setdefault(pair, contact)
        for pair, contact in deepest.items():
            both = [shapes[i].in_world(posture) for i in pair if i in shapes]
            away = contact.frame[0] if contact.surfaces == pair else -contact.frame[0]
            first, other = sorted(names[i] for i in pair)
            touches.append(
                Touch(
                    posture=digest,
                    shapes=(first, other),
                    distance=contact.distance,
                    normal=rounded(list(away if names[pair[0]] == first else -away), DIGITS),
                    point=rounded(list(contact.position), DIGITS),
                    bound=number(gap(both[0], both[1], away)) if len(both) == 2 else None,
                    error=ROUGH * (extent_of(*both) or 1.0) + model.shape_error,
                )
            )
    return tuple(digests), tuple(touches)


def _postures(
    comparison: WholeStepComparison[M, S],
) -> Iterator[tuple[str, WholeState, Posture]]:
    """Yield a digest of each posture, its state at rest, and the tree.

    Joints are anywhere in their ranges, hinges without one anywhere, other joints at home.
    """
    order, tree = np.array(comparison.order), comparison.laws.tree.tree
    start, ranges = next(iter(comparison.model.starts)), comparison.ranges[order]
    for link, there in zip(tree.links, tree.velocities, strict=True):
        if link.kind == "hinge" and not np.isfinite(ranges[there]).all():
            ranges[there] = -np.pi, np.pi
    drawn, rng = np.isfinite(ranges).all(axis=1), np.random.default_rng(SEED)
    low, high = ranges[drawn].T
    for _ in range(POSTURES):
        z, place = start.z.copy(), low + (high - low) * rng.uniform(size=len(low))
        z[order[drawn]] = place
        digest = hashlib.sha256(" ".join(f"{one:.9g}" for one in place).encode()).hexdigest()
        state = start._replace(z=z)
        yield digest[:12], state, next(comparison.postures([state]))


def with_shared_contacts(cases: Sequence[Case]) -> list[Case]:
    """Add to cases how the engines of one file agree on contacts without a closed form."""
    return [
        replace(case, whole_step=replace(step, between=tuple(_between(case, cases))))
        if (step := case.whole_step) is not None and step.postures
        else case
        for case in cases
    ]


def _between(case: Case, cases: Sequence[Case]) -> Iterator[str]:
    """Yield how other engines agree with a case's, one sentence each, the same on both sides."""
    name = replace(case.id, engine="")
    for other in cases:
        same = other.folder == case.folder and replace(other.id, engine="") == name
        if same and other.engine != case.engine:
            pair = sorted((case, other), key=lambda one: one.engine)
            steps = {one.engine: one.whole_step for one in pair if one.whole_step is not None}
            if len(steps) == 2 and (sentence := "; ".join(_compared(steps))):
                yield sentence


def _compared(steps: dict[str, WholeStep]) -> Iterator[str]:
    """Yield how two engines agree on their contacts at the postures of both."""
    common = frozenset[str].intersection(*(frozenset(step.postures) for step in steps.values()))
    sides = {
        engine: {(one.posture, one.shapes): one for one in step.touches if one.posture in common}
        for engine, step in steps.items()
    }
    mine, theirs = sides.values()
    pairs = [(one, theirs[key]) for key, one in mine.items() if key in theirs]
    alike = [pair for pair in pairs if _off(*pair) <= 1]
    if mine or theirs:
        apart = [_turned_and_moved(*pair) for pair in alike]
        turned, moved = (sum(one[k] <= ALIKE for one in apart) for k in range(2))
        yield (
            f"{' and '.join(sides)} agree on the depth of {len(alike)} of"
            f" {counted(len(pairs), 'contact')} without a closed form, on the normal of {turned}"
            f" and the point of {moved}"
        )
    if len(alike) < len(pairs):
        yield _apart(tuple(sides), max(pairs, key=lambda pair: _off(*pair)))
    for (engine, here), there in zip(sides.items(), (theirs, mine), strict=True):
        # A contact that is less deep than its error may be none elsewhere.
        rest = [one for key, one in here.items() if key not in there and -one.distance > one.error]
        if names := list(dict.fromkeys(" and ".join(one.shapes) for one in rest)):
            yield f"{counted(len(rest), 'contact')} in {engine} alone: {listed(names, 3)}"


def _off(first: Touch, other: Touch) -> float:
    """Return the difference of two depths, relative to what the engines' methods explain."""
    return abs(first.distance - other.distance) / (first.error + other.error)


def _turned_and_moved(first: Touch, other: Touch) -> tuple[float, float]:
    """Return the turn of a normal, rad, and the shift of a point across it, by the shapes' size.

    Along it, engines choose a point by rules of their own; an edge or an area has many.
    """
    normal, turned, point, moved = (
        np.array(values, dtype=float)
        for values in (first.normal, other.normal, first.point, other.point)
    )
    across = moved - point - normal * float(normal @ (moved - point))
    size = max(first.error, other.error) / ROUGH
    return float(np.linalg.norm(turned - normal)), float(np.linalg.norm(across)) / size


def _apart(engines: tuple[str, ...], pair: tuple[Touch, Touch]) -> str:
    """Return two depths, and which one is too large by the normal of the other engine."""
    deep, shallow = sorted(zip(pair, engines, strict=True), key=lambda side: side[0].distance)
    text = f"{' and '.join(deep[0].shapes)} are " + ", ".join(
        f"{-one.distance:.3g} m deep in {engine}" for one, engine in (deep, shallow)
    )
    bound = shallow[0].bound
    if bound is None or deep[0].distance > bound - deep[0].error:
        return text
    far = f"{-bound:.3g} m along {shallow[1]}'s normal part the shapes"
    return f"{text}; {far}, so that the depth in {deep[1]} is too large"
