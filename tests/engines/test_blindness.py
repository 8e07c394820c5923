"""Engine code never sees the constants of system.py."""

import ast
import dataclasses
import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import pytest

import physics_crosscheck.harness.checks.task
from physics_crosscheck import Constant
from physics_crosscheck.engine import Engine, ModelSpec
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.records import Case
from tests.engines.extras import EXTRAS
from tests.standing import shorten_scenarios

ROOT = Path(__file__).parents[2]
HOME = ROOT / "harness" / "engines"
PACKAGE = "physics_crosscheck.harness.engines"
ALLOWED = (
    PACKAGE,
    "physics_crosscheck.harness.documents",
    "physics_crosscheck.reference.mechanism.bodies",
    "physics_crosscheck.reference.mechanism.laws",
    "physics_crosscheck.reference.mechanism.planar",
    "physics_crosscheck.reference.mechanism.rotations",
    "physics_crosscheck.reference.mechanism.tree",
)
ADAPTERS = sorted(HOME.rglob("*.py"))
SYSTEM = "drum_pendulum"
"""A system with models of every format, in every engine."""


@pytest.mark.parametrize("path", ADAPTERS, ids=lambda p: p.relative_to(HOME).as_posix())
def test_adapters_do_not_import_equations_or_systems(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            inside = len(path.relative_to(HOME).parts)
            assert node.level <= inside, f"{path}: a relative import leaves the engines"
            names = [node.module or ""]
        for name in names:
            if name.startswith("physics_crosscheck"):
                assert name.startswith(ALLOWED), f"{path.name} imports {name}"


class Poisoning:
    """An engine that sees NaN instead of the system's constants in every call."""

    def __init__(self, engine: Engine, constants: Sequence[Constant]) -> None:
        self._engine, self._constants, self.calls = engine, constants, 0

    def load(self, spec: ModelSpec) -> Any:
        return _PoisonedModel(self, self.poisoned(self._engine.load, spec))

    def poisoned(self, function: Callable[..., Any], *arguments: Any) -> Any:
        values = [c.value for c in self._constants]
        self.calls += 1
        for c in self._constants:
            object.__setattr__(c, "value", math.nan)
        try:
            return function(*arguments)
        finally:
            for c, value in zip(self._constants, values, strict=True):
                object.__setattr__(c, "value", value)


class _PoisonedModel:
    def __init__(self, poisoning: Poisoning, model: Any) -> None:
        self._poisoning, self._model = poisoning, model

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name)

    def rollout(self, *arguments: Any) -> Any:
        return self._poisoning.poisoned(self._model.rollout, *arguments)


def tasks(folder: Path) -> Iterator[SystemTask]:
    """Yield one case of every engine of a system's folder."""
    tried = set[str]()
    prepared = prepare_system(folder, described=False)
    scenario = prepared.system.scenarios[-1].name
    for sidecar in model_files(prepared.place):
        assert isinstance(sidecar, Sidecar)
        for engine in sidecar.engines:
            if engine in tried or (engines()[engine].extra and engine not in EXTRAS):
                continue  # these engines compile for minutes
            tried.add(engine)
            yield model_task(prepared, engine, sidecar, scenario=scenario)


def without_times(case: Case) -> Case:
    assert case.series is not None
    runs = msgspec.structs.replace(
        case.series.full_runs, seconds=(None,) * len(case.series.full_runs.h)
    )
    series = msgspec.structs.replace(case.series, full_runs=runs)
    return msgspec.structs.replace(case, seconds=0.0, series=series)


@pytest.mark.slow
def test_poisoned_constants_do_not_change_a_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / SYSTEM
    shutil.copytree(builtin() / SYSTEM, folder, ignore=shutil.ignore_patterns("__pycache__"))
    shorten_scenarios(folder, 16)
    for task in tasks(folder):
        assert engines()[task.engine].version() is not None
        shorter = dataclasses.replace(task, resolution=1e-6, thorough=True)
        plain = run_case(shorter)
        poisoning = Poisoning(engines()[task.engine], task.target.system.constants)
        monkeypatch.setattr(
            physics_crosscheck.harness.checks.task,
            "engines",
            lambda p=poisoning, e=task.engine: {e: p},
        )
        poisoned = run_case(shorter)
        monkeypatch.undo()
        assert poisoning.calls > 5
        assert without_times(poisoned) == without_times(plain)
