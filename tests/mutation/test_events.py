"""Faults in numbers of contacts, friction and soft laws are caught and named."""

from functools import cache
from typing import Any

import pytest

from physics_crosscheck.harness.commands.mutation.mutate import faults_of, mutated
from physics_crosscheck.harness.commands.mutation.survey import PlantedFault
from physics_crosscheck.harness.records.mutation import FaultVerdict
from tests.mutation.conftest import make_task

pytestmark = pytest.mark.slow
"""A quick test of one fault in a law is in `tests/cases/test_events.py`."""


@pytest.fixture(autouse=True)
def _few_segments(few_segments: None) -> None:
    pass


@cache
def faults(system: str, model: str, engine: str) -> dict[tuple[str, str], PlantedFault[Any]]:
    every = faults_of(make_task(system, model, engine))
    return {(one.mistake.location, one.mistake.name): one for one in every}


def named(name: str) -> PlantedFault[Any]:
    landing = faults("events/soft_landing", "mujoco.xml", "mujoco")
    return next(fault for key, fault in landing.items() if name in key)


def test_error_of_a_millionth_in_a_contact_is_named() -> None:
    key = "default/geom@solref[0]", "1e-6"
    fault = faults("events/soft_landing", "mujoco.xml", "mujoco")[key]
    assert mutated(fault).verdict is FaultVerdict.NAMED


def test_added_friction_is_named() -> None:
    assert mutated(named("friction left in")).verdict is FaultVerdict.NAMED


def test_changed_time_step_agrees() -> None:
    row = mutated(named("another time step"))
    assert row.verdict is FaultVerdict.AGREES
    # The rigid motion would be off by the depth of the contact at every step.
    before, after = (float(part.split()[0]) for part in row.message.split("dt ")[1].split("-> "))
    assert after > 1.2 * before


def test_number_that_moves_an_event_out_of_its_segment_is_named() -> None:
    """Catch fits that begin at the present value, where slopes across events vanish."""
    fault = faults("events/ball_train", "space.py", "pymunk")["DIAMETER", "5 %"]
    assert mutated(fault).verdict is FaultVerdict.NAMED
