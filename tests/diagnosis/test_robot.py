"""Robot files with a wrong number: detected, and named with its line and correct value."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.case import judge, run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.robot_problem import inertia_of
from physics_crosscheck.harness.diagnosis.robot_task import (
    diagnose_robot,
    problem_of,
    robot_problem,
)
from physics_crosscheck.harness.engines.registry import engines, engines_reading
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.records import CauseId, Diagnosis, Outcome
from tests.models import robot_task, written
from tests.robots.files import TIP, TIPPED, joint


def _data() -> Path:
    """Return the folder of PyBullet's robots; skips without it."""
    package = pytest.importorskip("pybullet_data", reason="comes with PyBullet")
    return Path(package.getDataPath())


ARM = """<robot name="arm">
<link name="base"/>
<joint name="pan" type="continuous"><parent link="base"/><child link="post"/>
  <origin xyz="0 0 0.3" rpy="0.2 0.1 0"/><axis xyz="0.1 0 1"/><dynamics damping="0.7"/></joint>
<link name="post"><inertial><origin xyz="0.02 0.01 0.1"/><mass value="2.5"/>
  <inertia ixx="0.04" ixy="0.003" ixz="-0.002" iyy="0.05" iyz="0.001" izz="0.03"/></inertial></link>
<joint name="lift" type="revolute"><parent link="post"/><child link="beam"/>
  <origin xyz="0.1 0.05 0.4" rpy="0 0.4 0.1"/><axis xyz="0 1 0.2"/>
  <limit lower="-2" upper="2" effort="0" velocity="0"/></joint>
<link name="beam"><inertial><origin xyz="0.2 0.02 0.03" rpy="0.3 0.1 0.2"/><mass value="1.5"/>
  <inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.04" iyz="0" izz="0.045"/></inertial></link>
<joint name="reach" type="prismatic"><parent link="beam"/><child link="hand"/>
  <origin xyz="0.3 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="0" velocity="0"/>
  <dynamics damping="1.5"/></joint>
<link name="hand"><inertial><origin xyz="0.03 0.01 0"/><mass value="0.4"/>
  <inertia ixx="0.001" ixy="0.0002" ixz="0" iyy="0.002" iyz="0" izz="0.002"/></inertial></link>
</robot>
"""

MJCF = """<mujoco>
<compiler angle="radian"/>
<option gravity="0 0 -9.81"/>
<default><joint damping="0.3"/><default class="heavy"><geom density="2500"/></default></default>
<include file="limbs.xml"/>
</mujoco>
"""

LIMBS = """<mujocoinclude><worldbody>
<body pos="0 0 1"><joint name="a" axis="0.2 1 0" armature="0.02"/>
  <geom type="capsule" fromto="0 0 0 0.1 0.05 -0.4" size="0.04"/>
  <body pos="0.1 0.05 -0.4" euler="0.3 0.2 0.1">
    <joint name="b" axis="1 0 0.3" damping="0.1" stiffness="2" springref="0.2"/>
    <geom class="heavy" type="box" size="0.05 0.08 0.2" pos="0.02 0.03 -0.2"/>
    <body pos="0 0 -0.4"><joint name="c" type="slide" axis="0 0.3 1"/>
      <inertial pos="0.05 0 -0.1" mass="0.6" fullinertia="0.004 0.005 0.006 0.001 0.0005 0.0002"/>
    </body></body></body>
</worldbody></mujocoinclude>
"""


def simplify(text: str) -> str:
    """Return the text with axes along coordinates and no products of inertia."""
    text = text.replace('"0.1 0 1"', '"0 0 1"').replace('"0 1 0.2"', '"0 1 0"')
    return re.sub(r'(i(?:xy|xz|yz))="[^"]*"', r'\1="0"', text)


def diagnose_change(
    file: Path, old: str, new: str, engine: str, changed: Path | None = None
) -> Diagnosis:
    """Change a number of a file, and diagnose it with the original equations."""
    changed = changed or file
    task = model_task(prepare_tree(file, states=8), engine)
    text = changed.read_text()
    assert text.count(old) == 1
    changed.write_text(text.replace(old, new))
    verdict = judge(task)
    assert verdict.outcome is Outcome.DIFFERS, verdict.reason
    return diagnose_robot(task, is_reference=False)


def check_named(
    diagnosis: Diagnosis, address: str, line: int, file: str, right: float, wrong: float
) -> None:
    assert diagnosis.explained
    first = diagnosis.explanations[0]
    alike = (first.causes[0].id, *first.tied_with)
    assert CauseId(kind="literal", subject=(address,)) in alike
    (cause,) = next(e.causes for e in diagnosis.explanations if e.causes[0].subject == (address,))
    assert [(one.file, one.line) for one in cause.locations] == [(file, line)]
    assert cause.nominal == pytest.approx(wrong, rel=1e-12)
    assert cause.estimate is not None
    assert abs(cause.estimate - right) < 1e-3 * abs(wrong - right)


URDF_FAULTS = {
    'mass value="1.5"': ("link[beam]/inertial/mass@value", 10),
    'damping="0.7"': ("joint[pan]/dynamics@damping", 4),
}
MJCF_FAULTS = {
    'joint damping="0.3"': ("default/joint@damping", 4, "arm.xml"),
    'euler="0.3 0.2 0.1"': ("@euler[2]", 4, "limbs.xml"),
}
NUMBERS = {"@euler[2]": "0.1"}


def perturb(attribute: str, address: str, share: float) -> tuple[str, float, float]:
    """Return an attribute with a relative error, and the right and wrong number."""
    ending = [number for key, number in NUMBERS.items() if address.endswith(key)]
    number = ending[0] if ending else attribute.split('"')[1]
    wrong = float(number) * (1 + share)
    head, _, tail = attribute.rpartition(number)
    return f"{head}{wrong!r}{tail}", float(number), wrong


@pytest.mark.parametrize(("attribute", "engine", "share"), [
    ('mass value="1.5"', "pybullet", 1e-2), ('damping="0.7"', "mujoco", 1e-6),
])  # fmt: skip
def test_wrong_number_of_a_urdf_is_named(
    tmp_path: Path, engine: str, attribute: str, share: float
) -> None:
    file = tmp_path / "arm.urdf"
    # PyBullet does not normalize axes, and computes principal axes to a few digits only.
    file.write_text(ARM if engine == "mujoco" else simplify(ARM))
    if attribute not in file.read_text() or not engines()[engine].version():
        pytest.skip("not for this engine")
    address, line = URDF_FAULTS[attribute]
    new, right, wrong = perturb(attribute, address, share)
    diagnosis = diagnose_change(file, attribute, new, engine)
    check_named(diagnosis, address, line, "arm.urdf", right, wrong)


@pytest.mark.parametrize(("attribute", "engine", "share"), [
    pytest.param('joint damping="0.3"', "pinocchio", 1e-2, marks=pytest.mark.slow),
    ('euler="0.3 0.2 0.1"', "mujoco", 1e-6),
])  # fmt: skip
def test_wrong_number_of_an_mjcf_or_an_included_file_is_named(
    tmp_path: Path, engine: str, attribute: str, share: float
) -> None:
    if not engines()[engine].version():
        pytest.skip(f"{engine} is not installed")
    file = written(tmp_path, "arm.xml", MJCF)
    (tmp_path / "limbs.xml").write_text(LIMBS)
    address, line, name = MJCF_FAULTS[attribute]
    new, right, wrong = perturb(attribute, address, share)
    diagnosis = diagnose_change(file, attribute, new, engine, tmp_path / name)
    first = diagnosis.explanations[0].causes[0].subject[0]
    check_named(diagnosis, first, line, name, right, wrong)
    assert first.endswith(address)


@pytest.mark.slow
def test_ignored_inertias_are_reported_with_all_lines(tmp_path: Path) -> None:
    """Cover two massless welded links, whose inertia MuJoCo drops."""
    file = tmp_path / "tipped.urdf"
    weld = joint("weld", "rod", "tip", kind="fixed")
    again = TIP.replace('"tip"', '"end"') + weld.replace('"weld"', '"again"').replace("tip", "end")
    file.write_text(TIPPED.replace("</robot>", f"\n{again}</robot>"))
    task = model_task(prepare_tree(file, states=8), "mujoco")
    diagnosis = diagnose_robot(task, is_reference=True)
    assert diagnosis.explained
    sentence = cause_sentences(diagnosis.explanations[0])[0]
    assert sentence == (
        "moments of link[tip]/inertial/inertia, moments of link[end]/inertial/inertia"
        " (tipped.urdf:5, tipped.urdf:6): in the file, but 0 in the engine"
    )


@pytest.mark.slow
def test_slopes_match_finite_differences(tmp_path: Path) -> None:
    file = written(tmp_path, "arm.urdf", ARM)
    task = model_task(prepare_tree(file, states=8), engines_reading(".urdf")[0].name)
    problem, _ = robot_problem(task, is_reference=True)
    slopes = problem.slopes({})
    for i, hypothesis in enumerate(problem.hypotheses):
        if hypothesis.switch:
            continue
        step = 1e-4 * hypothesis.size
        both = problem.defect({i: -step}) - problem.defect({i: step})
        off = np.max(np.abs(both / (2 * step) - slopes[i]))
        assert off <= 1e-3 * np.max(np.abs(slopes[i])) + 1e-8 / hypothesis.size, hypothesis.id
        # The place of the first joint has no effect, since gravity is uniform.
        if hypothesis.id.subject[0].startswith("joint[pan]/origin@xyz"):
            assert not slopes[i].any()


@pytest.mark.slow
def test_engine_default_is_named() -> None:
    """Cover PyBullet's principal axes of full tensors; every number of the file is correct."""
    file = _data() / "aliengo" / "aliengo.urdf"
    task = model_task(prepare_tree(file, states=8), "pybullet")
    assert judge(task).outcome is Outcome.DIFFERS
    diagnosis = diagnose_robot(task, is_reference=True)
    assert diagnosis.explained
    (explanation,) = diagnosis.explanations
    (cause,) = explanation.causes
    assert cause.kind == "default"
    assert "principal axes of trunk, FR_hip" in str(cause)
    assert explanation.remaining < 1e-3


def test_axis_that_is_not_a_unit_vector_is_named(tmp_path: Path) -> None:
    """Cover an axis with six digits, whose length PyBullet does not normalize."""
    file = tmp_path / "arm.urdf"
    file.write_text(
        ARM.replace('xyz="0.1 0 1"', 'xyz="0 0 1"').replace("0 1 0.2", "0 0.6 0.800001")
    )
    task = model_task(prepare_tree(file, states=8), "pybullet")
    assert judge(task).outcome is Outcome.DIFFERS
    causes = diagnose_robot(task, is_reference=True).explanations[0].causes
    assert "length of the axes of lift, up to 8.0e-07 off 1" in "".join(map(str, causes))
    both = task.with_settings(unit_axes=True, exact_axes=True)
    assert run_case(both).outcome is Outcome.AGREES
    assert run_case(task).accepted.endswith("length of the axes of lift")
    file.write_text(file.read_text().replace("0.800001", "0.800002"))
    assert not run_case(model_task(prepare_tree(file, states=8), "pybullet")).accepted


NEARLY = """<mujoco><worldbody><body><joint name="a" axis="0 1 0" pos="0 0 0.3"/>
<inertial pos="{} 0 0" mass="1" diaginertia="0.01 0.012 0.01"/></body></worldbody></mujoco>"""


def test_center_of_mass_that_mujoco_rounds_to_the_origin_is_named(tmp_path: Path) -> None:
    """Cover `body_sameframe`: MuJoCo uses the body frame if the inertial frame is near."""
    file = written(tmp_path, "near.xml", NEARLY.format("9e-7"))
    task = model_task(prepare_tree(file, states=8), "mujoco")
    assert judge(task).outcome is Outcome.DIFFERS
    (explanation,) = diagnose_robot(task, is_reference=True).explanations
    assert "frames within 1e-6" in str(explanation.causes[0])
    exact = task.with_settings(exact_frames=True)
    assert run_case(exact).outcome is Outcome.AGREES
    file.write_text(NEARLY.format("1.1e-6"))
    assert run_case(model_task(prepare_tree(file, states=8), "mujoco")).outcome is Outcome.AGREES


TURNED = """<mujoco><worldbody><body pos="0 0 1"><joint name="a" axis="0 1 0.2"/>
<joint name="b" axis="1 0 0"/><geom type="capsule" size="0.05"
fromto="0 {} 0 0.1 0 -0.3"/><body pos="0 0.01 -0.4"><joint name="c" axis="1 0.3 0"/>
<geom type="capsule" size="0.05" fromto="{} 0 0 0 0 -0.3"/></body></body></worldbody></mujoco>"""


@pytest.mark.slow
def test_partly_ignored_number_is_named_with_the_engine_default(tmp_path: Path) -> None:
    """Shift a capsule and rotate it by 3e-6 rad; MuJoCo ignores the rotation."""
    file = written(tmp_path, "turned.xml", TURNED.format("0", "0"))
    task = model_task(prepare_tree(file, states=8), "mujoco")
    file.write_text(TURNED.format("0", "5e-7"))
    assert judge(task).outcome is Outcome.DIFFERS
    diagnosis = diagnose_robot(task, is_reference=False)
    assert diagnosis.explained
    number, hidden = diagnosis.explanations[0].causes
    assert number.subject[0].endswith("@fromto[0]")
    assert [one.line for one in number.locations] == [4]
    assert number.nominal == 5e-7
    assert abs(number.estimate or 0.0) < 1e-9
    assert "frames within 1e-6" in str(hidden)


def body(name: str, place: str, rest: str, joint: str = "") -> str:
    return (
        f'<body name="{name}" pos="{place}"{rest}><joint name="{name}" axis="0 1 0" {joint}/>\n'
        '<inertial pos="0.02 0 -0.3" mass="1" diaginertia="0.1 0.11 0.05"/>'
    )


SPLIT = f"""<mujoco><worldbody>
{body("a", "0 0 0", "")}{body("c", "0 0 -0.5", "")}</body></body>
{body("b", "0 1 0", "")}</body></worldbody>
<tendon><fixed name="t" armature="0.2" stiffness="3" springlength="0.1">
<joint joint="a" coef="1"/><joint joint="b" coef="-0.7"/><joint joint="c" coef="0.4"/></fixed>
</tendon></mujoco>"""

LIFTED = f"""<mujoco><worldbody>
{body("a", "0 0 0", ' gravcomp="1"', 'actuatorgravcomp="true"')}
{body("b", "0 0 -0.5", ' gravcomp="0.5"')}</body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("text", "cause", "line"),
    [
        (SPLIT, "armature of a tendon across branches couples no joints", 7),
        (LIFTED, "actuatorgravcomp without an actuator compensates no gravity", 2),
    ],
)
def test_element_that_mujoco_ignores_is_named_with_its_line(
    tmp_path: Path, text: str, cause: str, line: int
) -> None:
    file = written(tmp_path, "r.xml", text)
    prepared = prepare_tree(file, states=8)
    task = model_task(prepared, "mujoco")
    assert judge(task).outcome is Outcome.DIFFERS
    diagnosis = diagnose_robot(task, is_reference=True)
    assert diagnosis.explained
    (explanation,) = diagnosis.explanations
    (named_cause,) = explanation.causes
    assert named_cause.subject == (cause,)
    assert [(str(file), line)] == [(where.file, where.line) for where in named_cause.locations]
    assert explanation.remaining < 1e-9
    (remark,) = prepared.findings
    assert (remark.severity, remark.location) == ("finding", named_cause.locations[0])


ACTUATED = '<actuator><motor joint="b"/></actuator></mujoco>'


@pytest.mark.parametrize("text", [
    SPLIT.replace('<joint joint="b" coef="-0.7"/>', ""), LIFTED.replace("</mujoco>", ACTUATED),
], ids=["tendon along one branch", "compensation by an actuator"])  # fmt: skip
def test_element_that_mujoco_applies_agrees(tmp_path: Path, text: str) -> None:
    task = robot_task(tmp_path, "r.xml", text)
    assert run_case(task).outcome is Outcome.AGREES
    assert not task.target.findings


def test_engine_default_is_not_a_cause_if_motions_agree(tmp_path: Path) -> None:
    """If a file differs in poses or whole steps only, no default needs to be switched off."""
    follows = '<equality><joint joint1="a" joint2="b" polycoef="0 0.5 0 0 0"/></equality>'
    (tmp_path / "limbs.xml").write_text(LIMBS)
    task = robot_task(tmp_path, "arm.xml", MJCF.replace("</mujoco>", f"{follows}</mujoco>"))
    assert task.load()[0].corrective_settings
    diagnosis = diagnose_robot(task, is_reference=True)
    assert (diagnosis.explained, diagnosis.explanations) == (False, ())
    assert diagnosis.failure == "no motion differs beyond its uncertainty"


SHAPED = """<robot name="spun">
<mujoco>{}</mujoco>
<link name="base"/>
<joint name="a" type="continuous"><parent link="base"/><child link="arm"/>
<axis xyz="0 {} 0"/></joint><link name="arm"><inertial><origin xyz="0 0 0.2"/><mass value="0.9"/>
<inertia ixx="0.012" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.001"/></inertial>
<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>
</robot>"""


def test_masses_that_an_engine_needs_are_its_cause(tmp_path: Path) -> None:
    """Catch a diagnosis that ends where PyBullet can't move a joint without its own 1 kg."""
    led = """<mimic joint="lead"/></joint><link name="bare"/><joint name="lead" type="continuous">
<parent link="base"/><child link="bare"/><axis xyz="0 1 0"/></joint>"""
    text = SHAPED.format("", 1).replace("</joint>", led, 1)
    diagnosis = diagnose_robot(robot_task(tmp_path, "r.urdf", text, "pybullet"), is_reference=True)
    assert [str(cause) for cause in diagnosis.explanations[0].causes][:1] == ["mass of bare"]


@pytest.mark.parametrize(
    ("extension", "axis", "engine", "causes"),
    [
        ('<compiler inertiafromgeom="true"/>', 1, "mujoco",
         [('<compiler inertiafromgeom="true">, line 2 (arm 0.9 kg in the file, 3 kg in MuJoCo)')]),
        ('<compiler boundmass="2" eulerseq="xyz"/><option density="500"/>', 1, "mujoco",
         ['<compiler boundmass="2">, line 2 (arm 0.9', '<option density="500">, line 2']),
        ('<option><flag gravity="disable"/></option>', 1, "mujoco", ['<flag gravity="disable">']),
        ("", 0.01, "pybullet", ["length of the axes of a, 0.01 instead of 1"]),
    ],
)  # fmt: skip
def test_settings_of_an_engine_are_tried_before_fits(
    tmp_path: Path, extension: str, axis: float, engine: str, causes: list[str]
) -> None:
    """Also where the motion is so wrong that its uncertainty is unknown."""
    file = written(tmp_path, "spun.urdf", SHAPED.format(extension, axis))
    task = model_task(prepare_tree(file, states=8), engine)
    (explanation,) = diagnose_robot(task, is_reference=True).explanations
    for cause, expected in zip(explanation.causes, causes, strict=True):
        assert expected in str(cause)


def test_compiled_bodies_exclude_causes_that_fit_alike(tmp_path: Path) -> None:
    file = written(tmp_path, "arm.urdf", ARM)
    task = model_task(prepare_tree(file, states=8), engines_reading(".urdf")[0].name)
    problem = problem_of(task, robot_numbers(file, {}), is_reference=True)
    stated = dict(enumerate(map(inertia_of, problem.flow.tree.links)))
    mass = next(i for i, h in enumerate(problem.hypotheses) if "mass@value" in str(h.id))
    same = replace(problem, compiled=stated)
    assert problem.effect(mass) is not None
    assert same.effect(mass) is None
    value = problem.hypotheses[mass].value
    heavier = {i: one._replace(mass=1.2 * one.mass) for i, one in stated.items()}
    other = replace(problem, compiled=heavier)
    assert other.is_read({mass: 0.2 * value}) is True
    assert other.is_read({mass: 0.4 * value}) is False
    assert problem.is_read({mass: 0.2 * value}) is None
    assert np.all(problem.defect({mass: -2 * value}) == 1e6)
    assert not np.any(problem.defect({mass: 0.2 * value}) == 1e6)
