"""Faults in numbers of contacts, friction and soft laws are caught and named."""

from dataclasses import replace
from functools import cache

import pytest

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.commands.mutation.mistakes import Mistake
from physics_crosscheck.harness.commands.mutation.survey import FaultSurvey, survey
from physics_crosscheck.harness.records.mutation import FaultVerdict
from physics_crosscheck.records import Mutation
from tests.mutation.conftest import make_task, try_fault

pytestmark = pytest.mark.slow
"""A quick test of one fault in a law is in `tests/cases/test_events.py`."""


@pytest.fixture(autouse=True)
def _few_segments(few_segments: None) -> None:
    pass


@cache
def survey_task(system: str, model: str, engine: str) -> tuple[SystemTask, FaultSurvey]:
    task = make_task(system, model, engine)
    return task, survey(task)


def plant(fault: Mistake, task: SystemTask, surveyed: FaultSurvey) -> Mutation:
    return try_fault(task, replace(surveyed, faults=()), fault)


def test_error_of_a_millionth_in_a_contact_is_named() -> None:
    task, surveyed = survey_task("events/soft_landing", "mujoco.xml", "mujoco")
    key = "default/geom@solref[0]", "1e-6"
    (fault,) = (one for one in surveyed.faults if (one.location, one.name) == key)
    assert plant(fault, task, surveyed).verdict is FaultVerdict.NAMED


def test_added_friction_is_named() -> None:
    task, surveyed = survey_task("events/soft_landing", "mujoco.xml", "mujoco")
    fault = next(one for one in surveyed.faults if one.name == "friction left in")
    assert plant(fault, task, surveyed).verdict is FaultVerdict.NAMED


def test_changed_time_step_agrees() -> None:
    task, surveyed = survey_task("events/soft_landing", "mujoco.xml", "mujoco")
    fault = next(one for one in surveyed.faults if one.name == "another time step")
    row = plant(fault, task, surveyed)
    assert row.verdict is FaultVerdict.AGREES
    # The rigid motion would be off by the depth of the contact at every step.
    before, after = (float(part.split()[0]) for part in row.message.split("dt ")[1].split("-> "))
    assert after > 1.2 * before


def test_number_that_moves_an_event_out_of_its_segment_is_named() -> None:
    """Catch fits that begin at the present value, where slopes across events vanish."""
    task, surveyed = survey_task("events/ball_train", "space.py", "pymunk")
    fault = next(one for one in surveyed.faults if (one.location, one.name) == ("DIAMETER", "5 %"))
    assert plant(fault, task, surveyed).verdict is FaultVerdict.NAMED
