"""`check`: run models and evaluate the results in your own tests and scripts.

from physics_crosscheck import check

def test_my_arm():
    result = check("models/arm", resolution=1e-8)
    assert result.agree, str(result)
    assert result.case(scenario="large").full_run.global_error < 0.01
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from physics_crosscheck.harness.baseline.place import DEFAULT
from physics_crosscheck.harness.extras.notebook import cases as shown
from physics_crosscheck.harness.extras.notebook.optional import frame
from physics_crosscheck.harness.jobs.limits import MEMORY, SECONDS
from physics_crosscheck.harness.jobs.main_module import without_main
from physics_crosscheck.harness.modelfiles.folders import check_engines, system_folders
from physics_crosscheck.harness.planning.options import (
    check_limits,
    check_names,
    check_number,
    check_resolution,
    check_text,
)
from physics_crosscheck.harness.records import results
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.render.terminal.table import summary
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT
from physics_crosscheck.harness.results.failure import diagnosis_lines, failure_message
from physics_crosscheck.harness.results.findings import audit_lines
from physics_crosscheck.harness.results.status import status_of
from physics_crosscheck.harness.run import Options, run

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Results(results.Results, frozen=True, kw_only=True):
    """Results of a check, as in results.json; true if everything agrees."""

    @property
    def agree(self) -> bool:
        """Whether all cases and audits agree; a missing engine counts as a failure."""
        passes = all(case.passes for case in self.cases)
        return bool(self.cases) and passes and all(model.passes for model in self.models)

    def __bool__(self) -> bool:
        return self.agree

    def case(
        self,
        scenario: str | None = None,
        model: str | None = None,
        engine: str | None = None,
        system: str | None = None,
    ) -> Case:
        """Return the one case that matches all given names.

        Raises:
            LookupError: if no case or several cases match; lists the candidates.
        """
        wanted = {"scenario": scenario, "model": model, "engine": engine, "system": system}
        given = {key: value for key, value in wanted.items() if value is not None}
        found = [c for c in self.cases if all(getattr(c, k) == v for k, v in given.items())]
        if len(found) == 1:
            return found[0]
        said = ", ".join(f"{key}={value!r}" for key, value in given.items()) or "nothing given"
        what = "more than one case has" if found else "no case has"
        which = ", ".join(str(case.id) for case in found or self.cases)
        raise LookupError(f"{what} {said}: {which}")

    def trajectories(
        self,
        scenario: str | None = None,
        model: str | None = None,
        engine: str | None = None,
        system: str | None = None,
    ) -> shown.Trajectories:
        """Return the motions of one case: `simulated`, `reference` and `errors`.

        Each is a `Trajectory` with the coordinates and their rates, at the model's own time step.

        Raises:
            LookupError: as `case`.
            MotionError: if the case was not judged, with the reason.
        """
        return shown.trajectories(self, self.case(scenario, model, engine, system))

    def to_frame(self, library: str = "") -> Any:
        """Return a table with one row per case: names, outcome, numbers and reason.

        Discrepancy and uncertainty are relative to how far a component moves over a segment, the
        global error to the amplitude; steps are in seconds. Missing values are nan.

        Args:
            library: "pandas" or "polars"; empty: the first of these that is installed.

        Raises:
            ImportError: where none is installed; says what installs it.
        """
        return frame(shown.columns(self.cases), library)

    def plot(self, what: shown.What = "verdicts", ax: Axes | None = None) -> Axes:
        """Draw the cases.

        Args:
            what: "verdicts", discrepancy beside uncertainty of each case; or "steps", the global
                error over the step, with a ring around the shipped one.
            ax: where to draw; None: a figure of its own.

        Raises:
            ValueError: for anything else, or where no case has any.
            ImportError: without matplotlib; says what installs it.
        """
        return shown.plot(self, what, ax)

    def _repr_html_(self) -> str:
        return shown.page(self)

    def __str__(self) -> str:
        blocks = []
        for case in self.cases:
            if not case.passes:
                decision = status_of(case, require_engines=True)
                blocks.append(f"{case.id}\n{failure_message(case, decision)}")
        for model in self.models:
            if model.diagnosis is not None:
                read = bool(model.unexplained_findings)
                cause = (BEGIN_WITH_AUDIT,) if read else diagnosis_lines(model.diagnosis)
                blocks.append("\n  ".join((str(model.id), *cause)))
            if not model.passes:
                failed = (f"{what} failed: {why}" for what, why in model.failures)
                findings = audit_lines(model.findings)
                blocks.append("\n  ".join((f"audit of {model.id}", *failed, *findings)))
        return "\n".join((*blocks, summary(self)))

    __repr__ = __str__


MOST_JOBS = 4096
"""Worker processes that no machine has."""


def check(
    *paths: str | PathLike[str],
    engines: Sequence[str] = (),
    resolution: float = 1e-9,
    jobs: int = 0,
    limit: float = SECONDS,
    memory: float = MEMORY,
    baseline: str | PathLike[str] = DEFAULT,
    scheduler: str = "",
) -> Results:
    """Run every model of the system folders at `paths` in every scenario, and judge it.

    Args:
        paths: system folders, folders of them, or names of built-in ones; none: all built-in.
        engines: only these; none: every engine that the sidecars name.
        resolution: relative discrepancy to resolve.
        jobs: worker processes; 0: one per processor.
        limit: processor seconds that one task may use.
        memory: GiB that a worker may hold.
        baseline: where differences that were accepted are looked up.
        scheduler: address of a dask cluster's; empty: processes of this machine.

    Raises:
        FolderError: for a path that is no system folder, or an engine that nobody knows.
        BaselineError: for a baseline that can't be believed.
        ClusterError: for a cluster that can't be worked with.
        TypeError: for an argument of another type, such as one engine's name for a list of them.
        ValueError: for a number that is out of bounds.
    """
    for path in paths:
        check_text(path, "a path of check()", path=True)
    check_names(engines, "engines")
    check_text(baseline, "baseline", path=True)
    check_text(scheduler, "scheduler")
    check_engines(engines)
    folders = system_folders([str(path) for path in paths])
    options = Options(
        engines=tuple(engines),
        resolution=check_resolution(resolution),
        jobs=int(check_number(jobs, "jobs", 0, MOST_JOBS, whole=True)),
        limits=check_limits(limit, memory, "check's "),
        baseline=Path(baseline),
        scheduler=scheduler,
    )
    with without_main():
        found = run(folders, options, lambda *_: None).results
    return Results(**msgspec.structs.asdict(found))
