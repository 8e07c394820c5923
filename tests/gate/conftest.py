"""A repository with one built-in system, accepted as it is; and what a person does to it."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from harness.files.folders import builtin
from harness.gate.accept import accept
from harness.gate.gate import GateOptions, gate

SYSTEM = "mass_spring_damper"


def nothing(*_):
    """Progress that nobody watches."""


@dataclass(frozen=True)
class Repository:
    """A working directory with `models/` and an accepted baseline."""

    root: Path

    @property
    def folder(self):
        return self.root / "models" / SYSTEM

    @property
    def baseline(self):
        return self.root / "reports" / "baseline"

    @property
    def file(self):
        return self.baseline / f"{SYSTEM}.json"

    def edit(self, name, old, new, count=1):
        path = self.folder / name
        text = path.read_text()
        assert text.count(old) >= 1, (name, old)
        path.write_text(text.replace(old, new, count))

    def gate(self, *engines, **terms):
        folders = sorted(path.parent for path in self.root.glob("models/*/system.py"))
        return gate(folders, GateOptions(self.baseline, engines, jobs=2, **terms), nothing)

    def accept(self, reason, *patterns, found=None):
        return accept(found or self.gate(), patterns, reason, self.baseline, 1e-9)


@pytest.fixture(scope="session")
def pristine(tmp_path_factory):
    """Made once: nobody changes this one."""
    repository = Repository(tmp_path_factory.mktemp("pristine"))
    shutil.copytree(
        builtin() / SYSTEM, repository.folder, ignore=shutil.ignore_patterns("__pycache__")
    )
    repository.accept("first baseline")
    return repository


@pytest.fixture
def repository(pristine, tmp_path):
    """A copy of it to change."""
    shutil.copytree(pristine.root, tmp_path / "repository")
    return replace(pristine, root=tmp_path / "repository")
