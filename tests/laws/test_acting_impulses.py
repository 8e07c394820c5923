"""Physical quantities computed from a URDF's numbers match PyBullet's motion."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.acting import merged, urdf_quantities
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.engines.protocol import WholeState
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.reference.laws import impulses
from tests.laws.scenes import URDF_ARM, URDF_BOX

pytest.importorskip("pybullet")

FREE = {**SETTINGS, **STANDALONE_SETTINGS, "gravity": [0, 0, 0]}


def spec_of(tmp_path: Path, text: str, *, floating: bool = False) -> ModelSpec:
    """Write a file, and return what PyBullet loads."""
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    return ModelSpec(file, settings={**FREE, "floating": floating})


def quantities(spec: ModelSpec) -> dict[tuple[str, str], float]:
    rows = urdf_quantities(spec, "pybullet")
    return {(row.subject, row.quantity): float(row.value or 0.0) for row in rows}


def test_coupled_rows_are_solved_in_few_sweeps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Catch sweeps over many coupled motors that take thousands, or stop at other impulses."""
    monkeypatch.setattr(impulses, "SWEEPS", 80)
    rng, n = np.random.default_rng(5), 30
    turns = np.linalg.qr(rng.normal(size=(n, n)))[0]
    response = turns @ np.diag(np.geomspace(1e-3, 1, n)) @ turns.T
    rows = impulses.ImpulseRows()
    for i in range(n):
        rows.add(np.eye(n)[i], float(rng.normal()), (-2.0, 2.0) if i % 3 else (-1e9, 1e9))
    solver = impulses._Sweeps(rows, response, np.zeros(n))
    change = solver.run(range(n), ())
    lacks = np.array(rows.targets) - response @ solver.impulses
    low, high = np.array(rows.bounds).T
    p = solver.impulses
    assert np.max(np.abs(lacks[(low < p) & (p < high)])) < 1e-12
    assert np.all(lacks[p == high] >= 0)
    assert np.all(lacks[p == low] <= 0)
    assert 0 < np.count_nonzero((p == low) | (p == high)) < n
    assert np.max(change) < 1e-9


def test_impulses_of_a_flat_foot_remain_the_engines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Catch impulses that change where they solve the rows: velocities depend on them."""
    free, weights = np.array([1, 0.3, -0.1, 0.02, 0.01, 2]), np.array([1, 1, 1, 0.3, 0.4, 0.5])

    def solved(starts: Sequence[float], first: int) -> list[float]:
        """Return the impulses at the corners of a box that slides and spins."""
        monkeypatch.setattr(impulses, "FIRST_SOLUTION", first)
        rows = impulses.ImpulseRows()
        for i, (x, y) in enumerate(product((1, -1), (0.7, -0.7))):
            jacobian = np.hstack([np.eye(3), np.cross(np.eye(3), [x, y, -0.5]).T])
            for along, start in zip((2, 0, 1), starts[3 * i :], strict=False):
                rows.add(jacobian[along], 0.0, (0.0, 1e9), guess=start)
            rows.cones.append(impulses.FrictionCone(3 * i, (3 * i + 1, 3 * i + 2), 0.2))
        whole = np.array(rows.jacobian)
        solver = impulses._Sweeps(rows, whole / weights @ whole.T, whole @ free)
        solver.run([0, 3, 6, 9], rows.cones)
        return list(solver.impulses)

    for starts in np.random.default_rng(1).uniform(0, 0.05, (3, 12)).tolist():
        by_sweeps = solved(starts, 10**9)
        assert solved(by_sweeps, 1) == pytest.approx(by_sweeps, abs=1e-12)


def test_friction_and_restitution_are_products(tmp_path: Path) -> None:
    """Catch friction that is the larger of two, a body without its rows, and lost restitution."""
    table = quantities(spec_of(tmp_path, URDF_BOX, floating=True))
    assert table["ground with body", "friction"] == pytest.approx(0.7)
    assert table["ground with wheel", "friction"] == pytest.approx(0.9)
    assert table["ground with body", "restitution"] == pytest.approx(0.6)
    assert table["ground with body", "rest depth"] == 1e-5
    assert ("ground with wheel", "rest depth") not in table  # on its spring
    assert not [key for key in quantities(spec_of(tmp_path, URDF_ARM)) if "ground" in key[0]]


def test_fixed_root_meets_the_floor_of_a_setting() -> None:
    """Catch lost rows of a floor, and a link without a shape that has some."""
    file = Path(__file__).parents[2] / "models" / "events" / "stopping_block" / "robot.urdf"
    spec = ModelSpec(file, settings={**SETTINGS, "floor": True})
    table = quantities(spec)
    assert table["ground with block", "friction"] == pytest.approx(0.3)
    assert {one for one, _ in table if "ground" in one} == {"ground with block"}
    assert not [one for one, _ in quantities(ModelSpec(file, settings=SETTINGS)) if "ground" in one]


def test_motor_approaches_its_target_with_its_time_constant(tmp_path: Path) -> None:
    """Catch a gain that is not per step, or a step of another size."""
    spec = spec_of(tmp_path, URDF_ARM.replace('effort="7"', 'effort="1e6"'))
    model, table = engines()["pybullet"].load_whole(spec), quantities(spec)
    assert model is not None
    state = WholeState(np.array([0.1, 0.1]), np.zeros(2), np.zeros(2), np.zeros(0))
    count = 10
    moved = model.moved(model.moved(state, 1), count)
    first = model.moved(state, 1)
    time = count * model.step / np.log(first.z[0] / moved.z[0])
    assert table["drive of shoulder", "time constant"] == pytest.approx(time, rel=1e-3)


def test_loading_another_file_changes_no_step(tmp_path: Path) -> None:
    """Catch steps of the body that has taken the place of a loaded one, or without its floor."""
    (tmp_path / "other").mkdir()
    pybullet, spec = engines()["pybullet"], spec_of(tmp_path, URDF_BOX, floating=True)
    model = pybullet.load_whole(replace(spec, settings={**spec.settings, "gravity": [0, 0, -9.81]}))
    assert model is not None
    z, m = np.zeros((2, len(model.coordinates)))
    state = WholeState(z, m, np.full(model.controls, np.nan), np.zeros(0))
    before = model.moved(state, 400)
    assert -0.1 < before.z[2] < -1e-6
    pybullet.load(spec_of(tmp_path / "other", URDF_ARM))
    after = model.moved(state, 400)
    assert np.array_equal(after.z, before.z)
    assert np.array_equal(after.m, before.m)


def test_limit_rebounds_at_most_by_its_share(tmp_path: Path) -> None:
    """Catch a rebound that the engine exceeds, or never comes near to."""
    spec = spec_of(tmp_path, URDF_ARM)
    model, table = engines()["pybullet"].load_whole(spec), quantities(spec)
    assert model is not None
    bound = table["limits of shoulder", "rebound"]
    rebounds = []
    for phase in np.linspace(0.02, 0.98, 25):
        z = np.array([0.7 - 0.5 * phase * model.step, 0.0])
        state = WholeState(z, np.array([0.5, 0.0]), np.full(2, np.nan), np.zeros(0))
        after = model.moved(state, 30)
        momentum = -after.m[0] / 0.5
        rebounds.append(momentum)
    assert max(rebounds) < bound
    assert max(rebounds) > bound / 2


def test_equal_rows_are_one_line(tmp_path: Path) -> None:
    """Catch a list of one line for each joint."""
    rows = urdf_quantities(spec_of(tmp_path, URDF_ARM), "pybullet")
    lines = [row for row in merged(rows) if row.quantity == "time constant"]
    assert [row.subject for row in lines] == ["limits of shoulder", "drive of shoulder, elbow"]
