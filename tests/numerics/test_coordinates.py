"""Maps between a system's coordinates and an engine's."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck import System
from physics_crosscheck.engine import StateForce
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.reference.load import load_system


@pytest.fixture(scope="module")
def drum() -> System:
    return load_system(builtin() / "drum_pendulum")


@pytest.fixture(scope="module")
def pendulum() -> System:
    return load_system(builtin() / "simple_pendulum")


def sidecar(
    coordinates: dict[str, str] | None = None, readback: dict[str, str] | None = None
) -> Sidecar:
    return Sidecar(
        model=Path("m.xml"),
        engines=("x",),
        settings={},
        engine_settings={},
        coordinates=coordinates or {},
        readback=readback or {},
        springs=(),
    )


BOB = sidecar(
    {"bob.x": "l*sin(theta)", "bob.y": "-l*cos(theta)", "bob.angle": "0"},
    {"theta": "atan2(bob.x, -bob.y)"},
)
NAMES = ("bob.x", "bob.y", "bob.angle")


def test_joints_named_like_coordinates_need_no_declaration(drum: System) -> None:
    coords = coordinate_map(drum, sidecar(), ("theta", "x"))
    z, w = coords.to_engine(np.array([[0.1, 0.2, 0.3, 0.4]]))
    assert z.tolist() == [[0.2, 0.1]]
    assert w.tolist() == [[0.4, 0.3]]
    assert coords.push_matrix is not None
    assert coords.push_matrix.tolist() == [[0.0, 1.0], [1.0, 0.0]]


def test_velocities_go_through_the_jacobian_and_back(pendulum: System) -> None:
    coords = coordinate_map(pendulum, BOB, NAMES)
    states = np.array([[0.7, 1.3], [-2.9, 4.0]])
    z, w = coords.to_engine(states)
    step = 1e-6
    moved, _ = coords.to_engine(states + step * np.array([[1.3, 0], [4.0, 0]]))
    assert w == pytest.approx((moved - z) / step, abs=1e-5)
    assert coords.from_engine(z, w, states) == pytest.approx(states, abs=1e-14)


def test_forces_go_through_the_transpose(pendulum: System) -> None:
    coords = coordinate_map(pendulum, BOB, NAMES)
    force = coords.force(np.full((1, 3, 1), 2.0))
    assert isinstance(force, StateForce)
    z, w = coords.to_engine(np.array([[0.7, 1.3]]))
    # The same power on z as on q: F . dz/dt = tau theta'.
    assert np.array(force.evaluate(z[0], [2.0])) @ w[0] == pytest.approx(2.0 * 1.3, rel=1e-14)


def test_angle_read_by_atan2_is_taken_near_the_reference(pendulum: System) -> None:
    coords = coordinate_map(pendulum, BOB, NAMES)
    states = np.array([[3.5, 1.0], [-9.0, 1.0], [20.0, 0.0]])
    assert coords.from_engine(*coords.to_engine(states), states) == pytest.approx(states, abs=1e-13)


def test_angle_is_followed_over_full_turns_away_from_the_reference(pendulum: System) -> None:
    coords = coordinate_map(pendulum, BOB, NAMES)
    states = np.stack([np.linspace(2.9, 16.0, 50), np.full(50, 3.0)], axis=1)
    assert coords.follow(*coords.to_engine(states), states[0]) == pytest.approx(states, abs=1e-12)


def test_residual_of_the_map_is_the_constraint_drift(drum: System) -> None:
    rolling = sidecar({"phi": "x/r"})
    coords = coordinate_map(drum, rolling, ("x", "phi", "theta"))
    z, _ = coords.to_engine(np.array([[0.18, 0.5, 0, 0]]))
    assert z[0, 1] == pytest.approx(1.0, rel=1e-15)
    assert coords.drift(z) < 1e-15
    z[0, 1] += 1e-3  # the drum slips
    assert coords.drift(z) == pytest.approx(1e-3)


def test_zero_input_gives_no_force(drum: System) -> None:
    coords = coordinate_map(drum, sidecar(), ("x", "theta"))
    assert coords.force(np.zeros((2, 3, 2))) is None


@pytest.mark.parametrize(("coordinates", "readback", "names", "sentence"), [
    ({}, {}, ("x", "phi"), r"\[coordinates\] phi: is not a coordinate of drum_pendulum"),
    ({"spin": "x/r"}, {}, ("x", "theta"), r"spin: the model has no such coordinate"),
    ({"phi": "x/R"}, {}, ("x", "phi", "theta"), r"R is neither a coordinate nor a constant"),
    ({"phi": "x/"}, {}, ("x", "phi", "theta"), r"can't read 'x/'"),
    ({"slide": "x"}, {}, ("slide", "theta"), r"\[readback\] x: no joint has this name"),
    ({"slide": "x"}, {"x": "2*slide"}, ("slide", "theta"), r"is not the inverse"),
    ({}, {"y": "x"}, ("x", "theta"), r"\[readback\] y is not a coordinate"),
])  # fmt: skip
def test_inconsistent_map_is_rejected_by_name(
    drum: System,
    coordinates: dict[str, str],
    readback: dict[str, str],
    names: tuple[str, ...],
    sentence: str,
) -> None:
    with pytest.raises(SidecarError, match=sentence) as error:
        coordinate_map(drum, sidecar(coordinates, readback), names)
    assert "m.xml.toml" in str(error.value)


def test_expressions_cannot_run_code(drum: System) -> None:
    with pytest.raises(SidecarError, match="can't read"):
        coordinate_map(drum, sidecar({"phi": "__import__('os').getcwd()"}), ("x", "phi", "theta"))
