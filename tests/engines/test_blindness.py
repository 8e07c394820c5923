"""Engine code never sees the constants of system.py."""

import ast
import dataclasses
import math
from pathlib import Path

import pytest

import harness.cases.case
from harness.cases.case import CaseTask, run_case
from harness.cases.prepare import prepare
from harness.engines.registry import engines
from harness.files.model_files import model_files

ROOT = Path(__file__).parents[2]
ADAPTERS = sorted((ROOT / "harness" / "engines").glob("*.py"))
BENEATH = [ROOT / "harness" / "engine.py", ROOT / "harness" / "urdf.py"]
SYSTEMS = ("mass_spring_damper", "drum_pendulum")


@pytest.mark.parametrize("path", [*ADAPTERS, *BENEATH], ids=lambda p: p.name)
def test_no_adapter_imports_the_reference_or_what_holds_a_system(path):
    allowed = {"harness.engines.protocol", "harness.engines.registry", "harness.engines.urdf"}
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import hides what it takes"
            names = [node.module]
        for name in names:
            assert not name.startswith("reference"), f"{path.name} imports {name}"
            if name.startswith("harness"):
                assert ".".join(name.split(".")[:2]) in allowed, f"{path.name} imports {name}"


class Poisoning:
    """An engine whose every call finds NaN in place of the system's constants."""

    def __init__(self, engine, constants):
        self._engine, self._constants, self.calls = engine, constants, 0

    def load(self, spec):
        return _PoisonedModel(self, self.poisoned(self._engine.load, spec))

    def poisoned(self, function, *arguments):
        kept = [c.value for c in self._constants]
        self.calls += 1
        for c in self._constants:
            object.__setattr__(c, "value", math.nan)
        try:
            return function(*arguments)
        finally:
            for c, value in zip(self._constants, kept, strict=True):
                object.__setattr__(c, "value", value)


class _PoisonedModel:
    def __init__(self, poisoning, model):
        self._poisoning, self._model = poisoning, model

    def __getattr__(self, name):
        return getattr(self._model, name)

    def rollout(self, *arguments):
        return self._poisoning.poisoned(self._model.rollout, *arguments)


def tasks(name):
    """One case of every model file and engine of a built-in system."""
    prepared = prepare(ROOT / "models" / name)
    scenario = prepared.system.scenarios[-1].name
    for sidecar in model_files(prepared.folder):
        for engine in sidecar.engines:
            yield CaseTask(
                prepared.system,
                sidecar,
                engine,
                scenario,
                prepared.motions[scenario],
                prepared.scales[scenario],
                prepared.amplitude,
                prepared.power,
                prepared.components,
                1e-9,
            )


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_case_with_poisoned_constants_comes_out_the_same(name, monkeypatch):
    for task in tasks(name):
        pytest.importorskip(task.engine)
        shorter = dataclasses.replace(task, resolution=1e-6)
        plain = run_case(shorter)
        poisoning = Poisoning(engines()[task.engine], task.system.constants)
        monkeypatch.setattr(
            harness.cases.case, "engines", lambda p=poisoning, e=task.engine: {e: p}
        )
        poisoned = run_case(shorter)
        monkeypatch.undo()
        assert poisoning.calls > 5
        for record in (plain, poisoned):
            del record["seconds"], record["series"]["plain"]["seconds"]
        assert poisoned == plain
