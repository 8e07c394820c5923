"""Checks of the built-in models beyond their verdicts (`pytest --crosscheck models`)."""

import itertools
from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.case import CheckedStep
from physics_crosscheck.records import Case
from tests.physics import physics
from tests.records.made import case, full_run, verdict

FOLDERS = sorted(path.parent for path in builtin().glob("*/system.py"))

SIX = {
    "anchored_pair", "drum_pendulum", "free_pair", "mass_spring_damper", "simple_pendulum",
    "torsional_disc",
}  # fmt: skip
"""Systems that have a model in every engine and format. Other systems may have fewer."""


def sidecars(folder: Path) -> list[Sidecar]:
    return [one for one in model_files(folder) if isinstance(one, Sidecar)]


def test_all_six_systems_run_in_all_four_pairings() -> None:
    pairings = {("mujoco", ".xml"), ("mujoco", ".urdf"), ("pybullet", ".urdf"), ("pymunk", ".py")}
    seen = {
        (folder.name, engine, sidecar.model.suffix)
        for folder in FOLDERS
        for sidecar in sidecars(folder)
        for engine in sidecar.engines
        if folder.name in SIX and not engines()[engine].extra
    }
    assert seen == {(name, *pairing) for name, pairing in itertools.product(SIX, pairings)}


def test_make_target_runs_builtin_models_with_required_engines() -> None:
    text = (Path(__file__).parents[2] / "Makefile").read_text()
    lines = text.replace("\\\n", "").splitlines()
    assert any("--crosscheck models" in line and "--require-engines" in line for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drum_pendulum", "free_pair"])
def test_engine_linearizations_match_the_equations(name: str) -> None:
    """Catch a wrong matrix about each equilibrium, with gears, and with springs of sidecars."""
    folder, prepared = builtin() / name, physics(name)
    registered = engines()
    for sidecar in sidecars(folder):
        for engine in sidecar.engines:
            if registered[engine].version() is None:
                pytest.skip(f"{engine} is not installed")
            results = run_linearizations(model_task(prepared, engine, sidecar))
            assert len(results) == len(prepared.equilibria)
            for result in results:
                assert result.a_error is not None
                assert result.a_error <= 1e-8
                assert result.b_error is not None
                assert result.b_error <= 1e-8
                assert result.transfer_error is not None
                assert result.transfer_error <= 1e-6
                assert result.mode_similarity is not None
                assert result.mode_similarity > 1 - 1e-9


TOO_LARGE = CheckedStep(target=0.001, step=1e-4, measured=0.002)


@pytest.mark.parametrize(("fault", "count"), [
    (case(), 0),
    (case(verdict=verdict(discrepancy=2e-10)), 1),
    (case(verdict=verdict(uncertainty=2e-10)), 1),
    (case(verdict=verdict(order=1.4)), 1),
    (case(verdict=verdict(order=None)), 1),
    (case(full_run=full_run(order=0.6)), 1),
    (case(full_run=full_run(order=None)), 1),
    (case(full_run=full_run(checked_step=None)), 1),
    (case(full_run=full_run(checked_step=TOO_LARGE)), 1),
    (case(full_run=full_run(energy_error=0.3)), 1),
    (case(full_run=full_run(constraint_drift=0.1)), 1),
    (case(system="drum_pendulum", model="mujoco_rolling.xml"), 1),
])  # fmt: skip
def test_builtin_models_have_stricter_demands(
    pytestconfig: pytest.Config, fault: Case, count: int
) -> None:
    (demands,) = pytestconfig.hook.pytest_crosscheck_case(record=fault)
    assert len(demands) == count
