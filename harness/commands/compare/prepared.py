"""Preparation of both models: load them, pair their joints, and lock joints without a partner."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from physics_crosscheck.harness.checks.findings import format_omission
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot import CLOSING, Omission
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.reference.mechanism.tree import WORLD
from physics_crosscheck.reference.solving.collocation import ReferenceError
from physics_crosscheck.reference.solving.samples import locked_joints
from .actuators import held_alike, pair_actuators
from .candidate import COUPLED, Candidate, CompareError, Facts, ask, facts, smooth
from .match import Match, Pairs, match, pair_joints, spoken_for
from .side import FileEquations, ModelSide, lines_of, make_property, model_side, shown

T = TypeVar("T")

Pair = tuple[Facts, Facts]
"""Both models, A first."""

Maps = tuple[Mapping[str, str], Mapping[str, str]]


@dataclass(frozen=True, kw_only=True)
class PreparedComparison:
    """Input of a comparison.

    Attributes:
        facts: of both, as they run.
        match: of their coordinates.
        notes: actions, a sentence each.
        omissions: of both files, that the runs leave out.
        uncompared: omissions that may differ, since no literals of one format show them.
        locked: different dampings of joints that damping locks, so that no run shows them.
    """

    facts: Pair
    match: Match
    notes: tuple[str, ...]
    omissions: tuple[tuple[Omission, ...], tuple[Omission, ...]]
    uncompared: tuple[str, ...]
    locked: tuple[ComparedProperty, ...] = ()

    @property
    def models(self) -> tuple[Candidate, Candidate]:
        """A and B."""
        return self.facts[0].candidate, self.facts[1].candidate

    def source_first(self, both: tuple[T, T]) -> tuple[T, T]:
        """Return values of A and B as those of source and target, and the other way round."""
        return both if self.match.source == "A" else both[::-1]


def prepare(
    executor: Executor, a: Candidate, b: Candidate, joints: Maps, include_constraints: bool
) -> PreparedComparison:
    """Load two models and pair their joints.

    Raises:
        CompareError: for unpaired joints that cannot be locked, with the remedy.
        FailureError: if an engine fails.
    """
    if not include_constraints:
        a, b = smooth(a, b)
    models, floated = _loaded(executor, (a, b))
    readback = a.sidecar.readback, b.sidecar.readback
    names = models[0].coordinates, models[1].coordinates
    given = spoken_for(*names, joints, readback)
    drawn = [model_side(one, one.home) for one in models]
    joint_pairs = pair_joints(
        *names, given, (drawn[0].placed, drawn[1].placed) if drawn[0] and drawn[1] else None
    )
    notes, omissions = list(floated), (_parts(models[0]), _parts(models[1]))
    if include_constraints:
        every = "contacts, joint limits, dry friction and couplings of the files are included"
        notes, omissions = [every, *notes], ((), ())
    unlike = [] if include_constraints else list(_uncompared(models))
    still: list[Mapping[str, float]] = [{}, {}]
    if joint_pairs.pairs:
        still = [_held(*one) for one in zip(models, joint_pairs.unpaired, strict=True)]
    for label, other, held in zip("AB", "BA", still, strict=True):
        notes += [
            f"joint {name} of {label} has no partner in {other}: held at {at:g}"
            for name, at in held.items()
        ]
    pairs, locked = _joints(joint_pairs, joints), tuple(map(_locked, models))
    differences = (*_lock_differences(drawn, pairs, locked), *_loop_differences(models))
    notes += _lock(models, pairs, locked, still)
    moving = {a: b for a, b in joint_pairs.pairs.items() if a not in still[0]}
    joint_pairs = replace(joint_pairs, pairs=moving)
    models = _with(executor, models, [{"held": list(held)} if held else {} for held in still])
    if not include_constraints:
        models, more = _actuated(
            executor, models, pairs, held=any(map(_lose_actuators, models, still))
        )
        notes += more
        unlike += [note for note in more if note.startswith(NOT_COMPARED)]
    return PreparedComparison(
        facts=models,
        match=_matched(models, joints, readback, joint_pairs, still),
        notes=tuple(notes),
        omissions=omissions,
        uncompared=tuple(unlike),
        locked=differences,
    )


def _locked(model: Facts) -> dict[str, float]:
    """Return joints that their damping locks, with the damping; {} for a file with a sidecar."""
    tree = model.whole_tree
    if tree is None or not model.candidate.bare or not any(link.damping for link in tree.links):
        return {}
    file = FileEquations(tree, model.coordinates)
    try:
        return locked_joints(file.equations, model.home[None, file.kept])
    except ReferenceError:
        return {}


def _lock_differences(
    sides: Sequence[ModelSide | None],
    pairs: Mapping[str, str],
    locked: tuple[Mapping[str, float], ...],
) -> Iterator[ComparedProperty]:
    if sides[0] is None or sides[1] is None:
        return
    for names in ((a, b) for a, b in pairs.items() if a in locked[0] or b in locked[1]):
        a, b = (
            next((link.damping for link in side.tree.links if link.name == name), 0.0)
            for side, name in zip((sides[0], sides[1]), names, strict=True)
        )
        if a != b:
            yield make_property(
                "damping", names[0], f"damping of joint {names[0]}: {shown(a, b)}", a=a, b=b,
                lines=lines_of(sides[0], sides[1], "damping", names), moves=False,
                relative=abs(a - b) / max(a, b),
            )[0]  # fmt: skip


def _loop_differences(models: Pair) -> Iterator[ComparedProperty]:
    closing = [
        {name for one in m.robot.left_out if one.what == CLOSING for name in one.where}
        if m.robot
        else set()
        for m in models
    ]
    for label, here, there in zip("AB", closing, closing[::-1], strict=True):
        for name in sorted(here - there):
            message = f"joint {name} closes a loop in {label} alone"
            yield make_property("kind", name, message, moves=False)[0]


def _lock(
    models: Pair,
    pairs: Mapping[str, str],
    locked: tuple[Mapping[str, float], ...],
    still: list[Mapping[str, float]],
) -> list[str]:
    """Hold joints that damping locks, with their partners, and return a note on each.

    Raises:
        CompareError: if no other joint moves.
    """
    notes = [
        f"joint {name} of {label} is locked by its damping, {damping:g}: held"
        for label, joints in zip("AB", locked, strict=True)
        for name, damping in joints.items()
    ]
    for i, others in enumerate(({b: a for a, b in pairs.items()}, pairs)):
        shared = [others[name] for name in locked[1 - i] if name in others]
        still[i] = {**still[i], **_held(models[i], [*locked[i], *shared])}
        if notes and set(still[i]) >= set(models[i].coordinates):
            raise CompareError(
                f"{models[i].candidate.name}: no joint moves: {'; '.join(notes)}; lower the "
                "damping in the file"
            )
    return notes


def _with(executor: Executor, models: Pair, settings: Sequence[Mapping[str, object]]) -> Pair:
    a, b = (
        _load(executor, model.candidate.with_settings(**more)) if more else model
        for model, more in zip(models, settings, strict=True)
    )
    return a, b


def _load(executor: Executor, candidate: Candidate) -> Facts:
    return ask(executor, candidate, facts, candidate)


def _loaded(executor: Executor, models: tuple[Candidate, Candidate]) -> tuple[Pair, list[str]]:
    """Load both models; the root of an unspecified URDF moves or is held as the other model's.

    Of two such URDFs, both move freely if one stands or flies, or has no joint.
    """
    loaded: dict[str, Facts] = {}
    notes = []
    unspecified = [one for one in models if _may_float(one)]
    by_itself = {one.label: read_robot(one.sidecar.model).floats for one in unspecified}
    for candidate in sorted(models, key=_may_float):
        if _may_float(candidate):
            free = any(map(_floats, loaded.values()) if len(by_itself) == 1 else by_itself.values())
            candidate = candidate.with_settings(floating=free)
            if free != by_itself[candidate.label]:
                verb, other = "moves freely" if free else "is held", "AB".strip(candidate.label)
                notes.append(f"the root link of {candidate.label} {verb}, as that of {other}")
        loaded[candidate.label] = _load(executor, candidate)
    return (loaded["A"], loaded["B"]), notes


def _may_float(candidate: Candidate) -> bool:
    """Return whether a URDF's root may float, since neither sidecar nor settings state it."""
    is_open = candidate.bare and candidate.floating is None
    return is_open and candidate.sidecar.model.suffix == ".urdf"


def _floats(model_facts: Facts) -> bool:
    robot = model_facts.robot
    links = () if robot is None or robot.tree is None else robot.tree.links
    kinds = [link.kind for link in links if link.parent == WORLD]
    return bool(kinds) and set(kinds) == {"free"}


def _actuated(
    executor: Executor, models: Pair, joints: Mapping[str, str], *, held: bool
) -> tuple[Pair, list[str]]:
    """Hold actuators at equal controls in both models, or switch them off.

    They are switched off if joints are locked, which removes the actuators on them, or if the
    other format has none. Settings of a sidecar are kept.
    """
    a, b = models
    if any(map(_is_stated, models)) or not (a.actuators or b.actuators):
        return models, []
    if held or a.compiled is None or b.compiled is None:
        why = "since joints are held" if held else "since the other file's format has none"
        notes = [
            f"{NOT_COMPARED}: actuators ({len(one.actuators)}) of {one.candidate.label}, {why}"
            for one in models
            if one.actuators
        ]
        off = [{"actuators": False} if one.actuators else {} for one in models]
        return _with(executor, models, off), notes
    pairs = pair_actuators(a.actuators, b.actuators, joints)
    # States that move in one engine only would differ without a difference of the files.
    move = all("activations" in engines()[one.candidate.engine].switches for one in models)
    settings: list[dict[str, object]] = []
    for controls, states in held_alike(a.compiled, b.compiled, pairs):
        activations = {"activations": states} if states and move else {}
        settings.append({"controls": controls, **activations})
    notes = list(pairs.notes)
    if pairs.pairs:
        notes.append(f"actuators ({len(pairs.pairs)}), each held at a control within its range")
    for model, unpaired in zip(models, pairs.unpaired, strict=True):
        if count := sum(model.actuators[i].covered for i in unpaired):
            who = f"actuators of {model.candidate.label} without a partner ({count})"
            notes.append(f"{who}, each held likewise")
    return _with(executor, models, settings), notes


def _lose_actuators(model: Facts, held: Mapping[str, float]) -> bool:
    """Return whether holding joints removes actuators, or may change what they act on."""
    return bool(held) and any(
        one.on in held or not one.kind[0].startswith("transmission joint")
        for one in model.actuators
    )


def _is_stated(model: Facts) -> bool:
    stated = model.candidate.settings
    switched = {"controls", "actuators"} & set(stated) or not stated.get("smooth", False)
    return bool(model.actuators) and bool(switched)


def _joints(joint_pairs: Pairs[str], joints: Maps) -> dict[str, str]:
    """Return joints of A with their partners in B, by pairing and by the user's map.

    A free joint represents its coordinates.
    """
    pairs = {**joint_pairs.pairs, **{name: text.lstrip("-") for name, text in joints[0].items()}}
    whole = {name.partition(":")[0]: its.partition(":")[0] for name, its in pairs.items()}
    return {**whole, **pairs}


def _matched(
    models: Pair,
    joints: Maps,
    readback: Maps,
    joint_pairs: Pairs[str],
    still: Sequence[Mapping[str, float]],
) -> Match:
    a, b = models
    try:
        return match(a.coordinates, b.coordinates, joints, readback, joint_pairs)
    except CompareError as error:
        if any(joint_pairs.unpaired) and not any(still):
            message = f"{error}; none was found by name, order or geometry, and none can be held"
            raise CompareError(message) from None
        raise


def _held(model: Facts, names: Sequence[str]) -> dict[str, float]:
    """Return positions of joints to lock; {} for models whose sidecar declares couplings.

    There a joint may follow others.
    """
    candidate = model.candidate
    if not candidate.bare or "held" not in engines()[candidate.engine].switches:
        return {}
    single = {} if model.tree is None else {link.name: link.kind for link in model.tree.links}
    return {
        name: float(model.home[model.coordinates.index(name)])
        for name in names
        if single.get(name) in ("hinge", "slide")
    }


def _uncompared(models: Pair) -> Iterator[str]:
    if len({one.candidate.sidecar.model.suffix for one in models}) == 1:
        return
    for model in models:
        parts = [format_omission(part) for part in _parts(model) if part.what != LIMITS]
        if parts:
            yield f"{NOT_COMPARED}: {', '.join(parts)}, in {model.candidate.label}"


LIMITS = "limits of position"

NOT_COMPARED = "not compared"
"""Start of a note about omissions."""

ALWAYS = ("how ", "limits of effort", "limits of velocity")
"""Start of omissions that are made with all options."""


BY_LAW = (LIMITS, "dry friction", "saturation")
"""Start of omissions that laws compare."""


def omission_notes(prepared: PreparedComparison, *, by_law: bool) -> tuple[str, ...]:
    """Return notes about what neither the runs nor the laws compare."""
    compared = BY_LAW if by_law else ()
    # Such as: contact geometry (12), dry friction (7).
    texts = [
        ", ".join(format_omission(part) for part in parts if not part.what.startswith(compared))
        for parts in prepared.omissions
    ]
    files = {one.sidecar.model.resolve() for one in prepared.models}
    if len(files) == 1 or texts[0] == texts[1]:
        return (f"{NOT_COMPARED}: {texts[0]}",) if texts[0] else ()
    return tuple(
        f"{NOT_COMPARED}: {text}, in {label}"
        for label, text in zip("AB", texts, strict=True)
        if text
    )


def _parts(model: Facts) -> tuple[Omission, ...]:
    """Return what a model's motions leave out."""
    settings = model.candidate.settings
    if model.robot is None or not settings.get("smooth", False):
        return ()
    kept = COUPLED if settings.get("couplings", True) else ()
    return tuple(one for one in model.robot.left_out if not one.what.startswith((*ALWAYS, *kept)))
