"""`simulate` and `reference` in real engines, each against what is known of the motion."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck import MotionError, Trajectory, simulate, solve
from physics_crosscheck.harness.interfaces.notebook import ask
from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin
from tests.models import written
from tests.standing import keep_default_engines

START = {"theta": 1.5}

ARM = """\
<robot name="arm">
  <link name="base"/>
  <link name="rod">
    <inertial>
      <origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="pin" type="continuous">
    <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
  </joint>
</robot>
"""


def largest(errors: Trajectory, name: str) -> float:
    return float(np.max(np.abs(errors[name])))


def copy(system: str, place: Path) -> Path:
    shutil.copytree(builtin() / system, place)
    keep_default_engines(place)
    return place


def test_reference_has_the_digits_that_it_claims() -> None:
    # Energy is kept; and the quarter period of a large swing is Gauss's.
    motion = solve("simple_pendulum", START, duration=4)
    assert motion.names == ("theta", "theta_dot", "energy")
    assert motion.units == ("rad", "rad/s", "J")
    a, b = 1.0, np.cos(START["theta"] / 2)
    for _ in range(6):
        a, b = (a + b) / 2, np.sqrt(a * b)
    period = 2 * np.pi * np.sqrt(0.75 / 9.81) / a
    samples = solve("simple_pendulum", START, times=[period / 4, period / 2, period], duration=4)
    bounds = samples.uncertainty_of("theta")
    misses = np.abs(samples["theta"] - [0.0, -1.5, 1.5])
    assert np.all(misses <= bounds + 1e-15)
    assert np.all(bounds < 1e-11)
    energy = -0.45 * 9.81 * 0.75 * np.cos(1.5)
    off = np.abs(motion["energy"] - energy)
    assert np.all(off <= motion.uncertainty_of("energy"))
    assert 0 < np.max(motion.uncertainty_of("energy")) < 1e-10


def test_run_converges_with_the_order_of_its_integrator(tmp_path: Path) -> None:
    folder = copy("simple_pendulum", tmp_path / "pendulum")
    exact = solve(folder, "free", duration=1)

    def order(model: str) -> float:
        coarse, fine = (
            largest(simulate(folder / model, "free", h, duration=1) - exact, "theta")
            for h in (0.008, 0.004)
        )
        return float(np.log2(coarse / fine))

    assert order("mujoco.xml") == pytest.approx(1, abs=0.05)
    assert order("space.py") == pytest.approx(1, abs=0.05)
    text = (folder / "mujoco.xml").read_text()
    (folder / "mujoco.xml").write_text(text.replace('integrator="Euler"', 'integrator="RK4"'))
    assert order("mujoco.xml") == pytest.approx(4, abs=0.1)


def test_names_and_units_come_from_the_system() -> None:
    motion = simulate("drum_pendulum/space.py", "free", duration=1)
    assert motion.names == ("x", "theta", "x_dot", "theta_dot", "energy")
    assert motion.units == ("m", "rad", "m/s", "rad/s", "J")
    assert (motion.system, motion.scenario, motion.step) == ("drum_pendulum", "free", 0.002)
    assert "space.py in pymunk" in motion.origin
    assert "a step of 0.002 s" in motion.origin
    assert motion.uncertainty is None
    exact = solve("drum_pendulum", "free", times=motion.t, duration=1)
    errors = motion - exact
    assert 1e-6 < largest(errors, "x") < 1e-2
    assert np.max(errors.uncertainty_of("x")) < 1e-11


def test_declared_outputs_are_columns(tmp_path: Path) -> None:
    folder = copy("simple_pendulum", tmp_path / "pendulum")
    declared = (folder / "system.py").read_text()
    more = 'Output("theta", theta.q, "rad", "angle"), Output("height", -l * cos(theta.q), "m", ""),'
    more += ' Output("energy", theta.v, "rad/s", "no energy at all"), '
    (folder / "system.py").write_text(
        declared.replace('Output("theta", theta.q, "rad", "angle"),', more)
    )
    motion = solve(folder, START, times=[0.0, 0.3], duration=1)
    assert motion.names == ("theta", "theta_dot", "height", "energy", "T + V")
    assert motion.label("height") == "height (m)"
    assert np.allclose(motion["height"], -0.75 * np.cos(motion["theta"]), rtol=0, atol=1e-15)
    assert np.array_equal(motion["energy"], motion["theta_dot"])
    # The height is known as the angle is, times the slope, and its own rounding.
    slope = 0.75 * np.abs(np.sin(motion["theta"]))
    bound = motion.uncertainty_of("height") - slope * motion.uncertainty_of("theta")
    assert np.all(bound > 0)
    assert np.all(bound < 2e-15)
    run = simulate(folder / "mujoco.xml", START, duration=0.3)
    assert run.names == motion.names
    with pytest.raises(ValueError, match="read-only"):
        run["height"][0] = 1.0


def test_driven_motion_has_its_inputs() -> None:
    run = simulate("simple_pendulum/mujoco.xml", "driven", 0.001, duration=3)
    errors = run - solve("simple_pendulum", "driven", times=run.t, duration=3)
    undriven = solve("simple_pendulum", {"theta": 0.2}, times=run.t, duration=3)
    assert largest(errors, "theta") < 0.005
    assert np.max(np.abs(run["theta"] - undriven["theta"])) > 0.1


def test_engine_is_selected_by_name() -> None:
    motion = simulate("simple_pendulum/robot.urdf", START, duration=0.1, engine="mujoco")
    assert "robot.urdf in MuJoCo" in motion.origin
    first = simulate("simple_pendulum/robot.urdf", START, duration=0.1)
    assert "robot.urdf in PyBullet" in first.origin


def test_single_robot_file_has_equations(tmp_path: Path) -> None:
    arm = written(tmp_path, "arm.urdf", ARM)
    start = {"pin": 0.5, "pin_dot": 1.0}
    run = simulate(arm, start, 0.0005, duration=0.3, engine="mujoco")
    exact = solve(arm, start, times=run.t, duration=0.3)
    assert exact.names == ("pin", "pin_dot", "energy")
    # A rigid pendulum: m g l sin(pin) = -(I + m l^2) pin_ddot.
    assert exact["energy"][0] == pytest.approx(0.5 * 0.6 - 2 * 9.81 * 0.5 * np.cos(0.5))
    assert np.ptp(exact["energy"]) < 1e-10
    assert largest(run - exact, "pin") < 5e-4
    heavier = written(tmp_path, "heavier.urdf", ARM.replace('iyy="0.1"', 'iyy="0.2"'))
    other = simulate(heavier, start, 0.0005, duration=0.3, engine="mujoco")
    assert largest(other - exact, "pin") > 5e-3


BODIES = """\
from physics_crosscheck import Joint, MultibodySystem, RigidBody

system = MultibodySystem(
    name="bodies",
    title="a rod on a pin",
    source="made up",
    gravity=(0.0, 0.0, -9.81),
    bodies=(
        RigidBody(
            name="rod", parent=None, position=(0.0, 0.0, 0.0),
            joints=(Joint(name="pin", kind="hinge", axis=(0.0, 1.0, 0.0)),),
            mass=2.0, center=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0),
        ),
    ),
)
"""


def test_folder_that_declares_bodies_runs_with_sidecar_settings(tmp_path: Path) -> None:
    (tmp_path / "system.py").write_text(BODIES)
    (tmp_path / "arm.urdf").write_text(ARM)
    sidecar = 'engines = ["mujoco"]\n[settings]\nstep = 0.001\ngravity = [0, 0, -9.81]\n'
    (tmp_path / "arm.urdf.toml").write_text(sidecar)
    start = {"pin": 0.5}
    run = simulate(tmp_path / "arm.urdf", start, duration=0.2)
    assert (run.system, run.step) == ("bodies", 0.001)
    errors = run - solve(tmp_path, start, times=run.t, duration=0.2)
    assert 0 < largest(errors, "pin") < 1e-3
    with pytest.raises(MotionError, match=r"it declares none; give a start, .*\"pin\": 0\.1"):
        simulate(tmp_path / "arm.urdf", "free")
    (tmp_path / "arm.urdf.toml").write_text(sidecar + '[coordinates]\npin = "2 * pin"\n')
    with pytest.raises(MotionError, match=r"\[coordinates\]: system.py declares bodies"):
        simulate(tmp_path / "arm.urdf", start, duration=0.2)


def test_reference_is_cached_until_its_declaration_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copy("simple_pendulum", tmp_path / "pendulum")
    calls: list[object] = []
    done: Any = ask._done

    def counted(*arguments: Any) -> Any:
        calls.append(arguments[0])
        return done(*arguments)

    monkeypatch.setattr(ask, "_done", counted)
    first = solve(folder, START, duration=1)
    solve(folder, START, times=[0, 0.5], duration=1)
    assert len(calls) == 1
    solve(folder, START, duration=0.5)
    assert len(calls) == 2
    text = (folder / "system.py").read_text()
    (folder / "system.py").write_text(text.replace('"l", 0.75', '"l", 0.80'))
    second = solve(folder, START, duration=1)
    assert len(calls) == 3
    assert largest(second - first, "theta") > 0.01


PENDULUM = "simple_pendulum/mujoco.xml"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((PENDULUM, "fre"), "has no scenario 'fre'; it has free, driven, large, chirp; or give"),
        ((PENDULUM, {"phi": 1.0}), "a start has no 'phi'; simple_pendulum has theta, theta_dot"),
        ((PENDULUM, {"theta": 1.0}), "set a duration in seconds, such as duration=10"),
        ((PENDULUM, "free", 20.0), r"mujoco.xml: dt = 20 s is too long for a motion of 18 s"),
        ((PENDULUM, "free", 1e-8), "takes 1.8e\\+09 steps"),
    ],
)
def test_worker_errors_list_valid_names(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        simulate(*arguments)


def test_invalid_arguments_are_rejected_before_a_run(tmp_path: Path) -> None:
    for step in (-1, 0, np.inf, "slow"):
        with pytest.raises(MotionError, match=r"the step is .*, expected a number of sec"):
            simulate(PENDULUM, "free", step)  # type: ignore[arg-type]
    with pytest.raises(MotionError, match="the duration is -1"):
        solve("simple_pendulum", "free", duration=-1)
    with pytest.raises(MotionError, match="theta starts at nan"):
        simulate(PENDULUM, {"theta": float("nan")}, duration=1)
    with pytest.raises(MotionError, match="the scenario is 3, expected a name"):
        simulate(PENDULUM, 3)  # type: ignore[arg-type]
    with pytest.raises(FolderError, match="unknown engine 'havok'; known engines"):
        simulate(PENDULUM, "free", engine="havok")
    with pytest.raises(
        MotionError, match=r"does not run in pybullet, only in .* \(see mujoco\.xml\.toml"
    ):
        simulate(PENDULUM, "free", engine="pybullet")
    (tmp_path / "arm.urdf").write_text(ARM)
    with pytest.raises(MotionError, match="does not run in pymunk, only in pybullet, mujoco"):
        simulate(tmp_path / "arm.urdf", {}, duration=1, engine="pymunk")
    with pytest.raises(FolderError, match=r"is a folder; name a model file in it: mujoco\.xml, "):
        simulate("simple_pendulum", "free")
    with pytest.raises(MotionError, match=r"nowhere\.xml: there is no such file"):
        simulate("nowhere.xml", "free")
    with pytest.raises(MotionError, match="is a case; name its model"):
        simulate(f"{PENDULUM}/free", "free")
    with pytest.raises(FolderError, match="nowhere: no such folder; the built-in systems are"):
        solve("nowhere", "free")
    with pytest.raises(MotionError, match="holds 6 systems, of which one is to be named"):
        solve(builtin(), "free")


def test_times_must_ascend_within_the_motion() -> None:
    for times in ([0, 1, 1], [[0, 1]], []):
        with pytest.raises(MotionError, match="numbers in a row, ascending"):
            solve("simple_pendulum", START, times=times, duration=1)
    with pytest.raises(MotionError, match="times go from 0 to 2 s, and the motion from 0 to 1 s"):
        solve("simple_pendulum", START, times=[0, 2], duration=1)


def test_numpy_numbers_are_accepted() -> None:
    plain = simulate("simple_pendulum/mujoco.xml", START, 0.004, duration=1)
    start = {"theta": np.float32(1.5)}
    motion = simulate(
        "simple_pendulum/mujoco.xml",
        start,  # type: ignore[arg-type]
        np.float64(0.004),
        duration=np.int64(1),  # type: ignore[arg-type]
    )
    assert np.array_equal(motion.values, plain.values)


def test_arguments_of_wrong_type_are_rejected() -> None:
    anything: Any = "ab"
    with pytest.raises(MotionError, match="times are 'ab', expected ascending numbers"):
        solve("simple_pendulum", "free", times=anything)
    for times in ([0.0, float("nan")], [None]):
        anything = times
        with pytest.raises(MotionError, match="times are numbers in a row, ascending"):
            solve("simple_pendulum", "free", times=anything)
    anything = None
    with pytest.raises(TypeError, match="system must be a path, not None"):
        solve(anything, "free")
    with pytest.raises(TypeError, match="model must be a path, not None"):
        simulate(anything, "free")
    with pytest.raises(MotionError, match="the step is True, expected a number of seconds"):
        simulate("simple_pendulum/mujoco.xml", "free", True)
    anything = ["mujoco"]
    with pytest.raises(TypeError, match="engine must be a string"):
        simulate("simple_pendulum/mujoco.xml", "free", engine=anything)


def test_missing_engine_is_reported_with_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    from physics_crosscheck.harness.engines.pymunk import PymunkEngine

    monkeypatch.setattr(PymunkEngine, "version", lambda _: None)
    with pytest.raises(MotionError, match=r"space.py: pymunk: not installed; pip install"):
        simulate("simple_pendulum/space.py", "free")


@pytest.mark.workers
def test_crash_raises_error_with_line(tmp_path: Path) -> None:
    folder = copy("simple_pendulum", tmp_path / "pendulum")
    space = folder / "space.py"
    text = space.read_text()
    space.write_text(text.replace("import pymunk\n", "import os, pymunk\nos.abort()\n"))
    with pytest.raises(MotionError, match=r"space.py:\d+: .*died"):
        simulate(space, "free")
