"""Requirements of this project for its own models, beyond agreement.

The validation itself is `pytest --crosscheck models --crosscheck-thorough`: every built-in model in
every engine and scenario, with all checks. `make test` runs half of them, without `--thorough`.
"""

from __future__ import annotations

import signal
from collections.abc import Container, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from physics_crosscheck.harness.jobs.environment import claim_defaults

if TYPE_CHECKING:
    from physics_crosscheck.records import Case, FullRun, Verdict

# Here too where the package is not installed.
pytest_plugins = ["physics_crosscheck.pytest_plugin"]

# Before anything imports numpy: each core has a worker of pytest.
claim_defaults()

# A shell's background job ignores Ctrl-C, and so would runs that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

MAX_DISCREPANCY = 1e-10

HELD = {("mujoco_rolling.xml", "mujoco"), ("robot.urdf", "pybullet")}
"""Model files and engines in which a constraint holds the drum to the ground."""


def pytest_crosscheck_case(record: Case) -> list[str]:
    """Require ten digits, the claimed orders, right time steps, energy and constraints."""
    assert record.verdict is not None
    if Path(record.folder).parent.name == "events":  # nine digits, by its verdict; no full runs yet
        return []
    assert record.full_run is not None
    skipped = {one.check for one in record.skipped}
    return [
        *_digits(record.verdict),
        *_orders(record.verdict, record.full_run, skipped),
        *(() if "predicted time step" in skipped else _steps(record, record.full_run)),
        *_physics(record, record.full_run),
    ]


def _digits(verdict: Verdict) -> Iterator[str]:
    for name, value in (
        ("discrepancy", verdict.discrepancy),
        ("uncertainty", verdict.uncertainty),
    ):
        if value is None or value > MAX_DISCREPANCY:
            yield f"its {name} is {_format(value)}, above {MAX_DISCREPANCY:.0e}"


def _orders(verdict: Verdict, run: FullRun, skipped: Container[str]) -> Iterator[str]:
    claimed = verdict.claimed_order
    if run.order is None or not run.order > claimed - 0.3:
        yield f"full runs have order {_format(run.order)}, {claimed} is claimed"
    if "segments" in skipped:
        return
    if verdict.order is None or not abs(verdict.order - claimed) < 0.3:
        yield f"the segments' order is {_format(verdict.order)}, {claimed} is claimed"


def _steps(case: Case, run: FullRun) -> Iterator[str]:
    checked = run.checked_step
    # Chaotic motions have no such step, and long ones are not run.
    if checked is None:
        if case.system != "drum_pendulum" and case.scenario != "large":
            yield "no time step was predicted and run"
        return
    share = None if checked.measured is None else checked.measured / checked.target
    if share is None or not 0.3 < share < 1.3:
        yield f"the step predicted for {checked.target:g} gave {_format(checked.measured)}"


def _physics(case: Case, run: FullRun) -> Iterator[str]:
    energy, drift = run.energy_error, run.constraint_drift
    if energy is None or not energy < 0.2:
        yield f"energy is out of balance by {_format(energy)}"
    if drift is None or not drift < 0.05:
        yield f"constraints drift by {_format(drift)}"
    rolls = case.system == "drum_pendulum" and (case.model, case.engine) in HELD
    if rolls and not drift:
        yield "the drum is not held by a constraint"


def _format(value: float | None) -> str:
    return "not finite" if value is None else f"{value:.2g}"
