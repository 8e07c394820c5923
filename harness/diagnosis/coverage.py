"""Count of the numbers in a model's files, by the check that tests them."""

import re
import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import numpy as np
from msgspec.structs import replace as replace_fields

from physics_crosscheck.harness.checks.task import SystemTask, TreeTask
from physics_crosscheck.harness.checks.whole_step import compares_steps
from physics_crosscheck.harness.documents.elements import Number, XmlElement, replace_numbers
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.engines.protocol import EngineError, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import locate, with_texts
from physics_crosscheck.harness.modelfiles.frames import SidecarFrames, sidecar_frames
from physics_crosscheck.harness.modelfiles.locations import literals
from physics_crosscheck.harness.modelfiles.mjcf.read import parts_of
from physics_crosscheck.harness.modelfiles.numbers import NUDGE as SLOPE_NUDGE
from physics_crosscheck.harness.modelfiles.numbers import ModelFile
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs, robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.records.coverage import Coverage, Untested
from physics_crosscheck.reference.dynamics.recursion import bodies_apart
from physics_crosscheck.reference.dynamics.tree_equations import TreeFrames
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.mechanism.tree import WORLD
from .fit import NumberProblem
from .law_problem import LawProblem, law_problem
from .robot_task import problem_of

POSE_STATES = 8
"""States at which poses of frames are evaluated; extremes of the motions are among the first."""


NUDGE = 1e-3
"""Relative change of a number, or absolute change of zero."""

PATIENCE = 2.0
"""Processor seconds after which the remaining numbers are not tried."""

_GOLDEN = 0.6180339887498949
"""Spreads the sizes of changes, so that two of them do not cancel."""


class NumberEffect(Enum):
    """Effect of a number."""

    MOTION = "motion"
    FRAMES = "frames"
    SHAPES = "shapes and sites"
    PARTLY = "shared by elements of which some never act"
    FAINT = "effect below the resolution"
    NONE = "no effect on motion"
    FIXED = "links that do not move"
    REFUSED = "not counted: no other value can be tried"
    CHOICE = "switches and counts"
    UNTRIED = "not counted: out of time"


class Trials:
    """Copies of a model with changed numbers, each evaluated at the states of its motions.

    Args:
        task: the unmodified model.
        numbers: of its files.
        folder: for the copies.

    Attributes:
        effects: effect of each tried number, by its index.

    Raises:
        EngineError, SidecarError: with file, place and remedy.
    """

    def __init__(self, task: SystemTask, numbers: Sequence[Number], folder: Path) -> None:
        self.effects: dict[int, NumberEffect] = {}
        self._task, self._sidecar = task, task.declared
        self._numbers, self._folder = numbers, folder
        parts = (one.file for one in numbers)
        files = dict.fromkeys((self._sidecar.model, Path(f"{self._sidecar.model}.toml"), *parts))
        self._texts = {file: read_regular(file) for file in files}
        model, coordinates = task.load()
        self._z, self._w = coordinates.to_engine(_some(task.target.visited))
        self._frames = _frames(task.target.system, self._sidecar)
        self._step = model.step  # a number of the file may be the step
        # Evaluate poses before some engines unload this model.
        self._base = self._rates(model), self._poses(model)
        self._end = time.process_time() + PATIENCE

    def _rates(self, model: LoadedModel) -> tuple[Array, Array]:
        """Return rates of change of positions and velocities over a step, (S, nz) each."""
        q, v = model.rollout(self._z, self._w, self._step, 1, None, 1)
        return (q[:, 0] - self._z) / self._step, (v[:, 0] - self._w) / self._step

    def _poses(self, model: LoadedModel) -> tuple[Array, Array]:
        """Return origins of the frames and their rotations at some states."""
        there = frozenset(model.places) if self._frames.targets else frozenset()
        places = [target.place for target in self._frames.targets if target.place in there]
        if not places:
            return np.zeros(0), np.zeros(0)
        return model.poses(places, self._z[:POSE_STATES])

    def _alike(self, pair: tuple[Array, Array], base: tuple[Array, Array]) -> bool:
        """Return whether values agree, within a share of the largest one."""
        for values, reference in zip(pair, base, strict=True):
            size = float(np.max(np.abs(reference), initial=0.0))
            if values.shape != reference.shape:
                return False
            if not np.all(np.abs(values - reference) <= self._task.resolution * size):
                return False
        return True

    def nudge(self, groups: Iterable[Sequence[int]]) -> None:
        """Nudge each group's numbers in one copy, and if that has an effect, in smaller groups.

        Change numbers that the engine rejects to the next whole number.
        """
        for group in groups:
            self._halve(group, lambda i: _moved(self._numbers[i], i))

    def flip(self, group: Iterable[int]) -> None:
        """Change the signs of numbers whose nudge had no effect."""
        quiet = [i for i in group if self.effects.get(i) is NumberEffect.NONE]
        self._halve(quiet, lambda i: (repr(-self._numbers[i].value),))

    def _halve(
        self, group: Sequence[int], words: Callable[[int], Sequence[str]], acts: bool = False
    ) -> None:
        """Try numbers together, and by halves if they have an effect; `acts` if they have one."""
        if not group or time.process_time() > self._end:
            return
        if acts and len(group) > 1:
            effect = NumberEffect.MOTION
        else:
            effect = self._tried({i: words(i)[0] for i in group})
        if effect is NumberEffect.NONE:
            self.effects.update(dict.fromkeys(group, NumberEffect.NONE))
        elif len(group) > 1:
            size = 1 if len(group) <= SMALL_GROUP else (len(group) + 1) // 2
            for first in range(0, len(group), size):
                before, part = group[:first], group[first : first + size]
                rest = first + size >= len(group)
                still = rest and all(self.effects.get(i) is NumberEffect.NONE for i in before)
                self._halve(part, words, acts=still)
        else:
            for other in words(group[0])[1:]:
                if effect is not NumberEffect.REFUSED:
                    break
                effect = self._tried({group[0]: other})
            self.effects[group[0]] = effect

    def _tried(self, words: Mapping[int, str]) -> NumberEffect:
        """Return the effect of some numbers with new text."""
        places = ((self._numbers[i], word) for i, word in words.items())
        texts = replace_numbers(self._texts, places)
        try:
            copy = with_texts(self._sidecar, texts, self._folder)
            model = engines()[self._task.engine].load(copy.spec(self._task.engine))
        except (EngineError, SidecarError):
            return NumberEffect.REFUSED
        if len(model.coordinates) != self._z.shape[1]:
            return NumberEffect.REFUSED
        rates, poses = self._base
        if not self._alike(self._rates(model), rates):
            return NumberEffect.MOTION
        same = self._alike(self._poses(model), poses)
        return NumberEffect.NONE if same else NumberEffect.FRAMES


def _moved(literal: Number, i: int) -> tuple[str, ...]:
    """Return new texts for a number, in the order of trials."""
    value = literal.value
    step = NUDGE * (1 + (i * _GOLDEN) % 1)
    up, down = (value * (1 + step), value * (1 - step)) if value else (step, -step)
    whole: tuple[str, ...] = () if value else ("1e-15",)
    if literal.text.lstrip("+-").isdigit():
        whole = (*whole, str(int(value) + 1), str(int(value) - 1))
    return (repr(up), repr(down), *whole)


STATES = 24
"""States at which a model is evaluated, in addition to each component's extremes."""

SMALL_GROUP = 6
"""Largest group whose numbers are tried one by one if they have an effect together. Numbers of
elements of one kind mostly all have one, or none."""

MAX_EXAMPLES = 3
"""Maximum number of examples of a reason."""

_MODEL = re.compile(r"(settings|spring)\b.*")
"""Entries of a sidecar that belong to the model."""

_DIRECTION = re.compile(r".*axis\w*(@.*)?")
"""Numbers that define a direction, without regard to length."""

_STEP = {r"settings(\.\w+)?\.step": "time step"}

_NAMED = tuple(
    say.value for say in NumberEffect if say.name in ("NONE", "PARTLY", "FAINT", "FIXED", "REFUSED")
)
"""Reasons for which each number with an address is listed."""


def count_numbers(task: SystemTask) -> Coverage:
    """Change each number of a model's files, and count those with an effect.

    Raises:
        EngineError, SidecarError, LocationError: with file, place and remedy.
    """
    engine = engines()[task.engine]
    numbers, bound = _numbers(task.declared, task.engine), _bound(task.declared)
    purposes = {**_STEP, **engine.non_physical}
    reasons = [reason_of(one.path, purposes) for one in numbers]
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        trials = Trials(task, numbers, Path(folder))
        chosen = [bool(engine.choices and re.fullmatch(engine.choices, p.path)) for p in numbers]
        tried = [i for i, choice in enumerate(chosen) if not choice]
        trials.nudge([[i for i in tried if reasons[i]]])
        others = [i for i in tried if not reasons[i]]
        # Most bound numbers have an effect, so that groups of them save no time.
        trials.nudge([i] for i in others if _place(numbers[i]) in bound)
        alike: dict[tuple[str, str], list[int]] = {}
        for i in others:
            if _place(numbers[i]) not in bound:
                file, _ = _place(numbers[i])
                alike.setdefault((file, numbers[i].path.partition("@")[0]), []).append(i)
        trials.nudge(alike.values())
        trials.flip([i for i, one in enumerate(numbers) if _DIRECTION.fullmatch(one.path)])
    effects = {**dict.fromkeys(range(len(numbers)), NumberEffect.UNTRIED), **trials.effects}
    effects |= {i: NumberEffect.CHOICE for i, choice in enumerate(chosen) if choice}
    return summarized(
        [
            CountedNumber(
                path=one.path,
                address="",
                line=f"{one.file.name}{one.place}",
                effect=effects[i],
                bound=_place(one) in bound,
            )
            for i, one in enumerate(numbers)
        ],
        purposes,
    )


def _some(states: Array) -> Array:
    """Return some states of the motions, including the extremes of each component."""
    extremes = np.concatenate([states.argmax(axis=0), states.argmin(axis=0)])
    spread = np.linspace(0, len(states) - 1, STATES).astype(int)
    return states[list(dict.fromkeys([*extremes, *spread]))]


def _frames(system: System, sidecar: Sidecar) -> SidecarFrames:
    try:
        return sidecar_frames(system, sidecar)
    except SidecarError:  # the audit reports it
        return SidecarFrames(targets=(), axes=np.eye(3), origin=np.zeros(3))


def _numbers(sidecar: Sidecar, engine: str) -> tuple[Number, ...]:
    """Return numbers of the model file and its includes, and of the sidecar for this engine.

    Of the sidecar, return only settings and springs.
    """
    others = tuple(f"settings.{name}." for name in sidecar.engine_settings if name != engine)
    sidecar_numbers = (
        one
        for one in literals(Path(f"{sidecar.model}.toml"))
        if _MODEL.fullmatch(one.path) and not one.path.startswith(others)
    )
    folder = sidecar.model.parent
    parts = [one for one in parts_of(sidecar.model) if one.is_relative_to(folder)]
    return (*(one for file in parts for one in literals(file)), *sidecar_numbers)


def _bound(sidecar: Sidecar) -> frozenset[tuple[str, int]]:
    """Return file and first byte of each bound number."""
    try:
        places = locate(sidecar, sidecar.bindings)
    except (LocationError, SidecarError):  # the audit reports it
        return frozenset()
    return frozenset((str(place.file), place.start) for place in places.values())


def _place(literal: Number) -> tuple[str, int]:
    return str(literal.file), literal.start


@dataclass(frozen=True, kw_only=True)
class CountedNumber:
    """A number of a file, and its effect.

    Attributes:
        path: tags of its ancestors and its attribute.
        address: its address; empty if it has none.
        line: its place, such as `rod.xml:12`.
        effect: its effect.
        bound: whether it is compared with a formula.
        read: whether its compiled value is compared with the text.
        smooth: whether smooth motions or frames of links depend on it, without whole steps.
    """

    path: str
    address: str
    line: str
    effect: NumberEffect
    bound: bool = False
    read: bool = False
    smooth: bool = False


def reason_of(path: str, purposes: Mapping[str, str]) -> str:
    """Return the purpose of numbers that need not affect motions, or "" if unknown."""
    return next((why for kind, why in purposes.items() if re.fullmatch(kind, path)), "")


def summarized(numbers: Sequence[CountedNumber], purposes: Mapping[str, str]) -> Coverage:
    """Count each number once, by the check that tests it, or by the reason that none does."""
    counts = {"motion": 0, "audit": 0, "frames": 0, "read": 0}
    untested: dict[str, list[CountedNumber]] = {}
    for number in numbers:
        if number.effect is NumberEffect.MOTION:
            counts["motion"] += 1
        elif number.effect in (NumberEffect.FRAMES, NumberEffect.SHAPES):
            counts["frames"] += 1
        elif number.bound:
            counts["audit"] += 1
        elif number.read:
            counts["read"] += 1
        else:
            why = (
                reason_of(number.path, purposes)
                if number.effect in (NumberEffect.NONE, NumberEffect.CHOICE)
                else ""
            )
            untested.setdefault(why or number.effect.value, []).append(number)
    return Coverage(
        numbers=len(numbers),
        motion=counts["motion"],
        audit=counts["audit"],
        frames=counts["frames"],
        read=counts["read"],
        untested=tuple(
            Untested(reason=why, count=len(them), examples=_examples(why, them))
            for why, them in sorted(untested.items(), key=lambda item: -len(item[1]))
        ),
    )


def _examples(why: str, numbers: Sequence[CountedNumber]) -> tuple[str, ...]:
    """Return examples of untested numbers: element and attribute, a name, or a line.

    Return all addresses if the reason is not the purpose of such numbers.
    """
    if numbers[0].address and why in _NAMED:
        return tuple(one.address for one in numbers)
    names = (one.path.rpartition("/")[2] or one.line for one in numbers)
    return tuple(dict.fromkeys(names))[:MAX_EXAMPLES]


_INERTIAL = re.compile(r".*/(link|body)/inertial[/@].*")


def count_robot(task: TreeTask) -> Coverage:
    """Count the numbers of a file whose change moves the ends of segments beyond the resolution.

    Only the equations are used, at the states of a diagnosis; no engine runs.

    Raises:
        RobotError, ReferenceError: with the file.
    """
    numbers = robot_numbers(task.file, task.spec.settings)
    if numbers.unread:
        return Coverage(note="; ".join(numbers.unread))
    counted = counted_numbers(task, numbers)
    coverage = summarized(counted, engines()[task.engine].non_physical)
    return replace_fields(coverage, engine=task.engine)


def counted_numbers(task: TreeTask, numbers: ModelFile) -> list[CountedNumber]:
    """Return each number of a file with its effect; errors as in `count_robot`."""
    problem = problem_of(task, numbers, is_reference=True)
    says = {i: _effect(problem, k, task.resolution) for k, i in enumerate(numbers.relevant_numbers)}
    says |= _in_frames(task, numbers, _small_changes(numbers, says))
    says |= _in_frames(task, numbers, _reversed_axes(numbers, says))
    smooth = {i for i, effect in says.items() if effect in SMOOTH}
    whole = compares_steps(task)
    if whole:
        steps = _in_steps(task, numbers, says)
        says |= {i: step for i, step in steps.items() if i not in smooth or step in SMOOTH}
    if task.sidecar is None:
        says |= _in_shapes(task, numbers, says)
    read = numbers.read_numbers if whole else frozenset[int]()
    choices, fixed = engines()[task.engine].choices, _fixed(task)
    return [
        CountedNumber(
            path=one.path,
            address=one.address,
            line=f"{one.file.name}{one.place}",
            effect=_otherwise(one, says.get(i, NumberEffect.NONE), choices, fixed),
            read=i in read,
            smooth=i in smooth,
        )
        for i, one in enumerate(numbers.numerals)
    ]


def _in_steps(
    task: TreeTask, numbers: ModelFile, says: Mapping[int, NumberEffect]
) -> dict[int, NumberEffect]:
    """Return the effects on whole steps of the numbers that no smooth motion depends on."""
    problem = law_problem(task, numbers)
    if problem is None:
        return {}
    moved = {i for i, effect in says.items() if effect is NumberEffect.MOTION}
    parts = replace(problem, with_mistakes=False).parts(FEW_STATES)
    return {
        i: _largest_effect(parts, k, task.resolution)
        for k, i in enumerate(problem.numbers.law_numbers)
        if i not in moved
    }


FEW_STATES = 4
"""States that are tried together: most numbers act at one of the first."""


def _largest_effect(parts: Sequence[LawProblem], index: int, resolution: float) -> NumberEffect:
    effects = set[NumberEffect]()
    for part in parts:
        effects.add(_effect(part, index, resolution))
        if NumberEffect.MOTION in effects:
            return _at_each_element(parts, index, resolution)
    others = NumberEffect.REFUSED, NumberEffect.FAINT
    return next((effect for effect in others if effect in effects), NumberEffect.NONE)


def _at_each_element(parts: Sequence[LawProblem], index: int, resolution: float) -> NumberEffect:
    """Return the effect of a number that acts: it counts if it does at all elements with it."""
    size = NUDGE * parts[0].hypotheses[index].size
    waiting: list[int] | None = None
    for part in parts:
        effects = part.element_effects(index, waiting)
        waiting = [k for k, one in effects.items() if np.max(np.abs(one)) * size <= resolution]
        if not waiting:
            return NumberEffect.MOTION
    return NumberEffect.PARTLY


def _effect(problem: NumberProblem, index: int, resolution: float) -> NumberEffect:
    """Return the effect of a number; a change that cannot be solved is not counted as no effect."""
    effect = problem.effect(index)
    if effect is None or not np.isfinite(effect).all():
        return NumberEffect.REFUSED
    moved = float(np.max(np.abs(effect), initial=0.0)) * NUDGE * problem.hypotheses[index].size
    if moved > resolution:
        return NumberEffect.MOTION
    return NumberEffect.FAINT if moved else NumberEffect.NONE


SMOOTH = (NumberEffect.MOTION, NumberEffect.FRAMES)
"""Effects of numbers that the smooth check tests."""

_UNMOVED = (NumberEffect.NONE, NumberEffect.FAINT)


def _small_changes(numbers: ModelFile, says: Mapping[int, NumberEffect]) -> Mapping[int, float]:
    """Return a small change of each number that moves nothing in time."""
    unmoved = [i for i, effect in says.items() if effect in _UNMOVED]
    return {i: SLOPE_NUDGE * numbers.numerals[i].scale for i in unmoved}


def _reversed_axes(numbers: ModelFile, says: Mapping[int, NumberEffect]) -> Mapping[int, float]:
    """Return a change of sign of each number of an axis whose length has no effect."""
    return {
        i: -2 * one.value
        for i, one in enumerate(numbers.numerals)
        if one.value and says.get(i, NumberEffect.NONE) in _UNMOVED and _DIRECTION.match(one.path)
    }


def _in_frames(
    task: TreeTask, numbers: ModelFile, changes: Mapping[int, float]
) -> dict[int, NumberEffect]:
    """Return those of the changed numbers that move nothing in time, but where a body is."""
    target, here = task.target, numbers.tree({})
    if here is None or here.dof != len(target.names):
        return {}
    every = tuple(here.frames)
    names = tuple(name for name in every if name in target.tree.frames)
    q = target.samples.start[:, : len(target.names)]
    before = TreeFrames(here, names)(q)
    least = task.resolution * max(1.0, float(np.max(np.abs(before), initial=0.0)))
    effects = {}
    for i, change in changes.items():
        number = numbers.numerals[i]
        tree = numbers.tree({i: number.value + change})
        if tree is None or tree.dof != len(target.names) or tuple(tree.frames) != every:
            continue
        if tree.frames is here.frames and bodies_apart(tree, here) is not None:
            continue  # only masses and inertias differ
        moved = float(np.max(np.abs(TreeFrames(tree, names)(q) - before), initial=0.0))
        if moved * NUDGE * number.scale / abs(change) > least:
            effects[i] = NumberEffect.FRAMES
    return effects


def _in_shapes(
    task: TreeTask, numbers: ModelFile, says: Mapping[int, NumberEffect]
) -> dict[int, NumberEffect]:
    """Return those of the other numbers that shapes and sites depend on, if the engine shows it."""
    engine = engines()[task.engine]
    if task.file.suffix not in engine.places:
        return {}
    count = range(len(numbers.numerals))
    others = {i for i in count if says.get(i, NumberEffect.NONE) in _UNMOVED}
    return dict.fromkeys(numbers.placing(others), NumberEffect.SHAPES)


def _otherwise(
    number: Number, effect: NumberEffect, choices: str, fixed: Collection[str]
) -> NumberEffect:
    """Return a reason for no effect from the number's place in the file, or its effect."""
    if effect is NumberEffect.NONE and choices and re.fullmatch(choices, number.path):
        return NumberEffect.CHOICE
    if (
        effect is NumberEffect.NONE
        and _INERTIAL.fullmatch(number.path)
        and _owner(number.element) in fixed
    ):
        return NumberEffect.FIXED
    return effect


def _owner(element: XmlElement) -> str:
    """Return the name of the link or body that contains an element, or ""."""
    above: XmlElement | None = element
    while above is not None and above.tag not in ("link", "body"):
        above = above.parent
    return "" if above is None else above.attributes.get("name", "")


def _fixed(task: TreeTask) -> frozenset[str]:
    robot = read_as_it_runs(task.file, task.spec.settings)
    return frozenset(part.name for part in robot.parts if part.body == WORLD)
