"""The protocol of engines: its types, and engines of third parties."""

import math
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.ladder import RUNGS, limits
from tests.engines.extras import need
from tests.engines.protocol_models import (
    GRAVITY,
    LENGTH,
    MASS,
    PAIRINGS,
    STEP,
    Loaded,
    Pairing,
    Values,
    matrices,
)

LINEAR = ("free mass", "oscillator", "pair")
CAN_SWING = [p for p in PAIRINGS if p.format != "python"]


def installed(pairing: Pairing) -> Pairing:
    """Return the pairing, or skip with what is missing."""
    need(pairing.engine)
    return pairing


@pytest.fixture(params=PAIRINGS, ids=str)
def pairing(request: pytest.FixtureRequest) -> Pairing:
    """Return every pairing whose engine is installed."""
    return installed(request.param)


@pytest.fixture
def pair(pairing: Pairing, tmp_path: Path) -> Loaded:
    return pairing.load("pair", tmp_path)


def test_coordinates_are_named_and_ordered_as_in_the_file(pairing: Pairing, pair: Loaded) -> None:
    names = pair.model.coordinates
    assert pair.model.step == STEP
    if pairing.format == "python":
        assert names == ("b0.x", "b0.y", "b0.angle", "b1.x", "b1.y", "b1.angle")
    else:
        assert names == ("q1", "q2")
    # The order holds for values too: the second start gives the second end.
    zs, ws = pair.run([[0.0, 0.2]], [[0.0, 0.3]], 1e-4, 1)
    assert zs[0, 0] == pytest.approx([0.0, 0.2], abs=1e-3)
    assert ws[0, 0] == pytest.approx([0.0, 0.3], abs=1e-2)


@pytest.mark.parametrize(("h", "n"), [(1.0, 400), (0.005, 2000)])
def test_step_too_large_for_a_spring_blows_up_and_changes_no_later_motion(
    pairing: Pairing, tmp_path: Path, h: float, n: int
) -> None:
    loaded = pairing.load("stiff", tmp_path)
    start = [[0.1]], [[0.2]], 0.0001, 7
    before = loaded.run(*start)
    zs, ws = loaded.run([[0.1], [0.2]], [[0.0], [1.0]], h, n)
    assert not np.isfinite(zs).all(axis=2).any()
    assert zs.shape == ws.shape == (2, 1, 1)
    np.testing.assert_array_equal(loaded.run(*start), before)
    assert np.isfinite(before).all()


def test_force_held_for_one_step_adds_its_impulse(pairing: Pairing, tmp_path: Path) -> None:
    loaded = pairing.load("free mass", tmp_path)
    for h in (0.01, 0.003):
        _, ws = loaded.run([[0.0]], [[0.5]], h, 1, np.full((1, 1, 1), 7.0))
        assert ws[0, 0, 0] == pytest.approx(0.5 + h * 7.0 / MASS, rel=1e-12)


@pytest.mark.parametrize("step", [0, 3, 5])
def test_force_of_a_step_acts_only_in_that_step(
    pairing: Pairing, tmp_path: Path, step: int
) -> None:
    loaded = pairing.load("free mass", tmp_path)
    force = np.zeros((1, 6, 1))
    force[0, step] = 7.0
    _, ws = loaded.run([[0.0]], [[0.0]], 0.01, 6, force, every=1)
    expected = np.where(np.arange(6) >= step, 0.01 * 7.0 / MASS, 0.0)
    assert ws[0, :, 0] == pytest.approx(expected, rel=1e-12, abs=1e-300)


def test_force_on_one_coordinate_does_not_act_on_the_other(pair: Loaded) -> None:
    force = np.zeros((1, 1, 2))
    force[0, 0, 1] = 2.0
    _, ws = pair.run([[0.0, 0.0]], [[0.0, 0.0]], 1e-5, 1, force)
    assert abs(ws[0, 0, 0]) < 1e-3 * abs(ws[0, 0, 1])
    assert ws[0, 0, 1] == pytest.approx(1e-5 * 2.0 / 0.7, rel=1e-3)


def closed_form(mechanism: str, q: Values, v: Values, time: float, force: Array) -> Array:
    """Return the end state of a linear mechanism under a constant force."""
    M, C, K = matrices(mechanism)
    n = len(M)
    full = np.zeros((2 * n + 1, 2 * n + 1))
    full[:n, n : 2 * n] = np.eye(n)
    full[n : 2 * n, :n] = -np.linalg.solve(M, K)
    full[n : 2 * n, n : 2 * n] = -np.linalg.solve(M, C)
    full[n : 2 * n, 2 * n] = np.linalg.solve(M, force)
    end: Array = scipy.linalg.expm(full * time) @ [*q, *v, 1.0]
    return end[: 2 * n]


@pytest.mark.parametrize("mechanism", LINEAR)
def test_limit_of_small_steps_is_the_closed_form(
    pairing: Pairing, tmp_path: Path, mechanism: str
) -> None:
    loaded = pairing.load(mechanism, tmp_path)
    n = len(loaded.places)
    q, v, force = np.array([[0.1, -0.2], [0.4, 0.1], [1.5, -0.8]])[:, :n]
    time = 0.06
    values = [
        np.concatenate(
            loaded.run([q], [v], time / rung, rung, np.broadcast_to(force, (1, rung, n))), axis=2
        )[:, 0]
        for rung in RUNGS
    ]
    ones = np.ones(2 * n)
    limit = limits(values, RUNGS, loaded.model.exponents(False), ones, ones)
    error = np.abs(limit.value[0] - closed_form(mechanism, q, v, time, force))
    assert np.all(error <= limit.uncertainty[0])
    assert np.max(error) < 1e-11


@pytest.mark.parametrize("swinging", CAN_SWING, ids=str)
def test_pendulum_falls_with_gravity(swinging: Pairing, tmp_path: Path) -> None:
    loaded = installed(swinging).load("pendulum", tmp_path)
    h = 1e-5
    _, ws = loaded.run([[1.0]], [[0.0]], h, 1)
    assert ws[0, 0, 0] / h == pytest.approx(-GRAVITY / LENGTH * math.sin(1.0), rel=1e-6)


def test_runge_kutta_claims_order_four_until_an_input_varies(
    pairing: Pairing, pair: Loaded
) -> None:
    claims = [pair.model.exponents(varying)[0] for varying in (False, True)]
    assert claims == ([4, 1] if pairing.integrator == "RK4" else [1, 1])


def distribution(place: Path, name: str, module: str, text: str) -> None:
    (place / f"{module}.py").write_text(text)
    info = place / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[crosscheck.engines]\n{name} = {module}:Engine\n")


def test_installed_engine_is_registered_by_name() -> None:
    engine = engines()["known"]
    assert engine.version() == "1.0"
    assert engine.formats == (".known",)
    assert list(engines())[:3] == ["mujoco", "pybullet", "pymunk"]


def test_engine_that_is_installed_later_is_registered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    assert "later" not in engines()
    text = "from physics_crosscheck.harness.engines.known_answer import KnownEngine\n\n\n"
    text += "class Engine(KnownEngine):\n    name = 'later'\n"
    distribution(tmp_path, "later", "later_engine", text)
    assert "later" in engines()


def test_entry_point_cannot_replace_a_built_in_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "from physics_crosscheck.harness.engines.known_answer import KnownEngine\n\n\n"
    text += "class Engine(KnownEngine):\n    name = 'mujoco'\n"
    distribution(tmp_path, "usurper", "usurper_engine", text)
    monkeypatch.syspath_prepend(tmp_path)
    assert type(engines()["mujoco"]).__name__ == "MujocoEngine"


def test_entry_point_without_an_engine_is_reported_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distribution(tmp_path, "duck", "duck_engine", "class Engine:\n    name = 'duck'\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(
        UserWarning, match="'duck'.*not a subclass of harness.engines.protocol.Engine"
    ):
        registered = engines()
    assert "duck" not in registered


@pytest.mark.parametrize(("name", "text", "reason"), [
    ("broken", "import no_such_module_at_all\n", "no_such_module_at_all"),
    ("leaving", "raise SystemExit('good bye')\n", "good bye"),
    ("base", "raise BaseException('no')\n", "no"),
])  # fmt: skip
def test_entry_point_that_cannot_be_loaded_is_reported_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, reason: str
) -> None:
    distribution(tmp_path, name, f"{name}_engine", text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(UserWarning, match=f"{name}.*{reason}"):
        registered = engines()
    assert "known" in registered
