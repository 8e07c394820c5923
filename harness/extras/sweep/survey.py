"""Survey a folder or file before planning: constants, scenarios, models."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from .case import swept
from .draws import SweepOptions
from .factors import matching_factors
from .source import Source


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


def survey(folder: str, *, content: str, options: SweepOptions) -> SourceSurvey:
    """Load a folder and its models once, in a worker, since a declaration is a program.

    Args:
        folder: folder of the system, or the robot file.
        content: hash of its content.
        options: factors, and the selected models, engines, scenarios and integrators.

    Raises:
        DeclarationError, SidecarError, LocationError, EngineError, RobotError, SweepError: giving
            the problem, the place and the remedy, also for a model that can't follow a varied
            constant.
    """
    with record_reads(Path(folder)) as seen:
        constants = swept(folder, frozenset(), content).constants
        varied = frozenset(one.name for one in matching_factors(options.factors, constants))
        source = swept(folder, varied, content)
        named = [one for one in source.runs(options.engines) if _is_selected(options, folder, *one)]
        runs = [one for one in named if source.follows(*one)]
        absent = {name for _, name in runs if engines()[name].version() is None}
        pairings = list(_pairings(options, source, [one for one in runs if one[1] not in absent]))
    kept = tuple(one for one in pairings if _wanted(one.integrator, options.integrators))
    every = dict.fromkeys(f"{one.model} [{one.engine}]" for one in pairings)
    swept_too = {f"{one.model} [{one.engine}]" for one in kept}
    return SourceSurvey(
        folder=folder,
        content=content,
        reads=_with_earlier(folder, content, seen.states),
        system=source.name,
        constants=source.constants,
        signed=source.signed,
        scenarios=tuple(
            name for name in source.scenarios if not options.scenarios or name in options.scenarios
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


def _with_earlier(folder: str, content: str, reads: Mapping[str, str]) -> Mapping[str, str]:
    """Merge the files read by a survey with those of earlier surveys in this worker."""
    if Path(folder).is_file():  # the content of a robot file covers all files that it names
        return {}
    key = folder, content
    _READS[key] = {**_READS.get(key, {}), **reads}
    return _READS[key]


def _pairings(
    options: SweepOptions, source: Source, runs: Iterable[tuple[str, str]]
) -> Iterator[Pairing]:
    """Yield each model in each selected engine, with each of its integrators."""
    for model, engine in runs:
        own_integrator, others = source.prepare(model, engine)
        yield Pairing(model=model, engine=engine, integrator=own_integrator, settings={})
        if not options.integrators:
            continue
        for other, settings in others.items():
            yield Pairing(model=model, engine=engine, integrator=other, settings=dict(settings))


def _wanted(integrator: str, wanted: tuple[str, ...]) -> bool:
    return not wanted or integrator.casefold() in {name.casefold() for name in wanted}


def _is_selected(options: SweepOptions, folder: str, model: str, engine: str) -> bool:
    models = options.choice.models.get(folder, ())
    return not models or any(one.model == model and one.engine in ("", engine) for one in models)
