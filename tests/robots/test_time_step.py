"""Errors of time steps without full runs, and steps that are unstable."""

import json
from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.time_step import choose_step
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.prepared import unpacked
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from physics_crosscheck.harness.planning.target_plan import TargetPlan
from physics_crosscheck.harness.planning.tasks import target
from physics_crosscheck.harness.records.case import TimeStep
from physics_crosscheck.harness.render.terminal.table import time_step_lines
from physics_crosscheck.harness.results.status import step_words
from tests.models import robot_task, written
from tests.records.made import case

INERTIA = 0.3 * 0.1**2 + 0.001

ROD = """<mujoco><option timestep="0.002">{flag}</option><worldbody><body pos="0 0 1">
<joint name="j" axis="0 1 0" damping="{damping}" {joint}/>
<inertial pos="0 0 {low}" mass="0.3" diaginertia="0.001 0.001 0.001"/>
</body></worldbody><actuator>{drive}</actuator></mujoco>"""

BALL = """<mujoco><option timestep="0.002"/><worldbody><geom name="floor" type="plane"
size="1 1 .1"/><body pos="0 0 .0999"><freejoint name="root"/>
<geom name="ball" type="sphere" size=".1" mass="1" solref="{solref}"/></body>
</worldbody></mujoco>"""

EXPLICIT, SERVO = '<flag eulerdamp="disable"/>', '<position joint="j" kp="{}"/>'


def rod(**given: object) -> str:
    """Return a pendulum of inertia 0.004 kg m^2 about its joint; `low` above zero: inverted."""
    return ROD.format(**{"flag": "", "damping": 0, "drive": "", "low": -0.1, "joint": ""} | given)


URDF = """<robot name="rod"><link name="base"/><joint name="j" type="continuous">
<parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<dynamics damping="{}"/></joint><link name="rod"><inertial><origin xyz="0 0 -0.1"/>
<mass value="0.3"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>
</inertial></link></robot>"""


# Semi-implicit Euler: damping c is stable up to h = 2 I / c, stiffness k up to 2 sqrt(I / k).
@pytest.mark.parametrize(
    ("text", "engine", "largest", "words"),
    [
        pytest.param(rod(flag=EXPLICIT, damping=8), "mujoco", 2 * INERTIA / 8, "damping up to 4",
                     id="damper"),
        pytest.param(URDF.format(6), "pybullet", 2 * INERTIA / 6, "damping up to", id="pybullet"),
        pytest.param(rod(drive=SERVO.format(8000)), "mujoco", 2 * (INERTIA / 8000) ** 0.5,
                     "grows 5.8-fold", id="servo"),
        pytest.param(BALL.format(solref="-2000000 -100"), "mujoco", 1.44e-3, "geom:ball)",
                     id="contact"),
        pytest.param(BALL.format(solref="-500000 -100"), "mujoco", None, "", id="soft contact"),
        pytest.param(rod(damping=8), "mujoco", None, "", id="implicit damper"),
        pytest.param(rod(flag=EXPLICIT, damping=3.5), "mujoco", None, "", id="stable damper"),
        pytest.param(rod(drive=SERVO.format(3800)), "mujoco", None, "", id="stable servo"),
        pytest.param(rod(), "mujoco", None, "", id="conservative"),
        pytest.param(rod(low=0.1), "mujoco", None, "", id="inverted"),
        pytest.param(rod(joint='range="10 60"'), "mujoco", None, "", id="beyond a limit"),
        pytest.param(rod(low=0.1, joint='range="57 115" solreflimit="-2000000 -100"'), "mujoco",
                     None, "", id="thrown by a limit"),
        pytest.param(URDF.format(3), "pybullet", None, "", id="stable in pybullet"),
    ],
)  # fmt: skip
def test_unstable_step(
    tmp_path: Path, text: str, engine: str, largest: float | None, words: str
) -> None:
    """Catch an unstable step that is missed, a stable one that is reported, and a wrong limit."""
    name = "rod.urdf" if "<robot" in text else "rod.xml"
    step = run_case(robot_task(tmp_path, name, text, engine)).time_step
    assert step is not None
    assert step.largest_stable == (largest and pytest.approx(largest, rel=0.06))
    assert (step.finding is None) == (largest is None)
    if step.finding is not None:
        assert step.finding.code == "XC180"
        assert step.finding.location is not None
        assert step.finding.location.line
        assert words in step.finding.message


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_error_is_that_of_a_full_run(tmp_path: Path, engine: str) -> None:
    """Catch an error, or a step for 0.1 %, that a full run from rest does not show."""
    file = written(tmp_path, "rod.urdf", URDF.format(0.002))
    out = tmp_path / "out"
    words = ["run", str(file), "--engine", engine, "--motion", "1", "--out", str(out)]
    assert main(words) == 0
    (case,) = json.loads((out / "results.json").read_text())["cases"]
    run, step = case["full_run"], case["time_step"]
    assert step["error"] == pytest.approx(max(run["global_error"], run["velocity_error"]), rel=0.1)
    assert step["steps_for"][1]["step"] == pytest.approx(run["steps_for"][1]["step"], rel=0.2)


def test_unstable_step_fails_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Catch a run that passes at an unstable step, or does not print the error of a stable one."""
    file = written(tmp_path, "rod.urdf", URDF.format(6))
    assert main(["run", str(file), "--engine", "pybullet", "--out", str(tmp_path / "a")]) == 1
    assert "XC180" in capsys.readouterr().out
    assert main(["run", str(file), "--engine", "mujoco", "--out", str(tmp_path / "b")]) == 0
    assert "time step: 2 ms is " in capsys.readouterr().out


def test_table_of_steps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Catch a table with another step, a missing engine, or an unstable step that passes."""
    file = written(tmp_path, "rod.urdf", URDF.format(6))
    words = ["step", str(file), "--error", "0.1%", "--engine", "mujoco", "--engine", "pybullet"]
    assert main([*words, "--format", "json"]) == 1
    stable, unstable = json.loads(capsys.readouterr().out)["rows"]
    assert stable["target"] == 0.001
    assert not stable["unstable"]
    assert 0 < stable["step_for"] < stable["step"]
    assert unstable["step_for"] <= unstable["largest_stable"] < unstable["step"]
    assert main([*words[:4], "--engine", "mujoco"]) == 0
    assert "dt for 0.1 %" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="2"):
        main(["step", str(file), "--error", "200%"])


def test_motion_that_takes_too_long_keeps_the_verdict(tmp_path: Path) -> None:
    """Catch a run whose motion from rest takes too long and that loses its verdict."""
    file = written(tmp_path, "rod.urdf", URDF.format(0))
    plan = TargetPlan(file, Options(motion=1.0), ResultBuilder(lambda *_: None))
    (job,) = plan.jobs(lambda: ())
    (again,) = job.failed(Failure("it needs more than 1 s", "", kind="time limit"))
    facts = again.task.function(file)
    assert facts.facts.declares == "robot file"
    solved = unpacked(target(file, motion=1.0, no_motion="it needs more than 1 s").solved)
    assert solved.rest == "it needs more than 1 s"


def test_words_of_an_error_below_the_target() -> None:
    """Catch a shorter step that is recommended although the own one is good enough."""
    step = TimeStep(step=0.002, duration=1.0, error=5e-4, order=1)
    assert step_words(step) == "2 ms is 0.05 % off (smooth motion, 1 s)"
    files = [case(time_step=step, model=name) for name in ("a.xml", "b.xml")]
    assert time_step_lines(files) == ["time step: at most 0.05 % off in both cases"]


def test_motion_that_no_step_follows_has_no_percentage(tmp_path: Path) -> None:
    """Catch an error in percent where shorter steps show no order."""
    text = "no time step that was run follows 1 s of this motion"
    file = written(tmp_path, "rod.xml", rod(drive=SERVO.format(3800)))
    row = choose_step(file, engine="mujoco", target=0.01, floating=False, model="")
    assert (row.error, row.problem, row.unstable) == (None, text, "")
    step = run_case(robot_task(tmp_path, file.name, file.read_text(), "mujoco")).time_step
    assert step is not None
    assert step_words(step) == text
