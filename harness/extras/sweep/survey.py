"""What a sweep finds in a folder or a file before it is planned: constants, scenarios, models."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.extras.sweep.case import swept
from physics_crosscheck.harness.extras.sweep.factors import Factor, meant
from physics_crosscheck.harness.extras.sweep.source import Source
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.path_states import merged


@dataclass(frozen=True, kw_only=True)
class SurveyTask:
    """What is wanted of a folder.

    Attributes:
        folder: of the system, or the robot's file.
        content: hash of what is in it.
        factors: what is varied.
        only: engines; empty: all.
        models: files, with the engine that is meant of each, "" for all; empty: all.
        scenarios, integrators: names; empty: all scenarios, each model's own integrator.
    """

    folder: str
    content: str
    factors: tuple[Factor, ...]
    only: tuple[str, ...] = ()
    models: tuple[tuple[str, str], ...] = ()
    scenarios: tuple[str, ...] = ()
    integrators: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Pairing:
    """A model in an engine, stepped by an integrator that some settings choose."""

    model: str
    engine: str
    integrator: str
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Survey:
    """A system folder, or a robot's file, as a sweep sees it.

    Attributes:
        folder: where it is.
        content: hash of what is in it.
        reads: states of what its code read or looked for, by name relative to the folder.
        system: its name.
        constants: all of them, as declared.
        signed: whether they keep the signs that they are declared with.
        scenarios: those that are wanted, of
        known_scenarios: all of them.
        pairings: models in engines, with integrators.
        known_integrators: names of all integrators that its models have.
        absent: engines that its models name and that are not installed.
        without: models, with their engines, that have none of the integrators asked for.
    """

    folder: str
    content: str
    reads: Mapping[str, str]
    system: str
    constants: Mapping[str, float]
    signed: bool
    scenarios: tuple[str, ...]
    known_scenarios: tuple[str, ...]
    pairings: tuple[Pairing, ...]
    known_integrators: tuple[str, ...]
    absent: tuple[str, ...]
    without: tuple[str, ...] = ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """What is not swept, a line each."""
        absent = (f"{self.system}: {name} is not installed" for name in self.absent)
        others = ", ".join(self.known_integrators)
        without = (
            f"{self.system}/{name} has none of these integrators ({others})"
            for name in self.without
        )
        return (*absent, *without)


def survey(task: SurveyTask) -> Survey:
    """Load a folder and its models once, in a worker: a declaration is a program.

    Raises:
        DeclarationError, SidecarError, LocationError, EngineError, RobotError, SweepError: naming
            what is wrong, where, and the remedy; a model that can't follow a varied constant among
            it.
    """
    with record_reads(Path(task.folder)) as seen:
        known = swept(task.folder, frozenset(), task.content).constants
        varied = frozenset(one.name for one in meant(task.factors, known))
        source = swept(task.folder, varied, task.content)
        runs = [one for one in source.runs(task.only) if _meant(task, *one)]
        absent = {name for _, name in runs if engines()[name].version() is None}
        found = list(_pairings(task, source, [one for one in runs if one[1] not in absent]))
    kept = tuple(one for one in found if _wanted(one.integrator, task.integrators))
    every = dict.fromkeys(f"{one.model} [{one.engine}]" for one in found)
    swept_too = {f"{one.model} [{one.engine}]" for one in kept}
    return Survey(
        folder=task.folder,
        content=task.content,
        reads=_with_earlier(task, seen.states()),
        system=source.name,
        constants=source.constants,
        signed=source.signed,
        scenarios=tuple(
            name for name in source.scenarios if not task.scenarios or name in task.scenarios
        ),
        known_scenarios=tuple(sorted(source.scenarios)),
        pairings=kept,
        known_integrators=tuple(sorted({one.integrator for one in found})),
        absent=tuple(sorted(absent)),
        without=tuple(name for name in every if name not in swept_too),
    )


_READS: dict[tuple[str, str], dict[str, str]] = {}
"""What was read of a folder of a content, which a worker reads once."""


def _with_earlier(task: SurveyTask, reads: Mapping[str, str]) -> Mapping[str, str]:
    """What was read for a survey, with what this worker read for one before it."""
    if Path(task.folder).is_file():  # a robot's: all that it names is in its content
        return {}
    key = task.folder, task.content
    _READS[key] = merged(_READS.get(key, {}), reads)
    return _READS[key]


def _pairings(
    task: SurveyTask, source: Source, runs: Iterable[tuple[str, str]]
) -> Iterator[Pairing]:
    """Every model in every engine that is meant, with each of its integrators."""
    for model, engine in runs:
        own, others = source.prepare(model, engine)
        yield Pairing(model=model, engine=engine, integrator=own, settings={})
        if not task.integrators:
            continue
        for other, settings in others.items():
            yield Pairing(model=model, engine=engine, integrator=other, settings=dict(settings))


def _wanted(integrator: str, wanted: tuple[str, ...]) -> bool:
    return not wanted or integrator.casefold() in {name.casefold() for name in wanted}


def _meant(task: SurveyTask, model: str, engine: str) -> bool:
    return not task.models or any(
        model == name and one in ("", engine) for name, one in task.models
    )
