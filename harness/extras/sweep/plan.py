"""The plan of a sweep: the number of cases, and each case from its number alone.

The order is folders, draws, scenarios, then models with engines and integrators, and time steps.
Cases with a common reference motion are consecutive, and only one block of cases is in memory.
"""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow
from .case import swept
from .factors import Draws, Factor, SweepError, SweepOptions, draws, matching_factors
from .planned import Block, Planned, Source


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


def survey(target: tuple[str, str], *, options: SweepOptions) -> SourceSurvey:
    """Load a folder and its models once, in a worker, since a declaration is a program.

    Args:
        target: folder of the system, or the robot file, and the hash of its content.
        options: factors, and the selected models, engines, scenarios and integrators.

    Raises:
        DeclarationError, SidecarError, LocationError, EngineError, RobotError, SweepError: giving
            the problem, the place and the remedy, also for a model that can't follow a varied
            constant.
    """
    folder, content = target
    with record_reads(Path(folder)) as seen:
        constants = swept(folder, frozenset(), content).constants
        varied = frozenset(one.name for one in matching_factors(options.factors, constants))
        source = swept(folder, varied, content)
        named = [one for one in source.runs(options.engines) if _is_selected(options, folder, *one)]
        runs = [one for one in named if source.follows(*one)]
        absent = {name for _, name in runs if engines()[name].version() is None}
        pairings = list(_pairings(options, source, [one for one in runs if one[1] not in absent]))
    wanted = {name.casefold() for name in options.integrators}
    kept = tuple(one for one in pairings if not wanted or one.integrator.casefold() in wanted)
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


def _is_selected(options: SweepOptions, folder: str, model: str, engine: str) -> bool:
    models = options.choice.models.get(folder, ())
    return not models or any(one.model == model and one.engine in ("", engine) for one in models)


MAX_LISTED, SIMILAR_LISTED = 24, 4
"""Maximum number of alternatives to list in full, and the number to list beyond that."""

BLOCK = 16
"""Approximate number of cases per worker task; larger groups of a draw and scenario are split."""


@dataclass(frozen=True, kw_only=True)
class FolderPlan:
    """The cases of one folder.

    Attributes:
        survey: survey of the folder.
        draws: draws of its constants.
        steps: time steps of its models; None: their own.
        first: number of its first case.
    """

    survey: SourceSurvey
    draws: Draws
    steps: tuple[float | None, ...]
    first: int

    @property
    def shared(self) -> int:
        """Number of cases of a draw and a scenario; they share a reference motion."""
        return len(self.survey.pairings) * len(self.steps)

    @property
    def count(self) -> int:
        """Number of its cases."""
        return self.draws.count * len(self.survey.scenarios) * self.shared

    @property
    def block(self) -> int:
        """Number of cases of a block."""
        if self.shared >= BLOCK:
            return BLOCK
        return self.shared * (BLOCK // self.shared)

    def place(self, number: int) -> tuple[int, str, Pairing, float | None]:
        """Return draw, scenario, pairing and step of a case, by its number in the part."""
        rest, step = divmod(number, len(self.steps))
        rest, pairing = divmod(rest, len(self.survey.pairings))
        draw, scenario = divmod(rest, len(self.survey.scenarios))
        survey = self.survey
        return draw, survey.scenarios[scenario], survey.pairings[pairing], self.steps[step]


@dataclass(frozen=True, kw_only=True)
class CasePlan:
    """All cases of a sweep."""

    options: SweepOptions
    parts: tuple[FolderPlan, ...]

    @property
    def count(self) -> int:
        """Number of all cases."""
        return sum(part.count for part in self.parts)

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of all varied constants."""
        names = (one.name for part in self.parts for one in part.draws.factors)
        return tuple(dict.fromkeys(names))

    @property
    def left_out(self) -> tuple[str, ...]:
        """Parts of the folders that are not swept, a line each."""
        return tuple(line for part in self.parts for line in part.survey.left_out)

    def blocks(self, done: Sequence[int] | bytes) -> Iterator[Block]:
        """Yield blocks of the cases that are not done, one at a time.

        Args:
            done: one byte per case, 1 if it is done.
        """
        for part in self.parts:
            for begin in range(0, part.count, part.block):
                end = min(begin + part.block, part.count)
                cases = tuple(
                    self._case(part, number)
                    for number in range(begin, end)
                    if not done[part.first + number]
                )
                if cases:
                    yield self._block(part, cases)

    def block_of(self, index: int) -> Block:
        """Return the block of one case.

        Raises:
            SweepError: if there is no such case.
        """
        for part in self.parts:
            if part.first <= index < part.first + part.count:
                return self._block(part, (self._case(part, index - part.first),))
        raise SweepError(f"--only {index}: the plan has cases 0 to {self.count - 1}")

    def _block(self, part: FolderPlan, cases: tuple[Planned, ...]) -> Block:
        return Block(
            folder=part.survey.folder,
            content=part.survey.content,
            varied=frozenset(one.name for one in part.draws.factors),
            resolution=self.options.resolution,
            thorough=self.options.thorough,
            cases=cases,
        )

    def _case(self, part: FolderPlan, number: int) -> Planned:
        draw, scenario, pairing, step = part.place(number)
        index = part.first + number
        row = SweepRow(
            index=index,
            draw=draw,
            system=part.survey.system,
            constants=part.draws.point_at(draw),
            model=pairing.model,
            engine=pairing.engine,
            scenario=scenario,
            integrator=pairing.integrator,
            step=step,
            outcome=Outcome.FAILED,
            command=shlex.join([*self.options.command, "--only", str(index)]),
        )
        return Planned(row=row, settings=pairing.settings)


def plan(options: SweepOptions, surveys: Sequence[SourceSurvey]) -> CasePlan:
    """Plan the cases of some folders.

    Raises:
        SweepError: for an unknown name, a range outside a constant's declared sign, or no cases.
    """
    _check_names(options, surveys)
    parts, first = [], 0
    for survey in surveys:
        own_factors = matching_factors(options.factors, survey.constants)
        for varied in own_factors:
            _check_sign(varied, survey)
        # Segments of a robot's states extrapolate to zero step, so none of them has a time step.
        steps: tuple[float | None, ...] = (
            options.steps if survey.signed and options.steps else (None,)
        )
        drawn = draws(own_factors, options.design, options.count, options.seed)
        part = FolderPlan(survey=survey, draws=drawn, steps=steps, first=first)
        if part.count:
            parts.append(part)
            first += part.count
    if not parts:
        absent = sorted({name for survey in surveys for name in survey.absent})
        why = f"; not installed: {', '.join(absent)}" if absent else ""
        raise SweepError(f"no case is left: no model of these folders runs in what is asked{why}")
    return CasePlan(options=options, parts=tuple(parts))


def _check_names(options: SweepOptions, surveys: Sequence[SourceSurvey]) -> None:
    constants = list(dict.fromkeys(name for one in surveys for name in one.constants))
    for varied in options.factors:
        name = varied.name
        if any(varied.for_constants(one.constants) for one in surveys):
            continue
        raise SweepError(
            f"--vary {name}: no system of these has such a constant; they have"
            f" {_alternatives(name, constants)}"
        )
    scenarios = dict.fromkeys(name for one in surveys for name in one.known_scenarios)
    for name in options.scenarios:
        if name not in scenarios:
            raise SweepError(
                f"--scenario {name}: unknown scenario; scenarios are {', '.join(scenarios)}"
            )
    integrators = dict.fromkeys(name for one in surveys for name in one.known_integrators)
    for name in options.integrators:
        if name.casefold() not in map(str.casefold, integrators):
            raise SweepError(
                f"--integrator {name}: no model has it; they have {', '.join(integrators)}"
            )


def _alternatives(name: str, alternatives: Sequence[str]) -> str:
    """Return the available names; of many, those most similar to the given one."""
    if len(alternatives) <= MAX_LISTED:
        return ", ".join(alternatives) or "none"
    near = get_close_matches(name, alternatives, n=SIMILAR_LISTED, cutoff=0.0)
    return f"{', '.join(near)}, and {len(alternatives) - len(near)} more"


def _check_sign(varied: Factor, survey: SourceSurvey) -> None:
    """Check that a factor keeps the declared sign, which the simplified equations assume."""
    if not survey.signed:
        return
    positive = survey.constants[varied.name] > 0
    if (varied.low > 0) != positive or (varied.high > 0) != positive:
        sign = "positive" if positive else "not positive"
        raise SweepError(
            f"--vary {varied.name}={varied.low:g}:{varied.high:g}: {survey.folder}/system.py"
            f" declares {varied.name} {sign}, so that its range must be; declare it with the sign"
            " that it is to have, or change the range"
        )
