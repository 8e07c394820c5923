"""Engines with a known answer, whose laws contain one mistake: it is caught, and named in words."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.law_problem import LawProblem, diagnose_laws, law_problem
from physics_crosscheck.records import Outcome
from tests.laws.scenes import URDF_ARM, URDF_BALLS

pytest.importorskip("pybullet")

RESOLUTION = 1e-9
ELLIPTIC = 'integrator="implicitfast" cone="elliptic"'

BALLS = """<mujoco><option cone="elliptic" impratio="3"/><worldbody>
<geom type="plane" size="3 3 .1" friction=".7 .02 .003" condim="3"/>
<body pos="0 0 .1"><freejoint/><geom type="sphere" size=".1" mass="1" friction=".5 .05 .001"
 condim="3" solimp=".7 .95 .02 .4 2"/></body>
<body pos="0 .3 .1"><freejoint/><geom type="sphere" size=".1" mass="2" friction=".9 .05 .001"
 condim="3"/></body></worldbody></mujoco>"""

LIMITS = """<mujoco><option timestep="0.002" {}/><worldbody>
<body><joint name="a" axis="0 1 0" range="-10 12"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/>
<body pos=".4 0 0"><joint name="c" axis="0 1 0" frictionloss=".1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/></body></body></worldbody>
<tendon><fixed range="-.1 .1"><joint joint="a" coef="1"/><joint joint="c" coef="-.5"/></fixed>
</tendon></mujoco>"""

SERVOS = """<mujoco><option timestep="0.002" {}/><worldbody>
<body pos="0 0 1"><joint name="a" axis="0 1 0" damping=".3"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/>
<body pos=".4 0 0"><joint name="b" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/></body></body></worldbody>
<actuator><motor joint="a" gear="3" ctrlrange="-1 1"/>
<position joint="a" kp="40" kv="2" forcerange="-3 3"/>
<velocity joint="b" kv="3"/><position joint="b" kp="5"/></actuator></mujoco>"""

SOFT = {
    "frictions of two shapes are multiplied": BALLS,
    "the smaller friction of two shapes acts": BALLS,
    "a friction pyramid replaces the cone": BALLS,
    "contacts have the impedance of zero depth, as if solimp were wider than any depth": BALLS,
    "contacts have condim 1": BALLS,
    "limits of joints and tendons are ignored": LIMITS,
    "dry friction of joint c is ignored": LIMITS,
    "gains of drives are multiplied by 180/pi, as if they were per degree": SERVOS,
    "force limits of drives are ignored": SERVOS,
    "ranges of controls are ignored": SERVOS,
    "damping of drives is merged with that of their joints": SERVOS,
}
URDF_BALL = URDF_BALLS.partition('<link name="wheel"')[0] + "</robot>"
HARD = {
    "the limit of joint shoulder is ignored": URDF_ARM,
    "the effort of joint shoulder is ignored": URDF_ARM,
    "gains of drives are divided by 180/pi, as if they were per degree": URDF_ARM,
    "restitution is lost: nothing bounces": URDF_BALL,
    "the larger friction of two shapes acts": URDF_BALLS,
}


@cache
def problem_of(text: str) -> LawProblem:
    """Compare a text with its laws; once, since the effects of numbers are the same for all."""
    is_urdf = text.startswith("<robot")
    file = Path(mkdtemp()) / ("robot.urdf" if is_urdf else "scene.xml")
    file.write_text(text)
    prepared = prepare_tree(file, states=2, floating=text in (URDF_BALL, URDF_BALLS))
    problem = law_problem(model_task(prepared, "pybullet" if is_urdf else "mujoco"))
    assert problem is not None
    return problem


QUICK = "dry friction of joint c is ignored"
"""A mistake that is planted in every run of the tests, besides those of `tests/mutation`."""


@pytest.mark.parametrize(
    ("name", "text"),
    [pytest.param(name, text, id=name, marks=() if name == QUICK else pytest.mark.slow)
     for name, text in (*SOFT.items(), *HARD.items())],
)  # fmt: skip
@pytest.mark.usefixtures("few_states")
def test_engine_with_a_mistake_is_caught_and_the_mistake_named(name: str, text: str) -> None:
    """Catch a mistake that no state shows, or that a number or another mistake is blamed for."""
    problem = problem_of(text.replace("{}", ELLIPTIC))
    assert problem.judge(RESOLUTION).outcome is Outcome.AGREES
    assert problem.mistaken("").judge(RESOLUTION).outcome is Outcome.AGREES
    wrong = problem.mistaken(name)
    assert wrong.judge(RESOLUTION).outcome is Outcome.DIFFERS
    ranking = diagnose_laws(wrong)
    assert ranking.explained
    assert [str(cause) for cause in ranking.fits[0].causes] == [name]


SLIDING = """<mujoco><worldbody><body name="a"><freejoint/><geom size=".1" mass="1"/>
<body name="b" pos=".1 .2 .3"><joint type="ball" pos=".02 .03 .01"/>{}
<geom size=".1" mass="2" pos=".1 .1 .1"/></body></body></worldbody>
<equality><{} body1="a" body2="b" {}/></equality></mujoco>"""


@pytest.mark.parametrize("row", [("connect", 'anchor=".1 -.2 .3"'), ("weld", "")])
@pytest.mark.usefixtures("few_states")
def test_ball_before_a_slide_is_named(row: tuple[str, str]) -> None:
    """Cover MuJoCo 4.0.0, whose dJ/dt v is off by the slide's velocity x the ball's."""
    ranking = diagnose_laws(problem_of(SLIDING.format('<joint type="slide" axis="1 2 3"/>', *row)))
    assert ranking.explained
    assert "moves with a ball joint and slides after it" in str(ranking.fits[0].causes[0])
    assert ranking.fits[0].remaining < 1e-9
    right = problem_of(SLIDING.format("", *row)).judge(RESOLUTION)
    assert right.outcome is Outcome.AGREES


@pytest.mark.usefixtures("few_states")
def test_another_condim_is_named_with_its_value(tmp_path: Path) -> None:
    """Catch a number that selects directions of a contact and that no diagnosis tries."""
    problem = problem_of(BALLS)
    other = tmp_path / "other.xml"
    ball = BALLS.index("condim", BALLS.index("mass"))
    other.write_text(BALLS[:ball] + BALLS[ball:].replace('condim="3"', 'condim="6"', 1))
    wrong = problem.in_engine(type(problem.spec)(other))
    assert wrong.judge(RESOLUTION).outcome is Outcome.DIFFERS
    ranking = diagnose_laws(wrong)
    assert ranking.explained
    (fit,) = ranking.fits[:1]
    assert fit.causes[0].subject[0].endswith("@condim")
    assert fit.estimates == (6.0,)
    assert fit.hypotheses[0].where[0].line == 4
