"""Limits of every adapter against closed forms, and engines of third parties."""

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
