"""A repository with one accepted built-in system, and how users edit, gate and accept it."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.commands.gate.accept import Acceptance, accept
from physics_crosscheck.harness.commands.gate.gate import gate
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.run import Options
from tests.standing import keep_default_engines, shorten_scenarios, without

SYSTEM = "mass_spring_damper"


def ignore_progress(*_: object) -> None:
    """Ignore progress."""


@dataclass(frozen=True)
class Repository:
    """A working directory with `models/` and an accepted baseline."""

    root: Path

    @property
    def folder(self) -> Path:
        return self.root / "models" / SYSTEM

    @property
    def baseline(self) -> Path:
        return self.root / "reports" / "baseline"

    @property
    def file(self) -> Path:
        return self.baseline / f"{SYSTEM}.json"

    def edit(self, name: str, old: str, new: str, count: int = 1) -> None:
        path = self.folder / name
        text = path.read_text()
        assert text.count(old) >= 1, (name, old)
        path.write_text(text.replace(old, new, count))

    def gate(self, *engines: str, **options: Any) -> GateResult:
        folders = sorted(path.parent for path in self.root.glob("models/*/system.py"))
        wanted = Options(baseline=self.baseline, engines=engines, jobs=1, **options)
        return gate(folders, wanted, ignore_progress)

    def accept(self, reason: str, *patterns: str, result: GateResult | None = None) -> Acceptance:
        return accept(result or self.gate(), patterns, reason, self.baseline)


@pytest.fixture(scope="session")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Repository:
    """Create a repository with an accepted baseline, which no test changes."""
    repository = Repository(tmp_path_factory.mktemp("pristine"))
    shutil.copytree(
        builtin() / SYSTEM, repository.folder, ignore=shutil.ignore_patterns("__pycache__")
    )
    keep_default_engines(repository.folder)
    without(repository.folder, "step")
    shorten_scenarios(repository.folder, 8)
    repository.accept("first baseline")
    return repository


@pytest.fixture
def repository(pristine: Repository, tmp_path: Path) -> Repository:
    return copy_of(pristine, tmp_path / "repository")


def copy_of(repository: Repository, root: Path) -> Repository:
    shutil.copytree(repository.root, root)
    return replace(repository, root=root)


@pytest.fixture(scope="session")
def damped(
    pristine: Repository, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Repository, GateResult]:
    """Gate a copy with another damper in `space.py`, which no test changes."""
    repository = copy_of(pristine, tmp_path_factory.mktemp("damped") / "repository")
    repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.91 ")
    return repository, repository.gate("pymunk")
