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
from physics_crosscheck.harness.compare.partners import JointPairs, pair_joints
from physics_crosscheck.harness.compare.placed import PlacedTree, placed, positions, tree_of
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.robot import Omission
from physics_crosscheck.harness.modelfiles.robot_system import names_of
from physics_crosscheck.reference.mechanism.tree import WORLD

Maps = tuple[Mapping[str, str], Mapping[str, str]]


@dataclass(frozen=True, kw_only=True)
class PreparedComparison:
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
) -> PreparedComparison:
    """Load two models and pair their joints.

    Raises:
        CompareError: for unpaired joints that cannot be locked, with the remedy.
        FailureError: if an engine fails.
    """
    if not include_constraints:
        a, b = smooth(a, b)
    (a, facts_a), (b, facts_b), floated = _loaded(execute, (a, b))
    readback = a.sidecar.readback, b.sidecar.readback
    names = facts_a.coordinates, facts_b.coordinates
    given = spoken_for(*names, joints, readback)
    joint_pairs = pair_joints(*names, given, _drawn(facts_a, facts_b))
    notes = [*_left_out(a, b, facts_a, facts_b, include_constraints), *floated]
    unlike = [] if include_constraints else list(_uncompared(a, b, facts_a, facts_b))
    still: list[Mapping[str, float]] = []
    for candidate, model_facts, unpaired in zip(
        (a, b), (facts_a, facts_b), joint_pairs.unpaired, strict=True
    ):
        held = _held(candidate, model_facts, unpaired) if joint_pairs.pairs else {}
        still.append(held)
        other_label = "B" if candidate.label == "A" else "A"
        notes += [
            f"joint {name} of {candidate.label} has no partner in {other_label}: held at {at:g}"
            for name, at in held.items()
        ]
    if still[0]:
        a = a.with_settings(held=list(still[0]))
        facts_a = ask(execute, a, facts, a)
    if still[1]:
        b = b.with_settings(held=list(still[1]))
        facts_b = ask(execute, b, facts, b)
    if not include_constraints:
        a, facts_a, b, facts_b, more = _actuated(
            execute,
            (a, b),
            (facts_a, facts_b),
            _joints(joint_pairs, joints),
            bool(still[0] or still[1]),
        )
        notes += more
        unlike += [note for note in more if note.startswith(NOT_COMPARED)]
    matched = _matched(facts_a, facts_b, joints, readback, joint_pairs, still)
    return PreparedComparison(
        a=a,
        b=b,
        facts=(facts_a, facts_b),
        match=matched,
        still=(still[0], still[1]),
        notes=tuple(notes),
        uncompared=tuple(unlike),
    )


def _loaded(
    execute: Execute, models: tuple[Candidate, Candidate]
) -> tuple[tuple[Candidate, Facts], tuple[Candidate, Facts], list[str]]:
    """Load both models; let the root of an unspecified URDF float if the other model's does."""
    loaded: dict[str, tuple[Candidate, Facts]] = {}
    notes = []
    for candidate in sorted(models, key=_may_float):
        if _may_float(candidate) and any(_floats(own) for _, own in loaded.values()):
            (other,) = loaded
            candidate = candidate.with_settings(floating=True)
            notes.append(f"the root link of {candidate.label} moves freely, as that of {other}")
        loaded[candidate.label] = candidate, ask(execute, candidate, facts, candidate)
    return loaded[models[0].label], loaded[models[1].label], notes


def _may_float(candidate: Candidate) -> bool:
    """Return whether a URDF's root may float, since neither sidecar nor settings state it."""
    stated = "floating" in candidate.sidecar.spec(candidate.engine).settings
    return candidate.sidecar.model.suffix == ".urdf" and candidate.bare and not stated


def _floats(model_facts: Facts) -> bool:
    """Return whether each body that the world carries moves freely."""
    robot = model_facts.robot
    links = () if robot is None or robot.tree is None else robot.tree.links
    kinds = [link.kind for link in links if link.parent == WORLD]
    return bool(kinds) and set(kinds) == {"free"}


def _actuated(
    execute: Execute,
    models: tuple[Candidate, Candidate],
    both_facts: tuple[Facts, Facts],
    joints: Mapping[str, str],
    held: bool,
) -> tuple[Candidate, Facts, Candidate, Facts, tuple[str, ...]]:
    """Hold actuators at equal controls in both models, or switch them off.

    They are switched off if joints are locked, which removes the actuators on them, or if the
    other format has none. Settings of a sidecar are kept.
    """
    (a, b), (facts_a, facts_b) = models, both_facts
    stated = any(_is_stated(*pair) for pair in zip(models, both_facts, strict=True))
    if stated or not (facts_a.actuators or facts_b.actuators):
        return a, facts_a, b, facts_b, ()
    if held or facts_a.compiled is None or facts_b.compiled is None:
        return _without_actuators(execute, models, both_facts, held)
    pairs = pair_actuators(facts_a.actuators, facts_b.actuators, joints)
    inputs = held_alike(facts_a.compiled, facts_b.compiled, pairs)
    # States that move in one engine only would differ without a difference of the files.
    move = all("activations" in engines()[candidate.engine].switches for candidate in models)
    acting_models: list[tuple[Candidate, Facts]] = []
    for candidate, values in zip(models, inputs, strict=True):
        settings: dict[str, object] = {"controls": list(values.controls)}
        if values.states and move:
            settings["activations"] = list(values.states)
        acting = candidate.with_settings(**settings)
        acting_models.append((acting, ask(execute, acting, facts, acting)))
    notes = list(pairs.how)
    if pairs.pairs:
        notes.append(f"actuators ({len(pairs.pairs)}), each held at a control within its range")
    for candidate, model_facts, unpaired in zip(models, both_facts, pairs.unpaired, strict=True):
        count = sum(model_facts.actuators[i].covered for i in unpaired)
        if count:
            who = f"actuators of {candidate.label} without a partner ({count})"
            notes.append(f"{who}, each held likewise")
    return *acting_models[0], *acting_models[1], tuple(notes)


def _without_actuators(
    execute: Execute,
    models: tuple[Candidate, Candidate],
    both_facts: tuple[Facts, Facts],
    held: bool,
) -> tuple[Candidate, Facts, Candidate, Facts, tuple[str, ...]]:
    """Switch actuators off in both models."""
    why = "since joints are held" if held else "since the other file's format has none"
    models_off: list[tuple[Candidate, Facts]] = []
    notes = []
    for candidate, model_facts in zip(models, both_facts, strict=True):
        if model_facts.actuators:
            count = len(model_facts.actuators)
            notes.append(f"{NOT_COMPARED}: actuators ({count}) of {candidate.label}, {why}")
            off = candidate.with_settings(actuators=False)
            models_off.append((off, ask(execute, off, facts, off)))
        else:
            models_off.append((candidate, model_facts))
    return *models_off[0], *models_off[1], tuple(notes)


def _is_stated(candidate: Candidate, model_facts: Facts) -> bool:
    """Return whether a sidecar states a file's actuators."""
    stated = candidate.sidecar.spec(candidate.engine).settings
    switched = {"controls", "actuators"} & set(stated) or not stated.get("smooth", False)
    return bool(model_facts.actuators) and bool(switched)


def _joints(joint_pairs: JointPairs, joints: Maps) -> dict[str, str]:
    """Return joints of A with their partners in B, by pairing and by the user's map.

    A free joint represents its coordinates.
    """
    pairs = {**joint_pairs.pairs, **{name: text.lstrip("-") for name, text in joints[0].items()}}
    whole = {name.partition(":")[0]: its.partition(":")[0] for name, its in pairs.items()}
    return {**whole, **pairs}


def _matched(
    facts_a: Facts,
    facts_b: Facts,
    joints: Maps,
    readback: Maps,
    joint_pairs: JointPairs,
    still: Sequence[Mapping[str, float]],
) -> Match:
    try:
        return match(facts_a.coordinates, facts_b.coordinates, joints, readback, joint_pairs)
    except CompareError as error:
        if any(joint_pairs.unpaired) and not any(still):
            message = f"{error}; none was found by name, order or geometry, and none can be held"
            raise CompareError(message) from None
        raise


def _drawn(facts_a: Facts, facts_b: Facts) -> tuple[PlacedTree, PlacedTree] | None:
    """Return both files' joints as drawn; None if one is not a tree of hinges and slides."""
    sides = []
    for model_facts in (facts_a, facts_b):
        tree = tree_of(model_facts.robot, model_facts.coordinates)
        if tree is None or set(names_of(tree)) != set(model_facts.coordinates):
            return None
        sides.append(placed(tree, positions(tree, model_facts.coordinates, model_facts.home)))
    return sides[0], sides[1]


def _held(candidate: Candidate, model_facts: Facts, unpaired: Sequence[str]) -> dict[str, float]:
    """Return positions of unpaired joints to lock; {} for models whose sidecar declares couplings.

    There a joint may follow others.
    """
    if not candidate.bare or "held" not in engines()[candidate.engine].switches:
        return {}
    tree = tree_of(model_facts.robot, model_facts.coordinates)
    single = {} if tree is None else {link.name: link.kind for link in tree.links}
    return {
        name: float(model_facts.home[model_facts.coordinates.index(name)])
        for name in unpaired
        if single.get(name) in ("hinge", "slide")
    }


def _uncompared(a: Candidate, b: Candidate, facts_a: Facts, facts_b: Facts) -> Iterator[str]:
    """Yield omissions of files of two formats; position limits are read from both."""
    if a.sidecar.model.suffix == b.sidecar.model.suffix:
        return
    for candidate, model_facts in ((a, facts_a), (b, facts_b)):
        parts = [_counted(part) for part in _parts(candidate, model_facts) if part.what != LIMITS]
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
    a: Candidate, b: Candidate, facts_a: Facts, facts_b: Facts, include_constraints: bool
) -> tuple[str, ...]:
    """Return notes about contacts and other omissions."""
    if include_constraints:
        return ("contacts, joint limits, dry friction and couplings of the files are included",)
    texts = [_format_omissions(*pair) for pair in ((a, facts_a), (b, facts_b))]
    if a.sidecar.model.resolve() == b.sidecar.model.resolve() or texts[0] == texts[1]:
        return (f"{NOT_COMPARED}: {texts[0]}",) if texts[0] else ()
    return tuple(
        f"{NOT_COMPARED}: {text}, in {candidate.label}"
        for candidate, text in zip((a, b), texts, strict=True)
        if text
    )


def _format_omissions(candidate: Candidate, model_facts: Facts) -> str:
    """Format omissions, such as: contact geometry (12), dry friction (7)."""
    return ", ".join(map(_counted, _parts(candidate, model_facts)))


def _parts(candidate: Candidate, model_facts: Facts) -> list[Omission]:
    """Return what a model's motions leave out."""
    settings = candidate.sidecar.spec(candidate.engine).settings
    if model_facts.robot is None or not settings.get("smooth", False):
        return []
    kept = COUPLED if settings.get("couplings", True) else ()
    return [one for one in model_facts.robot.left_out if not one.what.startswith((*ALWAYS, *kept))]


def _counted(omission: Omission) -> str:
    return omission.what if omission.count == 1 else f"{omission.what} ({omission.count})"
