"""Survey a folder or file before planning: constants, scenarios, models."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from .case import swept
from .factors import Factor, matching_factors
from .source import Source


@dataclass(frozen=True, kw_only=True)
class SurveyTask:
    """A task to survey a folder.

    Attributes:
        folder: folder of the system, or the robot file.
        content: hash of its content.
        factors: varied constants.
        only: engines; empty: all.
        models: files, each with its engine, "" for all; empty: all.
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
    """A model in an engine with an integrator, which some settings select."""

    model: str
    engine: str
    integrator: str
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class SourceSurvey:
    """Survey of a system folder or a robot file.

    Attributes:
        folder: its path.
        content: hash of its content.
        reads: states of files that its code read or looked for, by name relative to the folder.
        system: its name.
        constants: all constants, with declared values.
        signed: whether they keep their declared signs.
        scenarios: selected scenarios.
        known_scenarios: all scenarios.
        pairings: models in engines, with integrators.
        known_integrators: names of all integrators of its models.
        absent: engines that its models name and that are not installed.
        without: models with engines that have none of the requested integrators.
        fixed: models with engines that have none of the varied constants.
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
    fixed: tuple[str, ...] = ()

    @property
    def left_out(self) -> tuple[str, ...]:
        """Parts that are not swept, a line each."""
        absent = (f"{self.system}: {name} is not installed" for name in self.absent)
        others = ", ".join(self.known_integrators)
        without = (
            f"{self.system}/{name} has none of these integrators ({others})"
            for name in self.without
        )
        fixed = (f"{self.system}/{name} has none of the varied numbers" for name in self.fixed)
        return (*absent, *without, *fixed)


def survey(task: SurveyTask) -> SourceSurvey:
    """Load a folder and its models once, in a worker, since a declaration is a program.

    Raises:
        DeclarationError, SidecarError, LocationError, EngineError, RobotError, SweepError: giving
            the problem, the place and the remedy, also for a model that can't follow a varied
            constant.
    """
    with record_reads(Path(task.folder)) as seen:
        constants = swept(task.folder, frozenset(), task.content).constants
        varied = frozenset(one.name for one in matching_factors(task.factors, constants))
        source = swept(task.folder, varied, task.content)
        named = [one for one in source.runs(task.only) if _is_selected(task, *one)]
        runs = [one for one in named if source.follows(*one)]
        absent = {name for _, name in runs if engines()[name].version() is None}
        pairings = list(_pairings(task, source, [one for one in runs if one[1] not in absent]))
    kept = tuple(one for one in pairings if _wanted(one.integrator, task.integrators))
    every = dict.fromkeys(f"{one.model} [{one.engine}]" for one in pairings)
    swept_too = {f"{one.model} [{one.engine}]" for one in kept}
    return SourceSurvey(
        folder=task.folder,
        content=task.content,
        reads=_with_earlier(task, seen.states),
        system=source.name,
        constants=source.constants,
        signed=source.signed,
        scenarios=tuple(
            name for name in source.scenarios if not task.scenarios or name in task.scenarios
        ),
        known_scenarios=tuple(sorted(source.scenarios)),
        pairings=kept,
        known_integrators=tuple(sorted({one.integrator for one in pairings})),
        absent=tuple(sorted(absent)),
        without=tuple(name for name in every if name not in swept_too),
        fixed=tuple(
            f"{model} [{engine}]" for model, engine in named if (model, engine) not in runs
        ),
    )


_READS: dict[tuple[str, str], dict[str, str]] = {}
"""Files that were read for a folder's content; a worker reads each once."""


def _with_earlier(task: SurveyTask, reads: Mapping[str, str]) -> Mapping[str, str]:
    """Merge the files read by a survey with those of earlier surveys in this worker."""
    if Path(task.folder).is_file():  # the content of a robot file covers all files that it names
        return {}
    key = task.folder, task.content
    _READS[key] = {**_READS.get(key, {}), **reads}
    return _READS[key]


def _pairings(
    task: SurveyTask, source: Source, runs: Iterable[tuple[str, str]]
) -> Iterator[Pairing]:
    """Yield each model in each selected engine, with each of its integrators."""
    for model, engine in runs:
        own_integrator, others = source.prepare(model, engine)
        yield Pairing(model=model, engine=engine, integrator=own_integrator, settings={})
        if not task.integrators:
            continue
        for other, settings in others.items():
            yield Pairing(model=model, engine=engine, integrator=other, settings=dict(settings))


def _wanted(integrator: str, wanted: tuple[str, ...]) -> bool:
    return not wanted or integrator.casefold() in {name.casefold() for name in wanted}


def _is_selected(task: SurveyTask, model: str, engine: str) -> bool:
    return not task.models or any(
        model == name and one in ("", engine) for name, one in task.models
    )
