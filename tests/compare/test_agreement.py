"""Models of one mechanism agree with each other, whatever their format and engine."""

from pathlib import Path

import pytest

from physics_crosscheck.records import ComparisonResult, Outcome
from tests.compare.arm import MJCF, URDF
from tests.compare.asking import changed, compared, model, result, sampled
from tests.compare.chains import chain
from tests.models import written

ACROSS = "mujoco.xml", None, "robot.urdf", "pybullet"
IN_A_SPACE = "mujoco.xml", None, "space.py", None
PAIRS = (
    (*ACROSS, "drum_pendulum"), (*IN_A_SPACE, "free_pair"),
    ("robot.urdf", "mujoco", "robot.urdf", "pybullet", "torsional_disc"),
)  # fmt: skip


def agrees(comparison: ComparisonResult) -> ComparisonResult:
    judged = result(comparison)
    assert comparison.outcome is Outcome.AGREES, comparison.reason
    assert (judged.discrepancy or 0.0) < 1e-9
    assert (judged.uncertainty or 1.0) < 1e-9
    assert not judged.terms
    return comparison


# The drum has most of the terms, the pairs have tendons, a Space has no root.
@pytest.mark.parametrize(("a", "engine_a", "b", "engine_b", "system"), PAIRS)
def test_built_in_models_agree_across_formats_and_engines(
    system: str, a: str, engine_a: str | None, b: str, engine_b: str | None
) -> None:
    comparison = agrees(compared(model(system, a), model(system, b), engine_a, engine_b))
    # A free motion can't fix the overall scale: half of the runs or so are driven.
    assert result(comparison).runs.driven >= 12
    if (system, b) == ("drum_pendulum", "robot.urdf"):  # which has one more mimic joint
        assert (result(comparison).states_of, result(comparison).left_out) == ("B", ("phi",))


@pytest.mark.slow
def test_drum_rolling_by_an_equality_agrees_with_one_rolling_by_a_gear() -> None:
    drum = "drum_pendulum"
    comparison = agrees(compared(model(drum, "mujoco_rolling.xml"), model(drum, "robot.urdf")))
    assert result(comparison).joints == ("x", "phi", "theta")
    paths = model(drum, "mujoco_rolling.xml"), model(drum, "robot.urdf")
    assert len(sampled(*paths).independent) == 2


@pytest.mark.slow
def test_expression_defines_a_joint_without_a_match(tmp_path: Path) -> None:
    drum = "drum_pendulum"
    # The drum of the Space only slides; that of the URDF also turns.
    table = written(tmp_path, "map.toml", '[joints]\nphi = "drum.x / 0.18"\n')
    a, b = model(drum, "space.py"), model(drum, "robot.urdf")
    comparison = agrees(compared(a, b, None, "pybullet", table=table))
    assert result(comparison).map == (
        "x of B is drum.x of A",
        "phi of B is 50*drum.x/9 of A",
        "theta of B is rod.angle of A",
    )


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_arm_written_by_hand_in_both_formats_agrees(tmp_path: Path, engine: str) -> None:
    a, b = written(tmp_path, "arm.xml", MJCF), written(tmp_path, "arm.urdf", URDF)
    comparison = agrees(compared(a, b, engine_b=engine))
    assert "gravity (0, 0, -9.81) and a step of 0.002 s are assumed" in result(comparison).notes[0]


def test_joint_with_another_name_direction_and_zero_agrees_if_mapped(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    other = changed(
        tmp_path,
        path,
        (
            '<joint name="theta" type="hinge" axis="0 -1 0"/>',
            '<joint name="swing" type="hinge" axis="0 1 0" ref="0.3"/>',
        ),
    )
    agrees(compared(path, other, joints="theta=0.3-swing"))


def test_step_and_integrator_of_a_sidecar_are_differences_that_move_nothing(tmp_path: Path) -> None:
    """Catch a doubled step that ends with 0, since extrapolation removes it from all motions."""
    path = model("simple_pendulum", "robot.urdf")
    other = changed(tmp_path, path, ("step = 0.002", "step = 0.001"), ('"Euler"', '"RK4"'))
    comparison = compared(path, other, "mujoco", "mujoco")
    assert comparison.outcome is Outcome.DIFFERS
    assert comparison.reason.startswith("sidecar:settings.")
    moved = {
        t.edits[0].what: (str(t.edits[0].where_a).rpartition("/")[2], t.moved)
        for t in result(comparison).differences
        if len(t.edits) == 1
    }
    assert moved == {
        "sidecar:settings.step": ("robot.urdf.toml:5", 0.0),
        "sidecar:settings.integrator": ("robot.urdf.toml", 0.0),
    }


def test_given_start_state_is_run_too() -> None:
    path = model("simple_pendulum", "mujoco.xml")
    starts = ({"theta": 2.9, "theta_dot": 0.25},)
    assert result(agrees(compared(path, path, starts=starts))).runs.count > 12
    here = sampled(path, path, starts=starts).runs
    assert [2.9, 0.25] in here.start.tolist()


def test_random_chains_agree_across_formats(tmp_path: Path) -> None:
    mjcf, urdf = chain(3, 4)
    a, b = written(tmp_path, "a.xml", mjcf), written(tmp_path, "b.urdf", urdf)
    agrees(compared(a, b, engine_b="mujoco"))


@pytest.mark.slow
def test_rounding_of_turned_inertias_in_pybullet_is_noted(tmp_path: Path) -> None:
    mjcf, urdf = chain(1, 2)
    a, b = written(tmp_path, "a.xml", mjcf), written(tmp_path, "b.urdf", urdf)
    comparison = compared(a, b, engine_b="pybullet")
    assert (result(comparison).discrepancy or 1.0) < 1e-8
    assert "PyBullet finds their principal axes only to about 1e-9" in result(comparison).notes[-1]


@pytest.mark.usefixtures("usual_states")
def test_runs_that_touch_a_wall_are_left_out_with_a_note(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    wall = '<geom type="sphere" pos="0.6 0 0.55" size="0.1" contype="1" conaffinity="1"/>\n'
    bob = '<geom name="bob" type="sphere" pos="0 0 -0.75" size="0.05"'
    touching = changed(
        tmp_path,
        path,
        ('<body name="pendulum"', f"{wall}<body name='pendulum'"),
        (bob, f'{bob} contype="1" conaffinity="1"'),
    )
    comparison = agrees(compared(touching, touching, include_constraints=True))
    assert 0 < result(comparison).runs.lost < result(comparison).runs.count
    assert "runs left out" in result(comparison).notes[-1]
