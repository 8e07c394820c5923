"""Built-in models in one engine, cheap: two scenarios, few segments."""

from dataclasses import replace
from functools import cache

import pytest

from harness.cases.case import load
from harness.cases.prepare import prepare
from harness.diagnosis.task import DiagnosisTask
from harness.engines.registry import engines
from harness.files.bindings import bindings
from harness.files.folders import builtin
from harness.files.sidecar import read_sidecar
from harness.mutation.mistakes import Subject
from harness.mutation.mutate import MutationTask, mutated, survey

SCENARIOS = 2
"""The first two: one is free, one is forced."""


@cache
def physics(name):
    return prepare(builtin() / name)


def inquiry(system, model, engine="mujoco", sidecar=None):
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    p = physics(system)
    sidecar = sidecar or read_sidecar(builtin() / system / f"{model}.toml")
    motions = dict(list(p.motions.items())[:SCENARIOS])
    return DiagnosisTask(p.system, sidecar, engine, motions, p.scales, p.variants)


def subject(system, model, engine="mujoco", sidecar=None):
    task = inquiry(system, model, engine, sidecar)
    loaded, coordinates = load(task.system, task.sidecar, engine)
    return Subject(task, loaded, coordinates, bindings(task.system, task.sidecar))


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr("harness.diagnosis.samples.SEGMENTS_PICKED", 8)


def rows(task, chosen):
    """What became of the faults that `chosen` picks."""
    known = survey(task)
    alone = replace(known, faults=())
    return [mutated(MutationTask(task, alone, fault)) for fault in filter(chosen, known.faults)]
