"""Numbers of the laws, read from the text of a file, against a compiler that misreads them."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.engine import CompiledTree, ModelSpec
from physics_crosscheck.harness.checks import whole_step
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.whole_step import check_whole_step
from physics_crosscheck.harness.engines.mjcf_defaults import Defaults
from physics_crosscheck.harness.engines.mjcf_source import read_source_mjcf
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.misread import ReadingCheck, check_reading
from physics_crosscheck.harness.modelfiles.mjcf.read import law_model
from physics_crosscheck.records import Outcome
from tests.laws.scenes import CONNECT, DRIVES, LIMITS, PAIR, TOUCH, WELD

pytest.importorskip("mujoco")

CLASSES = """<mujoco><compiler autolimits="false"/><option timestep="0.002" cone="elliptic"/>
<default><geom friction=".8 .02 .003" solimp=".8 .9 .01"/><position kp="30" kv="2"/>
<default class="arm"><joint range="-60 40" limited="true" frictionloss=".1" margin=".01"/>
<geom friction=".6" condim="4"/><position forcerange="-9 9" forcelimited="true"/>
<default class="hand"><joint range="-10 20" solreflimit=".03"/></default></default></default>
<worldbody><geom type="plane" size="3 3 .1"/><body childclass="arm" pos="0 0 1">
<joint name="a" axis="0 1 0"/><geom size=".1" friction=".5"/><frame childclass="hand">
<body pos="0 0 .3"><joint name="b" axis="1 0 0" range="-15 30"/><geom size=".08"/>
<body pos="0 0 .2"><joint name="c" type="slide" class="main"/><geom size=".05" class="main"/>
</body></body></frame></body></worldbody><contact><exclude body1="world" body2="world"/></contact>
<actuator><position class="arm" joint="a"/><position class="arm" joint="b" kp="50"/>
<position joint="a" kp="40" dampratio="1.2"/><position joint="b" inheritrange=".8"
 ctrllimited="true"/><position joint="c" timeconst=".05"/><motor joint="c" gear="3"/></actuator>
</mujoco>""".replace('<contact><exclude body1="world" body2="world"/></contact>', "")

PLACES = """<mujoco><option integrator="implicitfast"/><worldbody><body pos="1 0 0">
<inertial mass="2" pos=".1 .2 .3" diaginertia=".3 .2 .1"/><geom size=".1"/></body>
<body><inertial mass="3" pos="0 0 -.5" quat="1 1 0 0" diaginertia=".3 .2 .1"/>
<joint name="a" axis="0 1 0" pos="0 .4 0" range="-9 9"/><frame pos="0 0 1"><joint pos="0 .1 0"/>
</frame>
<geom size=".1" mass="7"/></body></worldbody></mujoco>"""
"""A body that stands still, and hinges whose places along their axes move nothing."""

FRAMES = """<mujoco><compiler eulerseq="zyx"/><default><mesh scale="2 1 1"/>
<geom quat="0 1 0 0"/></default><asset><mesh file="m.obj"/>
<mesh name="n" file="m.obj" refpos="0 1 0"/></asset>
<worldbody><body euler="10 20 30" pos="0 0 2"><joint axis="0 1 0" range="-9 9"/>
<inertial pos="0 0 .1" mass="2" axisangle="1 2 3 40" diaginertia=".03 .02 .04"/>
<geom type="mesh" mesh="m"/><geom type="mesh" mesh="n" class="main"/>
<geom size=".1 .2" type="capsule" zaxis="1 2 .5"/>
<body xyaxes="1 1 0 -1 1 .3" pos="1 0 0"><joint axis="1 0 0"/>
<inertial pos=".1 0 0" mass="1" fullinertia=".03 .02 .04 .001 .002 -.003"/>
<geom size=".1 .1 .2" type="box" quat="2 0 1 0" mass="0"/></body></body></worldbody></mujoco>"""
"""Orientations in all forms of the format, and a mesh of a class."""

ALIGNED = """<mujoco><compiler alignfree="true"/><worldbody><geom type="plane" size="3 3 .1"/>
<body euler="10 20 30"><freejoint/>
<inertial pos=".1 .02 .03" mass="1" fullinertia=".03 .02 .04 .001 .002 -.003"/>
<geom type="box" size=".1 .2 .3" pos=".1 0 0"/></body><body pos="2 0 0"><freejoint align="false"/>
<geom size=".1" pos=".1 0 0"/><body><joint range="-9 9"/><geom size=".1" mass="1"/></body></body>
</worldbody></mujoco>"""
"""A free body whose frame the compiler moves to its principal axes, and one that it leaves."""

JOINTS = """<mujoco><default><default class="c"><geom type="box" size=".1 .2 .3"/>
<joint damping=".5"/></default></default><option gravity="0 1 -9" {}/><worldbody>
<body><joint name="a" axis="0 3 4" springref="20" ref="10" stiffness="2 .1" armature=".1"/>
<geom class="c" size=".15"/><geom type="capsule" fromto="0 0 0 .1 .2 .3" size=".05"/>
<site name="s" pos=".1 0 0" size=".01"/><body pos="0 0 1"><joint name="b" type="slide" class="c"
 range="-1 1"/><geom size=".1"/></body></body></worldbody><tendon><fixed stiffness="3"
 damping=".2" springlength=".4"><joint joint="a" coef="1"/></fixed></tendon></mujoco>"""

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

SCENES = {
    "classes": CLASSES, "places": PLACES, "frames": FRAMES, "aligned": ALIGNED, "drives": DRIVES,
    "limits": LIMITS, "joints": JOINTS, "connect": CONNECT, "weld": WELD, "pair": PAIR,
    **{f"touch {dimension}": scene for dimension, scene in TOUCH.items()},
    "pair twice": PAIR.replace("<pair ", '<pair geom1="box" geom2="floor" condim="1"/><pair '),
}  # fmt: skip


def compiled(tmp_path: Path, text: str) -> CompiledTree:
    """Compile a text."""
    copy = tmp_path / "copy.xml"
    copy.write_text(text)
    (tmp_path / "m.obj").write_text(MESH)
    return engines()["mujoco"].compiled(copy)


def reading(tmp_path: Path, text: str, loaded: str = "") -> ReadingCheck:
    """Compare a text with the numbers that another text compiles to."""
    file, tree = tmp_path / "scene.xml", compiled(tmp_path, loaded or text)
    file.write_text(text)
    model = law_model(tree)
    assert model is not None
    return check_reading(file, tree, model)


@pytest.mark.parametrize("scene", SCENES)
def test_file_states_what_it_compiles_to(tmp_path: Path, scene: str) -> None:
    """Catch a rule of the format that is read wrong, and false alarms."""
    check = reading(tmp_path, SCENES[scene].format('integrator="implicitfast"'))
    assert check.misread == ()
    assert check.compared > 30
    named = ("between sites", "follow from shapes", "contents of meshes", "within <frame>")
    assert not [one for one in check.unread if not any(word in one for word in named)]


FIELDS = {"solreflimit": "solref_limit", "solimplimit": "solimp_limit",
          "solreffriction": "solref_friction", "solimpfriction": "solimp_friction"}  # fmt: skip
ARRAYS = {
    "geom": ("friction", "solref", "solimp"), "site": ("size",), "equality": ("solref", "solimp"),
    "joint": (*FIELDS, "stiffness", "damping"), "general": ("gear", "dynprm", "gainprm", "biasprm"),
    "tendon": (*FIELDS, "stiffness", "damping", "springlength"),
    "pair": ("friction", "solref", "solimp", "solreffriction"),
}  # fmt: skip
"""Arrays of which the format accepts the first numbers, by default element."""


@pytest.mark.parametrize(("tag", "key"), [(tag, key) for tag in ARRAYS for key in ARRAYS[tag]])
def test_first_numbers_overwrite_those_of_a_class(tmp_path: Path, tag: str, key: str) -> None:
    """Catch an array whose other numbers are not those that the compiler takes."""
    partial, file = dict.fromkeys(ARRAYS, "") | {tag: f'{key}="0.5"'}, tmp_path / "arrays.xml"
    file.write_text(f"""<mujoco><default><{tag} {key}="0.3 0.4"/></default><worldbody>
<geom name="f" size=".1"/><body name="b"><geom name="g" size=".1" {partial["geom"]}/>
<joint name="j" {partial["joint"]}/><site {partial["site"]}/></body></worldbody>
<tendon><fixed {partial["tendon"]}><joint joint="j" coef="1"/></fixed></tendon>
<equality><weld body1="b" {partial["equality"]}/></equality>
<contact><pair geom1="f" geom2="g" {partial["pair"]}/></contact>
<actuator><general joint="j" {partial["general"]}/></actuator></mujoco>""")
    spec = pytest.importorskip("mujoco").MjSpec.from_file(str(file))
    kind = {"equality": "equalities", "general": "actuators"}.get(tag, f"{tag}s")
    last = getattr(spec, kind)[-1]
    values = getattr(last, key if hasattr(last, key) else FIELDS[key]).ravel().tolist()[:2]
    source = read_source_mjcf(file)
    element = next(one for one in source.root.iter() if one.get(key) == "0.5")
    chain = Defaults(source).chain(element, "", (tag,))
    assert chain.numbers(key, (0.0, 0.0)) == pytest.approx(values)
    words = [float(word) for word in chain.attributes[key].split()]
    assert [words[0], words[-1]] == pytest.approx(values)


def test_drive_without_a_law_is_not_misread(tmp_path: Path) -> None:
    text = DRIVES.format("").replace('<motor joint="a"', '<general gaintype="user" joint="a"')
    check = reading(tmp_path, text)
    assert check.misread == ()
    assert any("drives" in one for one in check.unread)


MISREAD = {
    "degrees": (CLASSES, "<compiler ", '<compiler angle="radian" ', "range of joint a"),
    "nested class": (CLASSES, 'solreflimit=".03"', 'solreflimit=".02"', "solreflimit of joint b"),
    "range over class": (CLASSES, "-15 30", "-15 31", "range of joint b"),
    "first numbers of a class": (CLASSES, '".5"', '".5 .005"', "friction of geom #1"),
    "class of a frame": (CLASSES, ' childclass="hand">', ">", "solreflimit of joint b"),
    "class of nothing": (CLASSES, '"main"/><geom', '"arm"/><geom', "limit of joint"),
    "automatic limit": (CLASSES, ' limited="true" f', ' limited="false" f', "range of joint a"),
    "shortcut of a class": (CLASSES, 'kp="30"', 'kp="31"', "gainprm of position #0"),
    "damping ratio": (CLASSES, "1.2", "1.3", "biasprm of position #2"),
    "inherited range": (CLASSES, '".8"\n ctrl', '".7"\n ctrl', "ctrlrange of position #3"),
    "time constant": (CLASSES, '.05"/><motor', '.06"/><motor', "dynprm of position #4"),
    "gear": (CLASSES, 'gear="3"', 'gear="-3"', "gear of motor #5"),
    "cone": (CLASSES, "elliptic", "pyramidal", "cone of options"),
    "friction": (TOUCH[3], 'friction=".7', 'friction=".7000001', "friction of geom floor"),
    "condim": (TOUCH[3], 'condim="3"', 'condim="4"', "condim of geom floor"),
    "frictionloss": (LIMITS, 'frictionloss=".4"', "", "frictionloss of joint a"),
    "tendon range": (LIMITS, "-.02 .02", "-.02 .03", "range of fixed f"),
    "polycoef": (CONNECT, ".1 .5", ".1 .6", "polycoef of joint #0"),
    "muscle": (DRIVES, 'force="30"', 'force="31"', "gainprm of muscle #7"),
    "pair": (PAIR, 'solref=".03 .9"', "", "solref of pair #0"),
    "place along an axis": (PLACES, '"0 .4 0"', '"0 .4000001 0"', "pos of joint a"),
    "mass of a fixed body": (PLACES, '"2"', '"2.000001"', "mass of inertial #0"),
    "centre of a fixed body": (PLACES, '".1 .2 .3"', '".1 .3 .2"', "pos of inertial #0"),
    "moments": (PLACES, '".3 .2 .1"/>\n', '".2 .3 .1"/>\n', "diaginertia of inertial #1"),
    "order of angles": (FRAMES, ' eulerseq="zyx"', "", "quat of body #0"),
    "angle about an axis": (FRAMES, "3 40", "3 41", "quat of inertial #0"),
    "products of inertia": (FRAMES, ".002 -.003", ".002 -.003001", "fullinertia of inertial #1"),
    "axes that are not orthogonal": (FRAMES, "-1 1 .3", "-1 1 .4", "quat of body #1"),
    "orientation of a class": (FRAMES, '"0 1 0 0"', '"0 1 0 .001"', "quat of geom #0"),
    "axis of a shape": (FRAMES, '"1 2 .5"', '"1 2 .50001"', "quat of geom #2"),
    "length of a quaternion": (FRAMES, '"2 0 1 0"', '"1 0 1 0"', "quat of geom #3"),
    "scale of a class of meshes": (FRAMES, '"2 1 1"', '"1 2 1"', "scale of mesh #0"),
    "size": (JOINTS, '".15"', '".150001"', "size of geom #0"),
    "size of a class": (JOINTS, ".2 .3", ".2 .31", "size of geom #0"),
    "length between points": (JOINTS, "0 .1 .2", "0 .1 .200001", "size of geom #1"),
    "size of a site": (JOINTS, ".01", ".02", "size of site s"),
    "place of a site": (JOINTS, '".1 0 0"', '".11 0 0"', "pos of site s"),
    "damping of a class": (JOINTS, ".5", ".51", "damping of joint b"),
    "stiffness": (JOINTS, '"2 .1"', '"2 .11"', "stiffness of joint a"),
    "springref": (JOINTS, "20", "21", "springref of joint a"),
    "ref": (JOINTS, '"10"', '"11"', "ref of joint a"),
    "axis": (JOINTS, "0 3 4", "0 4 3", "axis of joint a"),
    "armature": (JOINTS, 'ture=".1"', 'ture=".2"', "armature of joint a"),
    "gravity": (JOINTS, "0 1 -9", "0 1 -9.1", "gravity of options"),
    "springlength": (JOINTS, '".4"', '".41"', "springlength of fixed #0"),
    "damping of a tendon": (JOINTS, '".2"', '".21"', "damping of fixed #0"),
    "inertias of shapes": (
        PLACES,
        "<option",
        '<compiler inertiafromgeom="true"/><option',
        "mass of inertial #1",
    ),
}


@pytest.mark.parametrize("fault", MISREAD)
def test_misread_number_is_named_with_its_line(tmp_path: Path, fault: str) -> None:
    """Catch a misreading that the compiler's law and the engine share."""
    scene, right, wrong, subject = MISREAD[fault]
    scene = scene.format("")
    assert right in scene
    check = reading(tmp_path, scene, scene.replace(right, wrong, 1))
    lines = {one.subject: one.line for one in check.misread}
    assert subject in lines
    tag = subject.partition(" of ")[2].partition(" ")[0]
    place = scene.splitlines()[lines[subject] - 1] if lines[subject] else ""
    assert f"<{tag}" in place or tag in ("options", "joint")


def test_misreading_that_both_sides_share_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catch a verdict that trusts the compiler, which the engine and its law share."""
    file, wrong = tmp_path / "scene.xml", LIMITS.format("").replace("-5 10", "-5 11")
    file.write_text(LIMITS.format(""))
    tree = compiled(tmp_path, wrong)

    class Misreading:
        def compiled(self, _: Path) -> CompiledTree:
            return tree

    monkeypatch.setattr(whole_step, "compiler", lambda suffix: Misreading())
    check = check_whole_step(file, ModelSpec(tmp_path / "copy.xml"), "mujoco", 1e-9)
    assert check is not None
    assert check.record.outcome is Outcome.AGREES  # the steps
    assert check.record.differs
    (sentence,) = check.record.misread
    assert sentence.startswith("range of joint a is -0.0872664625997 0.174532925199 by the file")
    (task,) = [model_task(prepare(file, states=4), "mujoco")]
    monkeypatch.setattr(whole_step, "engines", engines)
    case = run_case(task)
    assert case.outcome is Outcome.DIFFERS
    assert case.reason.startswith("scene.xml:1: range of joint a")
    assert [place.line for place in case.locations] == [1]
