"""Built-in models in one engine, with two scenarios and few segments."""

from collections.abc import Callable

import pytest

from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.commands.mutation.mistakes import Mistake, Subject
from physics_crosscheck.harness.commands.mutation.mutate import faults_of, mutated
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import bindings
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.records import Mutation
from tests.physics import physics

SCENARIOS = 2
"""The first two scenarios: one is free, one is forced."""


def make_task(
    system: str, model: str, engine: str = "mujoco", sidecar: Sidecar | None = None
) -> SystemTask:
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    p = physics(system)
    sidecar = sidecar or read_sidecar(builtin() / system / f"{model}.toml")
    motions = dict(list(p.motions.items())[:SCENARIOS])
    return model_task(p, engine, sidecar).with_target(motions=motions)


def subject(
    system: str, model: str, engine: str = "mujoco", sidecar: Sidecar | None = None
) -> Subject:
    task = make_task(system, model, engine, sidecar)
    literals = bindings(task.target.system, task.declared)
    return Subject(task, *task.load(), literals)


@pytest.fixture
def few_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.diagnosis.samples.SEGMENTS_PICKED", 8)


def rows(task: SystemTask, chosen: Callable[[Mistake], bool]) -> list[Mutation]:
    """Return the outcomes of the faults that `chosen` selects."""
    return [mutated(fault) for fault in faults_of(task) if chosen(fault.mistake)]
