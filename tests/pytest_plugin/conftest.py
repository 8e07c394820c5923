"""A user's project with system folders, and fake results instead of engine runs."""

import importlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.interfaces.pytest_plugin import session
from physics_crosscheck.harness.interfaces.pytest_plugin.runner import CaseRunner
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.poses import Poses
from physics_crosscheck.harness.records.survey import Audit
from physics_crosscheck.records import AuditFinding, Case, CaseId, Diagnosis
from tests.records.made import case
from tests.standing import keep_default_engines, shorten_scenarios

# pytester forgets modules that a run imports, but these can be loaded only once in a process.
for name in ("numpy", "scipy.linalg", "mujoco"):
    importlib.import_module(name)


class Project:
    """A project that creates system folders below `models/` and runs pytest."""

    def __init__(self, pytester: pytest.Pytester) -> None:
        self._pytester = pytester
        self.path = pytester.path

    def add(
        self,
        name: str = "msd",
        files: Sequence[str] = ("mujoco.xml",),
        under: str = "models",
        source: str = "mass_spring_damper",
    ) -> Path:
        folder = self.path / under / name
        folder.mkdir(parents=True)
        for file in ("system.py", *(g for f in files for g in (f, f"{f}.toml"))):
            shutil.copy(builtin() / source / file, folder / file)
        keep_default_engines(folder)
        shorten_scenarios(folder)
        return folder

    def edit(self, path: Path, old: str, new: str) -> None:
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    def run(self, *arguments: str) -> pytest.RunResult:
        return self._pytester.runpytest_inprocess(
            "-p", "physics_crosscheck.pytest_plugin", *arguments
        )

    def collect(self, *arguments: str) -> list[str]:
        done = self.run("--collect-only", "-q", *arguments)
        return [line for line in done.outlines if "::" in line and " " not in line]


@pytest.fixture
def project(pytester: pytest.Pytester) -> Project:
    return Project(pytester)


@dataclass
class FakeResults:
    """Results that replace engine runs: cases by scenario, which agree by default, and an audit."""

    cases: dict[str, dict[str, Any]] = field(default_factory=dict)
    audit: tuple[AuditFinding, ...] = ()

    def case(self, _: CaseRunner, case_id: CaseId, *rest: object) -> Case:
        names: dict[str, Any] = {name: getattr(case_id, name) for name in case_id.__struct_fields__}
        return case(**names | self.cases.get(case_id.scenario, {}))


@pytest.fixture
def fake_results(monkeypatch: pytest.MonkeyPatch) -> FakeResults:
    fakes = FakeResults()
    monkeypatch.setattr(CaseRunner, "prepared", lambda *_: None)
    monkeypatch.setattr(CaseRunner, "audit", lambda *_: Audit(findings=fakes.audit, poses=Poses()))
    # As a method of the runner, the lambda passes the runner as the next argument.
    monkeypatch.setattr(CaseRunner, "case", lambda *given: fakes.case(*given))
    monkeypatch.setattr(CaseRunner, "diagnosis", lambda *_: Diagnosis(failure="untold"))
    return fakes


assert session  # pytester unloads modules that a run in this process imported first
