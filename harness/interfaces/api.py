"""`check`: run models and evaluate the results in your own tests and scripts.

from physics_crosscheck import check

def test_my_arm():
    result = check("models/arm", resolution=1e-8)
    assert result.agree, str(result)
    assert result.case(scenario="large").full_run.global_error < 0.01
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from physics_crosscheck.harness.jobs.environment import without_main
from physics_crosscheck.harness.jobs.limits import MEMORY, SECONDS
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.paths import DEFAULT_FOLDER, RESOLUTION
from physics_crosscheck.harness.planning.options import (
    check_limits,
    check_names,
    check_number,
    check_resolution,
    check_text,
)
from physics_crosscheck.harness.records import results
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import render
from physics_crosscheck.harness.render.terminal.table import summary
from physics_crosscheck.harness.results.causes import BEGIN_WITH_AUDIT
from physics_crosscheck.harness.results.failure import audit_lines, diagnosis_lines, failure_message
from physics_crosscheck.harness.results.status import status_of
from physics_crosscheck.harness.run import Options, run
from .cli.targets import resolve_targets
from .notebook import cases as shown
from .notebook.optional import frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class CheckResults(results.Results, frozen=True, kw_only=True):
    """Results of a check, as in results.json; true if everything agrees."""

    @property
    def agree(self) -> bool:
        """True if all cases and audits agree; a missing engine counts as a failure.

        An optional engine that refuses a robot file does not count if another one has a verdict.
        """
        passes = all(case.passes or case in self.refusals for case in self.cases)
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
        matches = [c for c in self.cases if all(getattr(c, k) == v for k, v in given.items())]
        if len(matches) == 1:
            return matches[0]
        criteria = ", ".join(f"{key}={value!r}" for key, value in given.items()) or "nothing given"
        what = "more than one case has" if matches else "no case has"
        which = ", ".join(str(case.id) for case in matches or self.cases)
        raise LookupError(f"{what} {criteria}: {which}")

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Causes of the differences that a diagnosis explains, each once, with their lines."""
        explained = (
            model.diagnosis.explanations[0].causes
            for model in self.models
            if model.diagnosis is not None and model.diagnosis.explained
        )
        return tuple(dict.fromkeys(cause for causes in explained for cause in causes))

    @property
    def advice(self) -> tuple[AuditFinding, ...]:
        """Implausible numbers of the model files, each once; they change no verdict."""
        return tuple(dict.fromkeys(one for model in self.models for one in model.advice))

    def summary(self) -> str:
        """Return the problems and the last line as `crosscheck run` prints them."""
        return str(self)

    def show(self) -> ReportPage:
        """Return the page of the results, which a notebook shows inline."""
        return ReportPage(render(self))

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

        Discrepancy and uncertainty are relative to the displacement of a component over a segment.
        The global error is relative to the amplitude. Steps are in seconds. Missing values are nan.

        Args:
            library: "pandas" or "polars"; empty: the first that is installed.

        Raises:
            ImportError: if none is installed; the message names what to install.
        """
        return frame(shown.columns(self.cases), library)

    def plot(self, what: shown.What = "verdicts", ax: Axes | None = None) -> Axes:
        """Draw the cases.

        Args:
            what: "verdicts" draws discrepancy and uncertainty of each case; "steps" draws the
                global error over the time step, with a ring at the file's own step.
            ax: axes to draw on; None: a new figure.

        Raises:
            ValueError: if `what` has another value, or no case has the data.
            ImportError: without matplotlib; the message names what to install.
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


@dataclass(frozen=True)
class ReportPage:
    """A page of results in a frame.

    Attributes:
        html: the page, one file that works offline.
        height: of the frame, pixels.
    """

    html: str
    height: int = 720

    def write(self, path: str | PathLike[str]) -> None:
        """Write the page to a file."""
        write_whole(Path(path), self.html)

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{self.height}px;border:0"
        return f'<iframe title="report" style="{style}" srcdoc="{escape(self.html)}"></iframe>'

    def __repr__(self) -> str:
        return f"<report of {len(self.html) / 1e6:.1f} MB; .write(path) saves it>"


MOST_JOBS = 4096
"""Upper limit of worker processes, above any real machine."""


Target = str | PathLike[str]


def target_names(paths: Iterable[Target | Sequence[Target]]) -> list[str]:
    """Return the names of targets, those of lists one by one.

    Raises:
        TypeError: for a name that is not a path.
    """
    names = list[Target]()
    for path in paths:
        names += [path] if isinstance(path, str) or not isinstance(path, Sequence) else path
    for name in names:
        check_text(name, "a path of check()", path=True)
    return [str(name) for name in names]


def check(
    *paths: Target | Sequence[Target],
    engines: Sequence[str] = (),
    resolution: float | None = None,
    jobs: int = 0,
    limit: float = SECONDS,
    memory: float = MEMORY,
    baseline: str | PathLike[str] = DEFAULT_FOLDER,
    scheduler: str = "",
    floating: bool | None = None,
    model: str = "",
    thorough: bool = False,
    smooth: bool = False,
    ideal: bool = False,
) -> CheckResults:
    """Run every model and robot file in every scenario, and compare it with its equations.

    Args:
        paths: system folders, robot files, folders of these, model files, or names of built-in
            systems, also in lists; none: all built-in systems.
        engines: names of the engines to use; none: every engine that a sidecar names, or that
            reads a robot file.
        resolution: smallest relative discrepancy to detect; None: 1e-9, or an engine's documented
            precision if that is less.
        jobs: number of worker processes; 0: one per processor.
        limit: processor seconds per task.
        memory: GiB per worker.
        baseline: folder of the accepted differences.
        scheduler: address of a Dask scheduler; empty: processes of this machine.
        floating: True lets the root link of a URDF move.
        model: model to read from an SDFormat file that has several.
        thorough: True runs every check, also where a cheaper one decides.
        smooth: True checks robot files without limits, friction, contacts and drives only.
        ideal: True judges by rigid contacts, not by the law that a sidecar states.

    Raises:
        FolderError: if a path is not a target, or an engine is unknown.
        BaselineError: if the baseline is damaged.
        ClusterError: if the cluster does not work.
        TypeError: if an argument has the wrong type, such as a string for `engines`.
        ValueError: if a number is out of bounds.
    """
    names = target_names(paths)
    check_names(engines, "engines")
    check_text(baseline, "baseline", path=True)
    check_text(scheduler, "scheduler")
    check_text(model, "model")
    check_engines(engines)
    targets = resolve_targets(names, standalone=False)
    if targets.named.faults:
        raise FolderError("; ".join(targets.named.faults.values()))
    options = Options(
        engines=tuple(engines),
        resolution=check_resolution(RESOLUTION if resolution is None else resolution),
        strict=resolution is not None,
        jobs=int(check_number(jobs, "jobs", 0, MOST_JOBS, whole=True)),
        limits=check_limits(limit, memory, "check's "),
        baseline=Path(baseline),
        scheduler=scheduler,
        floating=floating,
        model=model,
        choice=targets.choice,
        thorough=bool(thorough),
        smooth=bool(smooth),
        ideal=bool(ideal),
    )
    with without_main():
        record = run(targets.folders, options, lambda *_: None, robots=targets.robots).results
    return CheckResults(**msgspec.structs.asdict(record))
