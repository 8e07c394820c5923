"""`check`, for people who write their own tests: run models, and look at how they came out.

from harness import check

def test_my_arm():
    result = check("models/arm", resolution=1e-8)
    assert result.agree, str(result)
    assert result.case(scenario="large").raw_error < 0.01
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from harness.baseline.store import DEFAULT
from harness.files.folders import check_engines, system_folders
from harness.records.outcome import Outcome
from harness.run import Options, run
from harness.schedule.main_module import without_main
from harness.schedule.workers import LIMIT
from harness.text.failure import diagnosis_lines, told
from harness.text.findings import audit_lines
from harness.text.status import TestStatus, decide
from harness.text.table import audit_findings, case_id, summary


@dataclass(frozen=True)
class CheckedCase:
    """One model file in one engine in one scenario.

    Attributes:
        discrepancy, uncertainty: relative to how far `component` moves over a segment; None where
            there is none, as in a case that FAILED.
        order: of the engine's error in the step, as seen.
        raw_error: at the shipped step, over the whole motion, relative to its amplitude.
        shipped_step: seconds.
        reason: a sentence for whatever is not AGREES.
        accepted: the reason for which a known difference is accepted; empty where none is.
        record: all of it, as in results.json.
    """

    system: str
    model: str
    engine: str
    scenario: str
    outcome: Outcome
    discrepancy: float | None
    uncertainty: float | None
    component: str
    order: float | None
    raw_error: float | None
    shipped_step: float | None
    reason: str
    accepted: str
    record: Mapping[str, Any] = field(repr=False, compare=False)

    @property
    def agrees(self) -> bool:
        """Whether it AGREES, or what it does instead is accepted."""
        return decide(self.record, require_engines=True).ending is TestStatus.PASS


@dataclass(frozen=True)
class CheckedModel:
    """One model file in one engine.

    Attributes:
        findings: the audit's findings, a line each.
        cause: what is wrong in it, a sentence each; empty where every case agrees.
        record: all of it, as in results.json, its linearizations included.
    """

    system: str
    model: str
    engine: str
    findings: tuple[str, ...]
    cause: tuple[str, ...]
    record: Mapping[str, Any] = field(repr=False, compare=False)

    @property
    def agrees(self) -> bool:
        """Whether the audit finds nothing, or what it finds is accepted."""
        return decide(self.record, require_engines=True).ending is TestStatus.PASS


@dataclass(frozen=True, repr=False)
class Checked:
    """How the models of some folders came out; true where they agree.

    Attributes:
        results: all of it, as in results.json.
    """

    cases: tuple[CheckedCase, ...]
    models: tuple[CheckedModel, ...]
    results: Mapping[str, Any] = field(compare=False)

    @property
    def agree(self) -> bool:
        """Whether every case and every audit does; an engine that is not installed agrees never."""
        cases, models = (all(one.agrees for one in some) for some in (self.cases, self.models))
        return bool(self.cases) and cases and models

    def __bool__(self) -> bool:
        return self.agree

    def case(
        self,
        scenario: str | None = None,
        model: str | None = None,
        engine: str | None = None,
        system: str | None = None,
    ) -> CheckedCase:
        """The one case that has what is given.

        Raises:
            LookupError: where there is none, or more than one; names what there is.
        """
        wanted = {"scenario": scenario, "model": model, "engine": engine, "system": system}
        given = {key: value for key, value in wanted.items() if value is not None}
        found = [c for c in self.cases if all(getattr(c, k) == v for k, v in given.items())]
        if len(found) == 1:
            return found[0]
        said = ", ".join(f"{key}={value!r}" for key, value in given.items()) or "nothing given"
        what = "more than one case has" if found else "no case has"
        which = ", ".join(case_id(case.record) for case in found or self.cases)
        raise LookupError(f"{what} {said}: {which}")

    def __str__(self) -> str:
        blocks = []
        for case in self.cases:
            if not case.agrees:
                decision = decide(case.record, require_engines=True)
                blocks.append(f"{case_id(case.record)}\n{told(case.record, decision, None)}")
        for model in self.models:
            where = f"{model.system}/{model.model} [{model.engine}]"
            if model.cause:
                blocks.append("\n  ".join((where, *model.cause)))
            if not model.agrees:
                blocks.append("\n  ".join((f"audit of {where}", *model.findings)))
        return "\n".join((*blocks, summary(self.results)))

    __repr__ = __str__


def check(
    *paths: str | PathLike[str],
    engines: Sequence[str] = (),
    resolution: float = 1e-9,
    jobs: int = 0,
    time_limit: float = LIMIT,
    baseline: str | PathLike[str] = DEFAULT,
) -> Checked:
    """Run every model of the system folders at `paths` in every scenario, and judge it.

    Args:
        paths: system folders, folders of them, or names of built-in ones; none: all built-in.
        engines: only these; none: every engine that the sidecars name.
        resolution: relative discrepancy to resolve.
        jobs: worker processes; 0: one per processor.
        time_limit: seconds that one case may take.
        baseline: where differences that were accepted are looked up.

    Raises:
        FolderError: for a path that is no system folder, or an engine that nobody knows.
        BaselineError: for a baseline that can't be believed.
        ValueError: for a resolution that double precision can't serve.
    """
    check_engines(engines)
    if not 1e-13 <= resolution <= 1e-2:
        raise ValueError(f"the resolution {resolution} is not between 1e-13 and 1e-2")
    folders = system_folders([str(path) for path in paths])
    options = Options(tuple(engines), resolution, jobs, time_limit, Path(baseline))
    with without_main():
        found = run(folders, options, lambda *_: None)
    return Checked(
        tuple(_case(record) for record in found["cases"]),
        tuple(_model(record) for record in found["models"]),
        found,
    )


def _case(record: Mapping[str, Any]) -> CheckedCase:
    names = (
        "system",
        "model",
        "engine",
        "scenario",
        "discrepancy",
        "uncertainty",
        "component",
        "order",
        "raw_error",
        "shipped_step",
        "reason",
    )
    fields = {name: record[name] for name in names}
    outcome, accepted = Outcome(record["outcome"]), record.get("accepted") or ""
    return CheckedCase(**fields, outcome=outcome, accepted=accepted, record=record)


def _model(record: Mapping[str, Any]) -> CheckedModel:
    findings = audit_findings(record)
    diagnosis = record.get("diagnosis")
    return CheckedModel(
        record["system"],
        record["model"],
        record["engine"],
        tuple(audit_lines(findings)) if findings else (),
        tuple(diagnosis_lines(diagnosis)) if diagnosis else (),
        record,
    )
