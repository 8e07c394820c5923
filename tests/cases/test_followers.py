"""Robot files whose joints follow others: mimics and joint equalities."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import judge, run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import default_engines, engines_reading
from physics_crosscheck.records import Outcome
from tests.models import written

INERTIA = '<inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/>'
URDF = f"""<robot name="gripper"><link name="w"/>
<link name="a"><inertial><origin xyz="0.1 0 -0.3"/><mass value="1.3"/>{INERTIA}</inertial></link>
<link name="b"><inertial><origin xyz="0 0.1 -0.2"/><mass value="0.7"/>{INERTIA}</inertial></link>
<link name="c"><inertial><origin xyz="0 0 0.1"/><mass value="0.4"/>{INERTIA}</inertial></link>
<link name="d"><inertial><origin xyz="0.1 0 0.1"/><mass value="0.3"/>{INERTIA}</inertial></link>
<joint name="j1" type="continuous"><parent link="w"/><child link="a"/><axis xyz="0 1 0"/>
<dynamics damping="0.1"/></joint>
<joint name="j2" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="0 0 -0.5" rpy="0.2 0 0"/><axis xyz="1 0 0"/></joint>
<joint name="j3" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0 0 -0.5"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
<mimic joint="j2" multiplier="-0.3"/></joint>
<joint name="j4" type="continuous"><parent link="a"/><child link="d"/><axis xyz="0 0 1"/>
<mimic joint="j3" multiplier="2"/></joint></robot>"""

MJCF = """<mujoco><option integrator="{}"/><worldbody><body><joint name="j1" axis="0 1 0"/>
<inertial pos="0.1 0 -.3" mass="1.3" diaginertia="0.05 0.06 0.07"/>
<body pos="0 0 -0.5" euler="20 0 0"><joint name="j2" axis="1 0 0" ref="10"/>
<inertial pos="0 .1 -.2" mass="0.7" diaginertia="0.01 0.02 0.015"/>
<body name="s" pos="0 0 -0.5"><joint name="j3" type="slide" axis="0 0 1" ref="0.2" stiffness="30"/>
<inertial pos="0 0 0.1" mass="0.4" diaginertia="0.01 0.02 0.015"/></body>
<body pos="0 0.3 -0.5"><joint name="j4" type="slide" axis="0 0 1" ref="0.2"/>
<inertial pos="0 0 0.1" mass="0.4" diaginertia="0.01 0.02 0.015"/></body>
</body></body></worldbody><equality>
<joint joint1="j3" joint2="j2" polycoef="0.1 -0.3 0 0 0"/>
<joint joint1="j4" polycoef="0.05 0 0 0 0"/>
<joint joint1="j1" joint2="j2" polycoef="0 0 1 0 0"/>
<connect body1="s" anchor="0 0 0"/></equality></mujoco>"""


ENGINES = [e.name for e in default_engines(".urdf") if e.version() is not None]


@pytest.mark.parametrize("engine", [*ENGINES, "pinocchio"])
def test_mimic_joints_agree(tmp_path: Path, engine: str) -> None:
    file = written(tmp_path, "g.urdf", URDF)
    prepared = prepare_tree(file, states=8)
    assert prepared.names == ("j1", "j2")
    assert prepared.settings["couplings"] == ["j3", "j4"]
    task = model_task(prepared, engine)
    assert run_case(task).outcome is Outcome.AGREES
    for old, new in (('"-0.3"', '"-0.3000003"'), ('value="0.3"', 'value="0.3000003"')):
        file.write_text(URDF.replace(old, new))
        assert judge(task).outcome is Outcome.DIFFERS, new
    if engine == "pinocchio":
        file.write_text(URDF)
        released = judge(task.with_settings(hold_mimics=False))
        assert released.outcome is Outcome.DIFFERS
        assert (released.largest_discrepancy or 0) > 0.1


@pytest.mark.parametrize("engine", ENGINES)
def test_mimic_missing_in_the_engine_differs(tmp_path: Path, engine: str) -> None:
    file = written(tmp_path, "g.urdf", URDF)
    task = model_task(prepare_tree(file, states=8), engine)
    file.write_text(URDF.replace('<mimic joint="j3" multiplier="2"/>', ""))
    case = run_case(task)
    assert case.outcome is Outcome.DIFFERS
    assert "j4" in case.reason
    assert "state" in case.reason


@pytest.mark.parametrize(
    ("other", "engine"), [('multiplier="2" offset="0.1"', "mujoco"), ('multiplier="0"', "pybullet")]
)
def test_mimic_without_a_gear_is_reported_as_free(tmp_path: Path, other: str, engine: str) -> None:
    file = tmp_path / "g.urdf"
    file.write_text(URDF.replace('joint="j3" multiplier="2"', f'joint="j3" {other}'))
    prepared = prepare_tree(file, states=8)
    assert prepared.names == ("j1", "j2", "j4")
    assert "mimic without a gear: the joint is free" in prepared.left_out
    assert judge(model_task(prepared, engine)).outcome is Outcome.AGREES


@pytest.mark.parametrize(
    "integrator", [pytest.param("implicitfast", marks=pytest.mark.slow), "RK4"]
)
def test_linear_joint_equalities_agree(tmp_path: Path, integrator: str) -> None:
    """Cover joint references, a locked joint, and equalities that are left out."""
    file, engine = (
        tmp_path / "g.xml",
        next(e for e in engines_reading(".xml") if ".xml" in e.compiles),
    )
    file.write_text(MJCF.format(integrator))
    prepared = prepare_tree(file, states=8)
    assert prepared.names == ("j1", "j2")
    assert "equality constraints (2)" in prepared.left_out
    task = model_task(prepared, engine.name)
    assert run_case(task).outcome is Outcome.AGREES
    old, new = ("0.1 -0.3", "0.1000001 -0.3") if integrator == "RK4" else ("-0.3 0", "-0.3000003 0")
    file.write_text(MJCF.format(integrator).replace(old, new))
    assert judge(task).outcome is Outcome.DIFFERS, new


def test_chain_of_forty_followers_is_compiled(tmp_path: Path) -> None:
    """Compile a chain in order; a coupling that would close a loop is left out."""
    hinge = '<body pos="{0} 0 0"><joint name="a{0}" axis="0 1 0"/><geom size="0.1"/></body>'
    equality = '<joint joint1="a{0}" joint2="a{1}"/>'
    bodies = "".join(hinge.format(i) for i in range(41))
    chain = "".join(equality.format(i + 1, i) for i in range(40)) + equality.format(0, 40)
    file, engine = (
        tmp_path / "g.xml",
        next(e for e in engines_reading(".xml") if ".xml" in e.compiles),
    )
    file.write_text(f"<mujoco><worldbody>{bodies}</worldbody><equality>{chain}</equality></mujoco>")
    model = engine.compiled(file)
    assert [(one.follower, one.leader) for one in model.couplings] == [
        (i + 1, i) for i in range(40)
    ]
    assert dict(model.besides)["equality constraints"] == 1


FINGERS = """<mujoco><worldbody>
<body><joint name="left" type="slide" axis="1 0 0" {0}/>
<inertial pos="0 0 0" mass="0.015" diaginertia="1e-4 2e-4 1.5e-4"/></body>
<body><joint name="right" type="slide" axis="-1 0 0" {0}/>
<inertial pos="0 0 0" mass="0.015" diaginertia="1e-4 2e-4 1.5e-4"/></body>
</worldbody><equality><joint joint1="left" joint2="right"/></equality>
<tendon><fixed name="split"><joint joint="left" coef="0.5"/>
<joint joint="right" coef="0.5"/></fixed></tendon>
<actuator><general tendon="split" biastype="affine" biasprm="0 -100 -10"/></actuator>
</mujoco>"""


@pytest.mark.parametrize(
    ("joints", "resolution", "bound"),
    [
        # The initial violation decays within one step only if the equality is stiff relative to
        # the joints' inertia, including the armature.
        ('armature="0.1" damping="1" range="0 0.04"', 1e-9, 2e-10),
        # A step of nanoseconds still limits the stiffness of the equality.
        ('damping="3000"', 1e-5, 1e-5),
    ],
)
def test_soft_equality_of_fingers_agrees(
    tmp_path: Path, joints: str, resolution: float, bound: float
) -> None:
    file = written(tmp_path, "fingers.xml", FINGERS.format(joints))
    case = run_case(model_task(prepare_tree(file, states=8), "mujoco", resolution=resolution))
    assert case.outcome is Outcome.AGREES, case.reason
    assert case.verdict is not None
    assert (case.verdict.uncertainty or 1) < bound


HIDDEN = FINGERS.format('damping="3000" range="0 0.04"').replace("-100 ", "-1e5 ")
HIDDEN = HIDDEN.replace("/></equality>", ' polycoef="0 1 0 0 0"/></equality>')
"""Motions that settle in microseconds; a soft equality leaves seven of their digits."""


def test_accelerations_decide_motions_hidden_by_a_soft_equality(tmp_path: Path) -> None:
    file = written(tmp_path, "fingers.xml", HIDDEN)
    case = run_case(model_task(prepare_tree(file, states=8), "mujoco"))
    assert case.outcome is Outcome.AGREES
    assert case.reason.startswith("its accelerations with soft equalities held exactly, at 40 ")
    assert "rounding allows no better; an equality divides the last digits" in case.reason
    assert case.forward_dynamics is not None
    assert max(one.discrepancy or 0.0 for one in case.forward_dynamics.terms) < 1e-13


@pytest.mark.parametrize(("old", "new", "term"), [
    ('polycoef="0 1', 'polycoef="1e-10 1', "equalities"),
    ('damping="3000"', 'damping="3000.00003"', "forces odd in velocity"),
])  # fmt: skip
def test_error_of_a_hundred_millionth_differs_behind_a_soft_equality(
    tmp_path: Path, old: str, new: str, term: str
) -> None:
    file = written(tmp_path, "fingers.xml", HIDDEN)
    task = model_task(prepare_tree(file, states=8), "mujoco")
    file.write_text(HIDDEN.replace(old, new))
    case = run_case(task)
    assert case.outcome is Outcome.DIFFERS, case.reason
    assert case.forward_dynamics is not None
    off = {one.name for one in case.forward_dynamics.terms if (one.discrepancy or 0) > 1e-9}
    assert term in off
