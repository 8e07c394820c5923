"""Results of a run: the only input of the report."""

from collections.abc import Iterable
from typing import Literal

from .base import Record
from .case import OWN_LIMITS, Case, CaseId
from .diff import Diff
from .model import Model
from .outcome import Outcome
from .system import SystemResult

SCHEMA: Literal[5] = 5


def nothing_tested(engines: Iterable[str]) -> str:
    """Return the message if none of the selected engines is installed."""
    names = sorted(set(engines))
    verb = "is" if len(names) == 1 else "are"
    return (
        f"nothing was tested: {' and '.join(names)} {verb} not installed; install what the models"
        " run in, such as `pip install 'physics-crosscheck[engines]'`"
    )


class BaselineChanges(Record, frozen=True, kw_only=True):
    """Changes since an accepted baseline.

    Attributes:
        name: Name of the baseline, such as its folder.
        changes: The changes, worst first; empty if nothing changed.
    """

    name: str
    changes: tuple[Diff, ...]


class Results(Record, frozen=True, kw_only=True):
    """All results of one run. The report is drawn from this file alone.

    Attributes:
        created: Time of the run, UTC, ISO 8601.
        versions: Versions of this package, Python and engines; None for an engine that is not
            installed.
        resolution: Requested resolution: the smallest relative difference that counts.
        seconds: Duration of the run, wall-clock seconds.
        systems: The systems that could be loaded.
        models: Each model file in each engine that ran it.
        cases: All cases, including those that could not run.
        baseline: Changes since the accepted baseline; None without a baseline.
        stopped: Signal that stopped the run early; empty after a complete run.
        not_run: Cases that a stopped run did not reach; `system.py` stands for a whole folder.
        cached: Number of cases reused from the cache.
        optional: Engines that need an extra; they may refuse a file that others judge.
        schema: Version of this format.
    """

    created: str
    versions: dict[str, str | None]
    resolution: float
    seconds: float
    systems: tuple[SystemResult, ...]
    models: tuple[Model, ...]
    cases: tuple[Case, ...]
    baseline: BaselineChanges | None = None
    stopped: str = ""
    not_run: tuple[CaseId, ...] = ()
    cached: int = 0
    optional: tuple[str, ...] = ()
    schema: Literal[5] = SCHEMA

    @property
    def untested(self) -> str:
        """Why nothing was tested, and the remedy; empty if something was tested.

        A run without a tested case does not pass.
        """
        if not self.cases or any(case.outcome is not Outcome.ABSENT for case in self.cases):
            return ""
        engines = [case.engine for case in self.cases if case.engine != "-"]
        return nothing_tested(engines) if engines else "nothing was tested: nothing moves"

    @property
    def refusals(self) -> tuple[Case, ...]:
        """Refused cases of optional engines, of files that another engine has judged."""
        refused = (case for case in self.cases if case.outcome is Outcome.REFUSED)
        return tuple(c for c in refused if c.engine in self.optional and self.judges(c))

    def judges(self, case: Case) -> bool:
        """Return whether an engine has a verdict on the file of a case."""
        place = case.folder, case.scenario
        return any((c.folder, c.scenario) == place for c in self.cases if c.verdict is not None)

    def is_own_limit(self, case: Case) -> bool:
        """Return whether a case fails by its engine, and another engine judges the robot file."""
        is_robot = case.folder.endswith(case.model)
        return is_robot and case.kind in OWN_LIMITS and self.judges(case)

    @property
    def failed(self) -> tuple[Case, ...]:
        """Cases that don't pass, or whose model doesn't."""
        amiss = {model.key for model in self.models if not model.passes}
        return tuple(c for c in self.cases if not c.passes or c.key in amiss)

    def model_of(self, case: Case) -> Model | None:
        """Return the record of a case's model in its engine; None if it did not run."""
        return next((model for model in self.models if model.key == case.key), None)
