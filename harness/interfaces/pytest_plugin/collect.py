"""Tests of a target: one for each model file, engine and scenario, and one for each audit.

Ids are `system.py::drum_pendulum/robot.urdf/free` after a folder's path, and for a robot file
`arm.urdf::arm/arm.urdf/states`. All tests of a target belong to one file, so that xdist's
`--dist loadfile` (or `loadscope`) prepares it once.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.checks.declared import Declared
from physics_crosscheck.harness.checks.not_run import CannotRun, failed_case, skipped_case
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
    model_path,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.table import largest
from physics_crosscheck.harness.results.failure import (
    diagnosis_lines,
    failure_message,
    figures,
    in_brief,
)
from physics_crosscheck.harness.results.next_steps import advice_of, changes_of, stated_changes
from physics_crosscheck.harness.results.status import (
    Decision,
    TestStatus,
    status_of,
    unsettled_steps,
)
from physics_crosscheck.harness.results.visible import visible_lines
from .runner import CaseRunner, setting_of

RUNNER = pytest.StashKey[CaseRunner]()


WORDS = {"and", "or", "not", "True", "False", "None"}
"""Words with another meaning in `-m` expressions than a marker's name."""

NO_ENGINE = "-"
"""Engine name of a test without an engine."""

MOST_FIXES = 3
"""Maximum number of changes in a message."""

OURS = pytest.StashKey[set[str]]()


class SystemFile(pytest.File):
    """A folder's `system.py`. Collecting reads the declaration; it derives and judges nothing."""

    def collect(self) -> Iterator[CrosscheckItem]:
        """Yield the folder's tests; an unreadable part becomes a failing test."""
        folder = self.path.parent
        system = self.config.stash[RUNNER].declared(folder)
        if isinstance(system, Failure):
            yield _unread(self, folder, folder.name, self.path.name, system)
            return
        # Warnings of a library or a declaration during import are printed at the end of the
        # run. Settings that turn warnings into errors are meant for the project's own tests.
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            for warning in system.warned:
                warning.again()
            sidecars = list(model_files(folder))
        scenarios = list(system.scenarios)
        audit = "audit" if "audit" not in scenarios else "audit of the model"
        for item in sidecars:
            if isinstance(item, UnreadModel):
                name = item.model if item.model != "-" else "no model file"
                failure = Failure(item.reason, "", kind="sidecar")
                yield _unread(self, folder, system.name, name, failure)
                continue
            for engine in item.engines:
                tail = f"[{engine}]" if len(item.engines) > 1 else ""
                for scenario in (*scenarios, None):
                    case = f"{system.name}/{item.model.name}/{scenario or audit}"
                    yield CrosscheckItem.from_parent(
                        self,
                        name=_plain(case) + tail,
                        target=folder,
                        system=system.name,
                        model=item,
                        engine=engine,
                        scenario=scenario,
                    )


class RobotFile(pytest.File):
    """A robot file. Collecting reads it; it solves and judges nothing."""

    def collect(self) -> Iterator[CrosscheckItem]:
        """Yield a test for each engine, and one for the audit, which is the same in each."""
        file = self.path
        robot = self.config.stash[RUNNER].declared(file)
        if isinstance(robot, Failure):
            yield _unread(self, file, file.stem, file.name, robot)
            return
        engines = chosen_engines(file, ())
        for scenario in robot.scenarios:
            for engine in engines:
                tail = f"[{engine}]" if len(engines) > 1 else ""
                yield self._item(robot, engine, scenario, tail)
        yield self._item(robot, NO_ENGINE, None, "")

    def _item(
        self, robot: Declared, engine: str, scenario: str | None, tail: str
    ) -> CrosscheckItem:
        case = f"{robot.name}/{self.path.name}/{scenario or 'audit'}"
        return CrosscheckItem.from_parent(
            self,
            name=_plain(case) + tail,
            target=self.path,
            system=robot.name,
            model=self.path,
            engine=engine,
            scenario=scenario,
        )


def _unread(
    parent: pytest.File, target: Path, system: str, file: str, failure: Failure
) -> UnreadItem:
    return UnreadItem.from_parent(
        parent, name=_plain(f"{system}/{file}"), target=target, system=system, failure=failure
    )


def _plain(name: str) -> str:
    """Remove characters from a name that have a meaning in a test's id."""
    return name.replace("::", ":").replace("[", "(").replace("]", ")")


class CrosscheckItem(pytest.Item):
    """A case; or an audit, if `scenario` is unset.

    Attributes:
        target: the system folder, or the robot file.
        model: the sidecar, or the robot file; None if it can't be read.
        file: the model file; of a folder that can't be read, its declaration.
    """

    def __init__(
        self,
        *,
        target: Path,
        system: str,
        model: Sidecar | Path | None,
        engine: str,
        scenario: str | None,
        **rest: Any,
    ) -> None:
        super().__init__(**rest)
        self.target, self.model, self.file = target, model, model_path(model or self.path)
        self.system, self.engine, self.scenario = system, engine, scenario
        self._summary = ""
        self._where: SourceLine | None = None
        kind = {"model": self.file.name} if model else {}
        self.add_marker(
            pytest.mark.crosscheck(
                system=system, engine=engine, scenario=scenario or "audit", **kind
            )
        )
        for name in (system, engine):
            _mark(self, name)

    def setup(self) -> None:
        """Prepare the target, so that its time is not counted as the first case's."""
        if self.model and self._precondition(self.model) is None:
            self.config.stash[RUNNER].prepared(self.target)

    def runtest(self) -> None:
        """Run the test; `status_of` decides its result."""
        record = self.record()
        required = bool(setting_of(self.config, "require_engines"))
        decision = status_of(
            record,
            require_engines=required,
            demands=self._demands(record),
            judged_by=self._judged_by(record),
        )
        if isinstance(record, Case) and self.model:
            edit = self.config.stash[RUNNER].edit_of(record.id, self.target)
            if edit and decision.status is not TestStatus.FAIL:
                decision = Decision(TestStatus.FAIL, edit)
        if isinstance(record, Case):
            self.user_properties += [("case", str(record.id)), *properties(record).items()]
        codes = [record.code] if isinstance(record, Case) else [one.code for one in record.findings]
        self.user_properties += [("code", code) for code in dict.fromkeys(filter(None, codes))]
        if record.accepted:
            self.user_properties.append(("accepted", record.accepted))
        if decision.status is TestStatus.SKIP:
            skipped = pytest.skip.Exception(decision.reason)
            # Report the skip at the model file, not at this line.
            skipped._use_item_location = True
            raise skipped
        if decision.status is TestStatus.FAIL and not self._is_accepted(record):
            self._fail(record, decision)

    def _is_accepted(self, record: Case | Model) -> bool:
        """Return whether to accept the result; robot files and cases that did not run can't be."""
        if not self.config.getoption("crosscheck_accept") or not isinstance(self.model, Sidecar):
            return False
        if isinstance(record, Model):
            return not record.failures
        return record.outcome in (Outcome.DIFFERS, Outcome.UNRESOLVED)

    def _demands(self, record: Case | Model) -> list[str]:
        """Return the project's further requirements that this case does not meet."""
        demands: list[str] = []
        if isinstance(record, Case) and record.outcome is Outcome.AGREES:
            for sentences in self.ihook.pytest_crosscheck_case(record=record):
                demands += [sentences] if isinstance(sentences, str) else sentences or ()
        return demands

    def _judged_by(self, record: Case | Model) -> list[str]:
        """Return the engines that have a verdict on a robot file that this optional one rejects."""
        if not isinstance(record, Case) or record.outcome is not Outcome.REFUSED:
            return []
        return self.config.stash[RUNNER].judged_by(record.id, self.target)

    def _precondition(self, model: Sidecar | Path) -> CannotRun | None:
        """Return why it can't run; the audit of a robot file needs no engine."""
        if self.engine == NO_ENGINE:
            return None
        return self.config.stash[RUNNER].precondition(model, self.engine)

    def _fail(self, record: Case | Model, decision: Decision) -> None:
        """Fail with a message that names the cause."""
        diagnosis: Diagnosis | None = None
        if isinstance(record, Case) and record.outcome is Outcome.DIFFERS and self.model:
            diagnosis = self.config.stash[RUNNER].diagnosis(self.target, self.model, self.engine)
            self.user_properties.append(("cause", "; ".join(diagnosis_lines(diagnosis))))
            if diagnosis.explained:
                causes = diagnosis.explanations[0].causes
                self.user_properties += [("code", cause.code) for cause in causes]
        self._summary, self._where = in_brief(record, decision, diagnosis)
        cause, *more = failure_message(record, decision, diagnosis).splitlines()
        text = "\n".join([cause, *self._fixes(record, diagnosis), *more])
        pytest.fail(text, pytrace=False)

    def _fixes(self, record: Case | Model, diagnosis: Diagnosis | None) -> list[str]:
        """Return a line for each number to change, with its file and line."""
        model = record if isinstance(record, Model) else self._model(diagnosis=diagnosis)
        changes = dict.fromkeys(map(str, [*changes_of(model), *stated_changes(model)]))
        causes = diagnosis.explanations[0].causes if diagnosis and diagnosis.explained else ()
        texts = [*(f"change {change}" for change in changes), *advice_of(model, causes)]
        lines = visible_lines("\n".join(f"Fix: {text}" for text in texts))
        return lines[:MOST_FIXES]

    def _model(self, **fields: Any) -> Model:
        """Return the record of the model, without its texts."""
        return Model(
            system=self.system,
            model=self.file.name if self.model else "-",
            engine=self.engine,
            folder=str(self.target),
            text="",
            sidecar="",
            **fields,
        )

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the failure without a traceback, and one line for the short summary."""
        shown = super().repr_failure(excinfo, style)
        crash = getattr(shown, "reprcrash", None)
        if crash is not None and isinstance(excinfo.value, pytest.fail.Exception):
            path = self.reportinfo()[0]
            crash.path, crash.lineno = str(path), 1
            if self._where and self._where.line:
                crash.path, crash.lineno = str(path.parent / self._where.file), self._where.line
            crash.message = self._summary
        return shown

    def record(self) -> Case | Model:
        """Run the case or the audit; an audit that can't run is a failed case."""
        assert self.model is not None
        runner, target = self.config.stash[RUNNER], self.target
        case_id = CaseId(
            system=self.system,
            model=self.file.name,
            scenario=self.scenario or "-",
            engine=self.engine,
        )
        why = self._precondition(self.model)
        if why is not None:
            return skipped_case(case_id, str(target), why)
        if self.scenario is not None:
            return runner.case(case_id, target, self.model)
        audit = runner.audit(target, self.model, self.engine)
        if isinstance(audit, Failure):
            return failed_case(case_id, str(target), audit)
        model = self._model(audit=audit.findings, poses=audit.poses)
        return runner.marked(model, target)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return the model file, and the name as in `crosscheck run`."""
        if self.model is None:
            # Not the end of the id: pytest's -v would read a dot as a separator.
            return self.path, 0, self.name.replace("/", ": ", 1)
        name = f"{self.system}/{self.file.name}/{self.scenario or 'audit'}"
        return self.file, 0, name if self.engine == NO_ENGINE else f"{name} [{self.engine}]"


class UnreadItem(CrosscheckItem):
    """A target or model file that can't be read: a test that fails with the reason."""

    def __init__(self, *, failure: Failure, **rest: Any) -> None:
        super().__init__(model=None, engine=NO_ENGINE, scenario=None, **rest)
        self._failure = failure

    def record(self) -> Case:
        """Return the placeholder for its cases."""
        case_id = CaseId(system=self.system, model=self.path.name, scenario="-", engine=NO_ENGINE)
        return failed_case(case_id, str(self.target), self._failure)


def properties(case: Case) -> dict[str, str]:
    """Return the outcome and the numbers of a case by name, for a report.

    These include the largest numbers, which `figures` omits: those of the deciding component.
    """
    values = {"outcome": str(case.outcome), **figures(case)}
    if (worst := largest(case)) is not None:
        values["largest"] = f"{worst:.3e}"
    if steps := unsettled_steps(case):
        values["whole steps"] = steps
    return values


def _mark(item: pytest.Item, name: str) -> None:
    """Mark an item by a name, unless that marker has a meaning already, such as `skip`."""
    name = re.sub(r"\W", "_", name).lstrip("_")
    ours = item.config.stash.setdefault(OURS, set())
    if not name or name in WORDS:
        return
    if name not in ours:
        registered = item.config.getini("markers")
        if name in {re.split(r"[:(]", line)[0].strip() for line in registered}:
            return
        item.config.addinivalue_line("markers", f"{name}: cases of --crosscheck with {name}")
        ours.add(name)
    item.add_marker(name)
