"""Contacts without a closed form, compared between the engines of one file.

All engines put its joints at the same postures. A difference changes no outcome; any normal bounds
the depth of two shapes from above, and so may show which engine's depth is wrong.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

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
from .law_comparison import LawComparison
from .law_states import SEED

POSTURES, DIGITS = 16, 10
"""Number of postures, and digits of the recorded numbers."""

ALIKE = (2 * ROUGH) ** 0.5
"""Turn of a normal, rad, and relative shift of a point, that change a depth by `ROUGH` or less."""


def shared_contacts(
    touching: TouchingShapes, comparison: LawComparison
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


def _postures(comparison: LawComparison) -> Iterator[tuple[str, WholeState, Posture]]:
    """Yield postures: joints are anywhere in their ranges, hinges without one anywhere."""
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
    files: dict[tuple[str, str, str], dict[str, WholeStep]] = {}
    for case in cases:
        if case.whole_step is not None and case.whole_step.postures:
            steps = files.setdefault((case.folder, case.model, case.scenario), {})
            steps[case.engine] = case.whole_step
    result = []
    for case in cases:
        steps = files.get((case.folder, case.model, case.scenario), {})
        pairs = [pair for pair in combinations(sorted(steps), 2) if case.engine in pair]
        rows = ("; ".join(_compared({one: steps[one] for one in pair})) for pair in pairs)
        if between := tuple(filter(None, rows)):
            case = replace(case, whole_step=replace(steps[case.engine], between=between))
        result.append(case)
    return result


def _compared(steps: Mapping[str, WholeStep]) -> Iterator[str]:
    """Yield how two engines agree on their contacts at the postures of both."""
    (first, other), (before, after) = steps, steps.values()
    mine, theirs = (
        {(touch.posture, touch.shapes): touch for touch in here.touches if touch.posture in there}
        for here, there in ((before, after.postures), (after, before.postures))
    )
    pairs = [(mine[key], theirs[key]) for key in mine if key in theirs]
    rows = np.array([_apart(*pair) for pair in pairs]).reshape(-1, 3)
    deep = rows[:, 0] <= 1
    if mine or theirs:
        turned, moved = np.sum(deep[:, None] & (rows[:, 1:] <= ALIKE), axis=0)
        yield (
            f"{first} and {other} agree on the depth of {np.sum(deep)} of"
            f" {counted(len(pairs), 'contact')} without a closed form, on the normal of {turned}"
            f" and the point of {moved}"
        )
    if not deep.all():
        worst = sorted(
            zip(pairs[int(np.argmax(rows[:, 0]))], steps, strict=True),
            key=lambda side: side[0].distance,
        )
        yield f"{' and '.join(worst[0][0].shapes)} are " + ", ".join(
            f"{-touch.distance:.3g} m deep in {engine}" for touch, engine in worst
        )
        (large, engine), (small, right) = worst
        if small.bound is not None and large.distance < small.bound - large.error:
            far = f"{-small.bound:.3g} m along {right}'s normal part the shapes"
            yield f"{far}, so that the depth in {engine} is too large"
    for engine, here, there in ((first, mine, theirs), (other, theirs, mine)):
        # A contact that is less deep than its error may be none elsewhere.
        lost = [t for key, t in here.items() if key not in there and -t.distance > t.error]
        if names := list(dict.fromkeys(" and ".join(touch.shapes) for touch in lost)):
            yield f"{counted(len(lost), 'contact')} in {engine} alone: {listed(names, 3)}"


def _apart(first: Touch, other: Touch) -> tuple[float, float, float]:
    """Return differences of a contact: of depths, relative to what the engines' methods explain,
    of normals, rad, and of points across the normal, relative to the shapes.

    Along it, engines choose a point by rules of their own; an edge or an area has many.
    """
    normal, turned, point, moved = (
        np.array(values, dtype=float)
        for values in (first.normal, other.normal, first.point, other.point)
    )
    across = moved - point - normal * float(normal @ (moved - point))
    size = max(first.error, other.error) / ROUGH
    off = abs(first.distance - other.distance) / (first.error + other.error)
    return off, float(np.linalg.norm(turned - normal)), float(np.linalg.norm(across)) / size
