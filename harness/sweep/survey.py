"""What a sweep finds in a folder before anything is planned: constants, scenarios, models."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from harness.engines.registry import engines
from harness.files.model_files import chosen_engines
from harness.sweep.factors import SweepError
from harness.sweep.system import Swept, swept


@dataclass(frozen=True, kw_only=True)
class SurveyTask:
    """What is wanted of a folder.

    Attributes:
        folder: of the system.
        content: hash of what is in it.
        varied: names of all constants that are varied.
        only: engines; empty: all.
        models: files, with the engine that is meant of each, "" for all; empty: all.
        scenarios, integrators: names; empty: all scenarios, each model's own integrator.
    """

    folder: str
    content: str
    varied: frozenset[str]
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
    """A system folder as a sweep sees it.

    Attributes:
        folder: where it is.
        content: hash of what is in it.
        system: its name.
        constants: all of them, as declared.
        scenarios: those that are wanted, of
        known_scenarios: all of them.
        pairings: models in engines, with integrators.
        known_integrators: names of all integrators that its models have.
        absent: engines that its models name and that are not installed.
        without: models, with their engines, that have none of the integrators asked for.
    """

    folder: str
    content: str
    system: str
    constants: Mapping[str, float]
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
        DeclarationError, SidecarError, LocationError, EngineError, SweepError: naming what is
            wrong, where, and the remedy; a model that can't follow a varied constant among it.
    """
    folder = swept(task.folder, task.varied, task.content)
    known = {one.name for one in folder.system.scenarios}
    found = list(_pairings(task, folder))
    kept = tuple(one for one in found if _wanted(one.integrator, task.integrators))
    every = dict.fromkeys(f"{one.model} [{one.engine}]" for one in found)
    swept_too = {f"{one.model} [{one.engine}]" for one in kept}
    return Survey(
        folder=task.folder,
        content=task.content,
        system=folder.system.name,
        constants={c.name: c.value for c in folder.system.constants},
        scenarios=tuple(
            one.name
            for one in folder.system.scenarios
            if not task.scenarios or one.name in task.scenarios
        ),
        known_scenarios=tuple(sorted(known)),
        pairings=kept,
        known_integrators=tuple(sorted({one.integrator for one in found})),
        absent=tuple(sorted(_absent(task, folder))),
        without=tuple(name for name in every if name not in swept_too),
    )


def _pairings(task: SurveyTask, folder: Swept) -> Iterator[Pairing]:
    """Every model in every engine that is meant, with each of its integrators."""
    known = engines()
    for sidecar in folder.sidecars():
        for name in chosen_engines(sidecar, task.only):
            if not _meant(task, sidecar.model.name, name):
                continue
            if name not in known:
                raise SweepError(f"{sidecar.model}.toml: no engine {name!r} is known")
            if known[name].version() is None:
                continue
            model = folder.model(sidecar.model.name, name)
            own = Pairing(
                model=sidecar.model.name, engine=name, integrator=model.integrator, settings={}
            )
            yield own
            if not task.integrators:
                continue
            for other, settings in model.integrators.items():
                yield Pairing(
                    model=own.model, engine=name, integrator=other, settings=dict(settings)
                )


def _wanted(integrator: str, wanted: tuple[str, ...]) -> bool:
    return not wanted or integrator.casefold() in {name.casefold() for name in wanted}


def _meant(task: SurveyTask, model: str, engine: str) -> bool:
    return not task.models or any(
        model == name and one in ("", engine) for name, one in task.models
    )


def _absent(task: SurveyTask, folder: Swept) -> set[str]:
    known = engines()
    return {
        name
        for sidecar in folder.sidecars()
        for name in chosen_engines(sidecar, task.only)
        if name in known and known[name].version() is None
    }
