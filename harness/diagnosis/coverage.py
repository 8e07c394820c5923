"""Count of the numbers in a model's files, by the check that tests them."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.diagnosis.behaviour import Probe
from physics_crosscheck.harness.diagnosis.coverage_trials import NumberEffect, Trials
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import locate
from physics_crosscheck.harness.modelfiles.frames import SidecarFrames, sidecar_frames
from physics_crosscheck.harness.modelfiles.locations import Literal, literals
from physics_crosscheck.harness.modelfiles.mjcf.read import parts_of
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.records.coverage import Coverage, Untested
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System

STATES = 24
"""States at which a model is evaluated, in addition to each component's extremes."""

TOGETHER = 20
"""Numbers that are changed together first, if most of them have no effect."""

MAX_EXAMPLES = 3
"""Maximum number of examples of a reason."""

_MODEL = re.compile(r"(settings|spring)\b.*")
"""Entries of a sidecar that belong to the model."""

_DIRECTION = re.compile(r".*axis\w*(@.*)?")
"""Numbers that define a direction, without regard to length."""

_STEP = {r"settings(\.\w+)?\.step": "time step"}

_NAMED = tuple(
    say.value
    for say in (NumberEffect.NONE, NumberEffect.FAINT, NumberEffect.FIXED, NumberEffect.REFUSED)
)
"""Reasons for which each number with an address is listed."""


def count_numbers(task: SystemTask) -> Coverage:
    """Change each number of a model's files, and count those with an effect.

    Raises:
        EngineError, SidecarError, LocationError: with file, place and remedy.
    """
    engine = engines()[task.engine]
    model, coordinates = task.load()
    z, w = coordinates.to_engine(_some(task.target.visited))
    frames = _frames(task.target.system, task.declared)
    probe = Probe(z, w, model.step, engine, frames, task.resolution)
    numbers, bound = _numbers(task.declared, task.engine), _bound(task.declared)
    purposes = {**_STEP, **engine.non_physical}
    reasons = [reason_of(one.path, purposes) for one in numbers]
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        base = probe.evaluate(model)
        _ = base.posed  # before some engines unload this model
        trials = Trials(task.declared, numbers, probe, base, Path(folder))
        chosen = [bool(engine.choices and re.fullmatch(engine.choices, p.path)) for p in numbers]
        tried = [i for i, choice in enumerate(chosen) if not choice]
        trials.nudge([i for i in tried if reasons[i]], together=len(numbers))
        others = [i for i in tried if not reasons[i]]
        # Most bound numbers have an effect, so that groups of them save no time.
        trials.nudge([i for i in others if _place(numbers[i]) in bound], together=1)
        trials.nudge([i for i in others if _place(numbers[i]) not in bound], together=TOGETHER)
        trials.flip([i for i, one in enumerate(numbers) if _DIRECTION.fullmatch(one.path)])
    effects = {**dict.fromkeys(range(len(numbers)), NumberEffect.UNTRIED), **trials.effects}
    effects |= {i: NumberEffect.CHOICE for i, choice in enumerate(chosen) if choice}
    return summarized(
        [
            CountedNumber(
                path=one.path,
                address="",
                line=f"{one.location.file.name}:{one.location.line}",
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


def _numbers(sidecar: Sidecar, engine: str) -> tuple[Literal, ...]:
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


def _place(literal: Literal) -> tuple[str, int]:
    return str(literal.location.file), literal.location.start


@dataclass(frozen=True, kw_only=True)
class CountedNumber:
    """A number of a file, and its effect.

    Attributes:
        path: tags of its ancestors and its attribute.
        address: its address; empty if it has none.
        line: its place, such as `rod.xml:12`.
        effect: its effect.
        bound: whether it is compared with a formula.
    """

    path: str
    address: str
    line: str
    effect: NumberEffect
    bound: bool = False


def reason_of(path: str, purposes: Mapping[str, str]) -> str:
    """Return the purpose of numbers that need not affect motions, or "" if unknown."""
    return next((why for kind, why in purposes.items() if re.fullmatch(kind, path)), "")


def summarized(numbers: Sequence[CountedNumber], purposes: Mapping[str, str]) -> Coverage:
    """Count each number once, by the check that tests it, or by the reason that none does."""
    counts = {"motion": 0, "audit": 0, "frames": 0}
    untested: dict[str, list[CountedNumber]] = {}
    for number in numbers:
        if number.effect is NumberEffect.MOTION:
            counts["motion"] += 1
        elif number.bound:
            counts["audit"] += 1
        elif number.effect is NumberEffect.FRAMES:
            counts["frames"] += 1
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
