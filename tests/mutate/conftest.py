"""Built-in models in one engine, cheap: two scenarios, few segments."""

from dataclasses import replace
from functools import cache

import pytest

from harness.bindings import bindings
from harness.case import load
from harness.diagnosis.inquiry import InquiryTask
from harness.engines import engines
from harness.folders import builtin
from harness.mutation.mistakes import Subject
from harness.mutation.mutate import MutationTask, mutated, survey
from harness.prepare import prepare
from harness.sidecar import read_sidecar

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
    return InquiryTask(p.system, sidecar, engine, motions, p.scales, p.variants)


def subject(system, model, engine="mujoco", sidecar=None):
    task = inquiry(system, model, engine, sidecar)
    loaded, coordinates = load(task.system, task.sidecar, engine)
    return Subject(task, loaded, coordinates, bindings(task.system, task.sidecar))


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr("harness.diagnosis.evidence.SEGMENTS_PICKED", 8)


def rows(task, chosen):
    """What became of the faults that `chosen` picks."""
    known = survey(task)
    alone = replace(known, faults=())
    return [mutated(MutationTask(task, alone, fault)) for fault in filter(chosen, known.faults)]
