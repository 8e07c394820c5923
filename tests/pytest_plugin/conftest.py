"""A user's project with system folders, and answers to give instead of running an engine."""

import shutil

import pytest

# Imported here: pytester forgets, after each run in this process, what that run imported first.
import harness.pytest_plugin.session
from harness.files.folders import builtin
from harness.pytest_plugin.runner import Laboratory

RECORD = {
    "outcome": "AGREES", "discrepancy": 1e-13, "uncertainty": 2e-12, "component": "x",
    "order": 0.99, "raw_error": 0.005, "shipped_step": 0.002, "reason": "", "printed": "",
}  # fmt: skip


class Project:
    """Builds system folders below `models/`, and runs pytest in the project."""

    def __init__(self, pytester):
        self._pytester = pytester
        self.path = pytester.path

    def add(self, name="msd", files=("mujoco.xml",), under="models", source="mass_spring_damper"):
        folder = self.path / under / name
        folder.mkdir(parents=True)
        for file in ("system.py", *(g for f in files for g in (f, f"{f}.toml"))):
            shutil.copy(builtin() / source / file, folder / file)
        return folder

    def edit(self, path, old, new):
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    def run(self, *arguments):
        return self._pytester.runpytest_inprocess("-p", "pytest_crosscheck", *arguments)

    def collected(self, *arguments):
        """Ids of the tests that would be run."""
        done = self.run("--collect-only", "-q", *arguments)
        return [line for line in done.outlines if "::" in line and " " not in line]


@pytest.fixture
def project(pytester):
    return Project(pytester)


@pytest.fixture
def answers(monkeypatch):
    """Records by scenario, given instead of running anything; what is not told agrees."""
    told = {}
    monkeypatch.setattr(Laboratory, "prepared", lambda *_: None)
    monkeypatch.setattr(Laboratory, "audit", lambda *_: {"audit": told.get("audit", [])})
    monkeypatch.setattr(
        Laboratory, "case", lambda _, named, *rest: named | RECORD | told.get(named["scenario"], {})
    )
    monkeypatch.setattr(Laboratory, "diagnosis", lambda *_: {"findings": [], "reason": "untold"})
    return told


assert harness.pytest_plugin.session  # its import is what counts
