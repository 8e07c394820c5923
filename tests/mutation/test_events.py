"""Faults in numbers of contacts, friction and soft laws are caught and named by motions."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.commands.mutation.mistakes import Mistake
from physics_crosscheck.harness.commands.mutation.survey import FaultSurvey, survey
from physics_crosscheck.harness.records.mutation import FaultVerdict, Mutation
from tests.mutation.conftest import sound, tried

pytestmark = pytest.mark.slow
"""A fault in a law of a motion with events is named quickly in `tests/cases/test_events.py`."""


@pytest.fixture(autouse=True)
def _few(few: None) -> None:
    pass


@cache
def surveyed(system: str, model: str, engine: str) -> tuple[SystemTask, FaultSurvey]:
    """A task and its faults, which several tests plant."""
    task = sound(system, model, engine)
    return task, survey(task)


def planted(fault: Mistake, task: SystemTask, known: FaultSurvey) -> Mutation:
    return tried(task, replace(known, faults=()), fault)


def test_a_millionth_of_a_contact_is_named() -> None:
    task, known = surveyed("events/soft_landing", "mujoco.xml", "mujoco")
    key = "default/geom@solref[0]", "1e-6"
    (fault,) = (one for one in known.faults if (one.location, one.name) == key)
    assert planted(fault, task, known).verdict is FaultVerdict.NAMED


def test_friction_that_a_folder_with_contacts_lacks_is_named() -> None:
    task, known = surveyed("events/soft_landing", "mujoco.xml", "mujoco")
    fault = next(one for one in known.faults if one.name == "friction left in")
    assert planted(fault, task, known).verdict is FaultVerdict.NAMED


def test_another_step_agrees_by_the_law_of_the_engine() -> None:
    task, known = surveyed("events/soft_landing", "mujoco.xml", "mujoco")
    fault = next(one for one in known.faults if one.name == "another time step")
    row = planted(fault, task, known)
    assert row.verdict is FaultVerdict.AGREES
    # The rigid motion would be off by the depth of the contact at every step.
    before, after = (float(part.split()[0]) for part in row.message.split("dt ")[1].split("-> "))
    assert after > 1.2 * before


def test_a_number_that_moves_an_event_out_of_its_segment_is_named() -> None:
    """Catch fits that begin at the present value, where slopes across events vanish."""
    task, known = surveyed("events/ball_train", "space.py", "pymunk")
    fault = next(one for one in known.faults if (one.location, one.name) == ("DIAMETER", "5 %"))
    assert planted(fault, task, known).verdict is FaultVerdict.NAMED
