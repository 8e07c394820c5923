"""The plan of a sweep: the number of cases, and each case from its number alone.

The order is folders, draws, scenarios, then models with engines and integrators, and time steps.
Cases with a common reference motion are consecutive, and only one block of cases is in memory.
"""

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow
from .draws import Draws, SweepOptions, draws
from .factors import Factor, SweepError, matching_factors
from .planned import Block, Planned
from .survey import Pairing, SourceSurvey

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
