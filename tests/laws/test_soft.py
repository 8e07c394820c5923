"""The law of soft rows against closed forms, of drives, and of URDFs in MuJoCo."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck import ForceElement, Joint, RigidBody
from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.acting import urdf_quantities
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.diagnosis.law_problem import diagnose_laws
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.laws.constraints import mix_surfaces
from physics_crosscheck.reference.laws.drives import Driven, drive, unsaturated
from physics_crosscheck.reference.laws.mechanics import LawTree, Posture
from physics_crosscheck.reference.laws.soft import Kind, Part, Rows, gains, impedance
from physics_crosscheck.reference.laws.step import LawModel, LawStep
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.laws import (
    Actuator,
    ContactPoint,
    Laws,
    Softness,
    Surface,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import IDENTITY
from physics_crosscheck.reference.mechanism.tree import WORLD
from tests.compare.asking import compared, laws
from tests.engines.whole_steps import checked, problem_of
from tests.laws.scenes import URDF_ARM, URDF_BOX, URDF_LEG
from tests.models import robot_task, written

MASS, RADIUS, GRAVITY = 2.0, 0.1, 9.81
INERTIA = 0.4 * MASS * RADIUS**2
NOTHING = np.zeros(0)


def surface(body: int, softness: Softness, **changes: object) -> Surface:
    numbers = dict[str, object](
        body=body, dimension=3, friction=(0.6, 0.005, 0.0001), priority=0, mix=1.0, margin=0.0,
        softness=softness,
    )  # fmt: skip
    return Surface(**{**numbers, **changes})  # type: ignore[arg-type]


AXES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SLIDES = tuple(
    Joint(name=axis, kind="slide", axis=row) for axis, row in zip("xyz", AXES, strict=True)
)
"""Joints of a body that does not turn."""


def ball(
    softness: Softness,
    tilt: float = 0.0,
    joints: tuple[Joint, ...] = (Joint(name="free", kind="free"),),
    **laws: object,
) -> LawModel:
    """Return a ball on a plane through the origin, which gravity meets at an angle."""
    free = RigidBody(
        name="ball",
        parent=None,
        joints=joints,
        mass=MASS,
        inertia=(INERTIA, INERTIA, INERTIA, 0.0, 0.0, 0.0),
    )
    down = (GRAVITY * float(np.sin(tilt)), 0.0, -GRAVITY * float(np.cos(tilt)))
    tree = assembled([free], down).tree
    numbers: dict[str, object] = {
        "step": 0.002,
        "integrator": "euler",
        "elliptic": True,
        "surfaces": (surface(0, softness), surface(1, softness)),
        **laws,
    }
    return LawModel(
        laws=Laws(**numbers),  # type: ignore[arg-type]
        tree=LawTree(
            tree=tree,
            paths=(),
            bodies=((WORLD, IDENTITY), tree.frames["ball"]),
            masses=np.array([0.0, MASS]),
            centers=np.zeros((2, 3)),
        ),
        home=np.array([0, 0, 0, 0, 0, RADIUS])[-tree.nv :],
    )


def on_plane(
    model: LawModel, depth: float, velocity: Sequence[float] | Array
) -> tuple[LawStep, Array]:
    """Return the law's problem at a depth and a velocity (angular, linear), and its solution."""
    y = np.array([[0, 0, 0, 0, 0, RADIUS - depth]])[:, -len(velocity) :]
    posture = next(model.tree.postures(y, np.array([velocity], dtype=float)))
    touching = ContactPoint(
        surfaces=(0, 1),
        distance=-depth,
        position=np.array([0.0, 0.0, -depth / 2]),
        frame=np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    )
    law = model.evaluate(posture, NOTHING, NOTHING, [touching])
    return law, law.problem.solve(law.problem.free)


T, Z, D = 0.03, 0.7, 0.9
FLAT = Softness(reference=(T, Z), impedance=(D, D, 0.001, 0.5, 2.0))


def test_pressed_ball_is_a_damped_spring() -> None:
    """Catch wrong stiffness, damping or share of the weight in the normal direction.

    Of an inverse weight 1/m: z'' = -(1 - d) g - 2/T z' - z/(T Z)^2 with z = -depth.
    """
    for depth, speed in ((1e-3, 0.0), (5e-4, -0.2), (2e-3, -0.05)):
        _, a = on_plane(ball(FLAT), depth, [0, 0, 0, 0, 0, speed])
        expected = -(1 - D) * GRAVITY - 2 / T * speed + depth / (T * Z) ** 2
        assert a[5] == pytest.approx(expected, rel=1e-12)


def test_ball_rests_at_its_depth_and_not_elsewhere() -> None:
    """Catch an impedance that does not scale the weight: rest depth (1 - d) g T^2 Z^2."""
    depth = (1 - D) * GRAVITY * T**2 * Z**2
    for model in (ball(FLAT), ball(FLAT, elliptic=False)):
        _, a = on_plane(model, depth, np.zeros(6))
        share = 1.0 if model.laws.elliptic else 0.0
        assert abs(a[5]) * share < 1e-12


def test_direct_numbers_equal_a_time_constant_and_a_damping_ratio() -> None:
    """Catch a format of solref that is read as the other one."""
    full = 0.95
    standard = gains((T, Z), full, 0.002, safe=True)
    direct = gains((-1 / (T * Z) ** 2, -2 / T), full, 0.002, safe=True)
    assert direct == pytest.approx(standard, rel=1e-14)
    assert gains((1e-6, 1.0), full, 0.002, safe=True) == gains((0.004, 1.0), full, 0.002, safe=True)
    assert gains((1e-6, 1.0), full, 0.002, safe=False)[1] == pytest.approx(2 / full / 1e-6)
    assert gains((-1.0, 1.0), full, 0.002, safe=True) == gains((0.02, 1.0), full, 0.002, safe=True)


def test_body_that_sticks_creeps_down_an_incline() -> None:
    """Catch a wrong softness of friction: creep (1 - d) g sin(th) T / (2 impratio)."""
    tilt = 0.2
    depth = (1 - D) * GRAVITY * np.cos(tilt) * T**2 * Z**2
    for ratio in (1.0, 10.0):
        model = ball(FLAT, tilt, SLIDES, friction_ratio=ratio)
        creep = (1 - D) * GRAVITY * np.sin(tilt) * T / (2 * ratio)
        _, a = on_plane(model, depth, [creep, 0.0, 0.0])
        assert np.max(np.abs(a)) < 1e-12


def test_impedance_rises_from_one_end_to_the_other() -> None:
    """Catch a curve that is not continuous or leaves its ends."""
    soft = Softness(reference=(0.02, 1.0), impedance=(0.2, 0.8, 0.01, 0.3, 3.0))
    values = [impedance(soft, x)[0] for x in np.linspace(0, 0.012, 500)]
    assert values[0] == 0.2
    assert values[-1] == 0.8
    assert np.all(np.diff(values) >= 0)
    assert max(np.diff(values)) < 0.01
    assert impedance(soft, -0.003)[0] == pytest.approx(0.2 + 0.6 * 0.3, rel=1e-12)


def test_two_surfaces_mix_by_maximum_weight_and_priority() -> None:
    """Catch friction by product or mean, and a mix that ignores weights or priority."""
    other = Softness(reference=(0.01, 1.5), impedance=(0.5, 0.6, 0.002, 0.5, 2.0))
    first = surface(0, FLAT, friction=(0.9, 0.01, 0.1), mix=3.0, margin=0.001)
    second = surface(1, other, friction=(0.4, 0.02, 0.0), dimension=6, margin=0.002)
    both = mix_surfaces(first, second)
    assert both.friction == (0.9, 0.9, 0.02, 0.1, 0.1)
    assert both.dimension == 6
    assert both.margin == pytest.approx(0.003)
    assert both.softness.reference == pytest.approx((0.75 * T + 0.25 * 0.01, 0.75 * Z + 0.375))
    mixed = mix_surfaces(first, surface(1, other, friction=(0.4, 0.02, 0.0), priority=1))
    assert mixed.friction == (0.4, 0.4, 0.02, 0.0, 0.0)
    assert mixed.softness == other


def test_gradient_bounds_the_error_of_any_answer() -> None:
    """Catch a cost that is not convex in M, or a solution that is not its minimizer."""
    rng = np.random.default_rng(3)
    for elliptic in (True, False):
        model = ball(FLAT, 0.3, elliptic=elliptic)
        for _ in range(20):
            law, best = on_plane(model, 1e-3, rng.normal(size=6))
            problem = law.problem
            size = np.sqrt(best @ problem.mass @ best)
            inverse = np.linalg.inv(problem.mass)
            for spread in (1e-6, 1e-2, 10.0):
                a = best + spread * rng.normal(size=6)
                error, gradient = a - best, problem.gradient(a)
                bound = np.sqrt(gradient @ inverse @ gradient)
                assert np.sqrt(error @ problem.mass @ error) <= bound * (1 + 1e-9)
            gradient = problem.gradient(best)
            assert np.sqrt(gradient @ inverse @ gradient) < 1e-12 * size


def test_answer_that_is_not_the_minimum_leaves_a_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Catch a solution that stops early, and whose error then counts as the engine's."""
    problem = on_plane(ball(FLAT, 0.3), 1e-3, [0.1, 0.2, 0.3, 1.0, -0.5, 0.2])[0].problem
    assert not problem.residual(problem.solve(problem.free)).any()
    early = problem.free
    assert problem.residual(early) == pytest.approx(problem.gradient(early))
    assert problem.residual(early).any()


def test_known_error_of_a_solver_is_removed() -> None:
    """Catch an error that is not subtracted, or a large one that is."""
    law, a = on_plane(ball(FLAT), 1e-3, [0.1, 0, 0, 0, 0, -0.2])
    problem, momentum = law.problem, np.zeros(6)
    off = a + 1e-7 * np.arange(6)
    residual = problem.gradient(off)
    same = problem.with_residual(off, residual, momentum)
    assert np.max(np.abs(same.solve(a) - off)) < 1e-12
    assert problem.with_residual(off, 1e3 * residual, momentum) is problem


def test_dry_friction_holds_up_to_its_force() -> None:
    """Catch friction that has no limit, and friction that does not hold."""
    rows = Rows(step=0.002, safe=True, velocities=np.zeros(1))
    rows.add(Kind.FRICTION, np.ones(1), FLAT, 0.0, 0.5, bound=3.0, part=Part("dry friction"))
    mass = np.array([[2.0]])
    held = rows.problem(mass, np.array([1.0]))
    slides = rows.problem(mass, np.array([4.0]))
    assert held.solve(np.zeros(1))[0] == pytest.approx((1 - D) * 1.0, rel=1e-12)
    assert slides.solve(np.zeros(1))[0] == pytest.approx(4.0 - 3.0 / 2.0, rel=1e-12)


def test_slope_of_a_cone_is_the_derivative_of_its_force() -> None:
    """Catch a wrong curvature, with which Newton's method would stop before the minimum."""
    rng = np.random.default_rng(5)
    law, _ = on_plane(ball(FLAT), 1e-3, rng.normal(size=6))
    problem, h = law.problem, 1e-6
    for _ in range(20):
        a = 30 * rng.normal(size=6)
        slope = problem.jacobian.T @ problem.forces(a)[1] @ problem.jacobian
        moved = [
            (problem.gradient(a + h * e) - problem.gradient(a - h * e)) / (2 * h) for e in np.eye(6)
        ]
        assert np.allclose(np.array(moved).T - problem.mass, slope, rtol=1e-5, atol=1e-4)


STEP = 0.01
CART = RigidBody(
    name="cart", parent=None, joints=(Joint(name="x", kind="slide", axis=(1, 0, 0)),), mass=2.0
)


def cart(
    drives: tuple[dict[str, Any], ...], x: float, v: float, **laws: Any
) -> tuple[Laws, Posture]:
    """Return drives on a cart, each with its own path, and the cart at a state."""
    pulls = [ForceElement(name=f"p{i}", joints=(("x", 1.0),)) for i in range(len(drives))]
    tree = assembled([CART], (0, 0, 0), pulls).tree
    whole = LawTree(
        tree=replace(tree, pulls=()), paths=tree.pulls, bodies=((WORLD, IDENTITY),),
        masses=np.zeros(1), centers=np.zeros((1, 3)),
    )  # fmt: skip
    numbers = tuple(Actuator(path=i, **{"control": 0, **one}) for i, one in enumerate(drives))
    posture = next(whole.postures(np.array([[x]]), np.array([[v]])))
    return Laws(step=STEP, integrator="euler", drives=numbers, **laws), posture


def driven(
    *drives: dict[str, Any],
    x: float = 0.3,
    v: float = -0.2,
    control: float = 2.0,
    state: float = 0.4,
    **laws: Any,
) -> Driven:
    """Return the forces of drives on a cart."""
    accelerations, states = np.full(len(drives), 0.5), np.array([state])
    return drive(*cart(drives, x, v, **laws), accelerations, np.array([control]), states)


def test_servo_limits_follow_its_file() -> None:
    """Catch limits that are ignored, or applied in another order: control, force, joint."""
    servo = {"gains": (40.0,), "bias": "affine", "biases": (0.0, -40.0, -2.0)}
    free = 40 * (2.0 - 0.3) + 2.0 * 0.2
    assert driven(servo).forces[0] == pytest.approx(free)
    within = driven({**servo, "control_range": (-1.0, 1.0)}).forces[0]
    assert within == pytest.approx(40 * (1.0 - 0.3) + 0.4)
    limited = driven(
        {**servo, "force_range": (-3.0, 3.0)}, servo, joint_ranges={0: ((-9, 9), False)}
    )
    assert limited.forces == pytest.approx([3.0, free])
    assert limited.joint_forces == pytest.approx([9.0])
    assert limited.damping == pytest.approx(0.0)
    assert driven(servo).damping == pytest.approx(2.0)


SERVO = {"gains": (40.0,), "bias": "affine", "biases": (0.0, -40.0, -2.0)}


@pytest.mark.parametrize(("drives", "laws"), [
    ([{**SERVO, "force_range": (0.0, 100.0)}], {}),
    ([{**SERVO, "force_range": (-90.0, -10.0)}], {}),
    ([SERVO, {**SERVO, "control": 1}], {"sums": (((0, 1), (0.0, 100.0)),)}),
    ([SERVO, {**SERVO, "control": 1}], {"joint_ranges": {0: ((20.0, 100.0), False)}}),
    ([{**SERVO, "force_range": (0.0, 100.0)}], {"joint_ranges": {0: ((-50.0, 20.0), False)}}),
])  # fmt: skip
def test_range_on_one_side_of_zero_is_drawn_inside(
    drives: list[dict[str, Any]], laws: dict[str, Any]
) -> None:
    """Catch controls that put each drive at its limit if its range starts at zero or beyond."""
    numbers, posture = cart(tuple(drives), 0.3, -0.2, **laws)
    ones = np.ones(len(drives))
    forces = []
    for share in (-0.8, 0.0, 0.8):
        controls, states = unsaturated(numbers, posture, ones, share * ones)
        result = drive(numbers, posture, ones, controls, states)
        assert not result.clipped
        assert result.damping[0, 0] == pytest.approx(2.0 * len(drives))  # no joint is at a limit
        forces.append(result.joint_forces[0])
    assert np.all(np.diff(forces) > 5.0)


def test_sum_of_drives_on_a_tendon_is_scaled() -> None:
    """Catch a limit of a sum that is applied to each drive."""
    both = driven({"gains": (1.0,)}, {"gains": (3.0,)}, sums=(((0, 1), (-4.0, 4.0)),))
    assert both.forces == pytest.approx([1.0, 3.0])


def test_exact_filter_follows_the_exponential() -> None:
    """Catch filters that are exchanged, and a range that is not applied to the state."""
    exact = {"state": 0, "dynamics": "exact filter", "constants": (0.05,)}
    expected = 2.0 + (0.4 - 2.0) * np.exp(-STEP / 0.05)
    assert driven(exact).states[0] == pytest.approx(expected, rel=1e-14)
    assert driven(exact).forces[0] == 0.4
    assert driven({**exact, "early": True}).forces[0] == pytest.approx(expected, rel=1e-14)
    plain = driven({**exact, "dynamics": "filter", "state_range": (0.0, 0.5)})
    assert plain.states[0] == 0.5
    assert driven({"state": 0, "dynamics": "integrator"}).states[0] == pytest.approx(0.42)


def test_muscle_has_its_peak_at_its_best_length() -> None:
    """Catch a muscle's curves that are shifted, and a sign that makes it push."""
    numbers = (0.75, 1.05, -1.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2)
    muscle: dict[str, Any] = {
        "state": 0, "dynamics": "muscle", "constants": (0.01, 0.04, 0.0), "gain": "muscle",
        "gains": numbers, "bias": "muscle", "biases": numbers, "stretch": (0.2, 0.35),
    }  # fmt: skip
    best = 0.2 + (1.0 - 0.75) * (0.15 / 0.3)
    at_best = driven(muscle, x=best, v=0.0, control=1.0)
    assert at_best.forces[0] == pytest.approx(-0.4 * 200.0 / 0.5)
    assert at_best.states[0] == pytest.approx(0.4 + STEP * 0.6 / (0.01 * 1.1))
    longer = driven(muscle, x=best + 0.5 * 0.3, v=0.0, state=0.0).forces[0]
    assert longer == pytest.approx(-400.0 * 1.3 * 0.5)
    assert driven(muscle, x=best, v=-2.0).forces[0] == 0.0


def test_damping_of_a_muscle_is_the_slope_of_its_force() -> None:
    """Catch a slope that an implicit integrator would use with another sign or scale."""
    numbers = (0.75, 1.05, 300.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2)
    muscle: dict[str, Any] = {"gain": "muscle", "gains": numbers, "stretch": (0.2, 0.35)}
    for v in (-0.3, 0.05, 0.4):
        low, high = (driven(muscle, v=v + by).forces[0] for by in (-1e-6, 1e-6))
        assert driven(muscle, v=v).damping[0, 0] == pytest.approx(-(high - low) / 2e-6, rel=1e-6)


FIXED_BALL = """<link name="ball"><collision><geometry><sphere radius=".05"/></geometry></collision>
</link><joint name="weld" type="fixed"><parent link="lower"/><child link="ball"/>
<origin xyz=".2 0 0"/></joint></robot>"""
BARE = URDF_ARM.replace("</robot>", FIXED_BALL)
"""A link without `<inertial>` that MuJoCo gives the mass of its sphere."""


@pytest.mark.parametrize(
    ("text", "floating", "kinds"),
    [
        pytest.param(URDF_ARM, False, {"limits", "dry friction"}, id="arm"),
        pytest.param(URDF_LEG, True, {"limits", "contacts"}, id="leg"),
        pytest.param(URDF_BOX, True, {"contacts"}, id="box"),
        pytest.param(BARE, True, {"limits", "dry friction", "contacts"}, id="bare"),
    ],
)
def test_urdf_follows_the_soft_law(
    tmp_path: Path, text: str, floating: bool, kinds: set[str]
) -> None:
    """Catch another softness, weight, mixing or body of a shape, and a free root's next state."""
    check = checked("mujoco", tmp_path, text, floating=floating)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert check.record.next_state
    assert not check.record.uncovered
    assert {term.name for term in check.record.acted} == kinds


@pytest.mark.parametrize(
    ("right", "wrong"),
    [('upper=".7"', 'upper=".7000007"'), ('friction=".1"', 'friction=".1000001"'),
     ('damping=".2"', 'damping=".2000002"'), ('lower="-1" upper=".7" ', ""),
     ('friction=".1"', "")],
)  # fmt: skip
def test_wrong_number_is_detected(tmp_path: Path, right: str, wrong: str) -> None:
    """Catch a number of a URDF that the soft law does not depend on, or takes from MuJoCo."""
    assert URDF_ARM.count(right) == 1
    check = checked("mujoco", tmp_path, URDF_ARM, URDF_ARM.replace(right, wrong))
    assert check.record.outcome is Outcome.DIFFERS


@pytest.mark.parametrize(
    ("right", "wrong"), [('upper=".4"', 'upper=".1"'), ('effort="7"', 'effort="70"')]
)
def test_number_without_effect_agrees(tmp_path: Path, right: str, wrong: str) -> None:
    """Catch limits of a continuous joint, or of an effort that nothing exerts."""
    assert URDF_ARM.count(right) == 1
    check = checked("mujoco", tmp_path, URDF_ARM, URDF_ARM.replace(right, wrong))
    assert check.record.outcome is Outcome.AGREES


def test_equal_bounds_are_no_limit(tmp_path: Path) -> None:
    """Catch a law that locks a joint whose limits MuJoCo ignores."""
    text = URDF_ARM.replace('lower="-1" upper=".7"', 'lower="0" upper="0"')
    check = checked("mujoco", tmp_path, text)
    assert check.record.outcome is Outcome.AGREES
    assert "limits" not in {term.name for term in check.record.acted}


def test_parts_without_a_law_are_named(tmp_path: Path) -> None:
    """Catch a verdict on whole steps that hides contacts of meshes."""
    text = URDF_LEG.replace('sphere radius=".1"', 'mesh filename="no.obj"')
    check = checked("mujoco", tmp_path, text, floating=True)
    assert check.record.uncovered == ("contacts of meshes",)


@pytest.mark.parametrize(
    ("right", "wrong", "address"),
    [('upper=".7"', 'upper=".7000007"', "joint[shoulder]/limit@upper"),
     ('friction=".1"', 'friction=".1000001"', "joint[shoulder]/dynamics@friction")],
)  # fmt: skip
def test_wrong_number_is_named(tmp_path: Path, right: str, wrong: str, address: str) -> None:
    """Catch a diagnosis that does not try the numbers of a soft URDF."""
    problem = problem_of("mujoco", tmp_path)
    file = written(tmp_path, "wrong.urdf", URDF_ARM.replace(right, wrong))
    ranking = diagnose_laws(problem.in_engine(replace(problem.spec, path=file)))
    assert ranking.explained
    (cause,) = ranking.fits[0].causes
    assert cause.subject == (address,)


def test_masses_from_shapes_are_named(tmp_path: Path) -> None:
    """Catch a link without `<inertial>` whose mass in MuJoCo no check sees."""
    task = robot_task(tmp_path, "robot.urdf", BARE)
    assert run_case(task).outcome is Outcome.DIFFERS
    (cause, remedy), *others = task.load()[0].corrective_settings.items()
    assert cause == "MuJoCo's masses from the shapes of a link without <inertial> (ball, line 11)"
    assert remedy == {"shape_masses": False}
    assert not others
    without = run_case(task.with_settings(shape_masses=False))
    assert without.outcome is Outcome.AGREES


def test_numbers_act_as_stated(tmp_path: Path) -> None:
    """Catch quantities of a URDF that MuJoCo has without its numbers."""
    file = written(tmp_path, "leg.urdf", URDF_LEG)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": True}
    rows = urdf_quantities(ModelSpec(file, settings=settings), "mujoco")
    values = {(row.subject, row.quantity): row.value for row in rows}
    assert values["ground with shin", "friction"] == 1.0
    assert values["limits of hip", "time constant"] == pytest.approx(0.02)


def test_limits_of_urdf_and_mjcf_are_compared(tmp_path: Path) -> None:
    """Catch limits that a conversion from URDF to MJCF loses, and a joint in another order."""
    swing = """<mujoco><worldbody><body><joint name="other" axis="0 1 0"/>
    <inertial mass="1" pos=".1 0 0" diaginertia=".01 .02 .02"/></body>
    <body><joint name="hip" axis="0 1 0"/>
    <inertial mass="1" pos=".1 0 0" diaginertia=".01 .02 .02"/></body></worldbody></mujoco>"""
    link = """<link name="{0}l"><inertial><origin xyz=".1 0 0"/><mass value="1"/><inertia ixx=".01"
    iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{0}" type="{1}">
    <parent link="base"/><child link="{0}l"/><axis xyz="0 1 0"/>{2}</joint>"""
    limit = '<limit lower="-1" upper=".5" effort="1" velocity="1"/>'
    (tmp_path / "a.xml").write_text(swing)
    (tmp_path / "b.urdf").write_text(
        f'<robot name="r"><link name="base"/>{link.format("hip", "revolute", limit)}'
        f"{link.format('other', 'continuous', '')}</robot>"
    )
    (row,) = laws(tmp_path / "a.xml", tmp_path / "b.urdf", "mujoco", "mujoco")
    assert row.about == "joint hip"
    assert row.effect
    assert row.effect > 1e-3
    same = swing.replace('"hip" axis', '"hip" range="-1 .5" axis')
    (tmp_path / "a.xml").write_text(f'<mujoco><compiler angle="radian"/>{same[8:]}')
    same_files = compared(tmp_path / "a.xml", tmp_path / "b.urdf", "mujoco", "mujoco")
    assert same_files.outcome is Outcome.AGREES
