"""How Drake and DART read one SDFormat file, as listed in `docs/engines/`."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.command import AGREE, DIFFER
from physics_crosscheck.engine import EngineError, LoadedModel, ModelSpec
from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.findings import robot_findings
from physics_crosscheck.harness.checks.prepare import prepare_system, prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.modelfiles.locations import find
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.records import Cause, Outcome
from tests.engines.extras import H, need
from tests.models import written

ROOT = Path(__file__).parents[2]
NAMES = ("drake", "dart")
TURNED = "0 0 -0.5 0.3 0.2 0.1"
STRAIGHT = "0 0 -0.5 0 0 0"


def text(
    axis: str = "", *, version: str = "1.6", pose: str = STRAIGHT, ixx: str = "0.01",
    kind: str = "revolute", extra: str = "", xyz: str = "<xyz>0 -1 0</xyz>", link: str = "",
) -> str:  # fmt: skip
    return f"""<sdf version="{version}">
<model name="m"><pose>0.1 0.2 0.3 0.2 -0.1 0.4</pose>
<link name="a"><pose>0 0 1 0.3 0.1 -0.2</pose>{link}<inertial><pose>{pose}</pose><mass>0.5</mass>
<inertia><ixx>{ixx}</ixx><ixy>0.001</ixy><ixz>0.002</ixz><iyy>0.02</iyy><iyz>0.001</iyz>
<izz>0.015</izz></inertia></inertial></link>
<joint name="j" type="{kind}"><parent>world</parent><child>a</child><pose>0.1 0 0 0.2 0 0.1</pose>
<axis>{xyz}{axis}</axis></joint>{extra}</model></sdf>"""


def load(name: str, sdf: str, folder: Path, **settings: object) -> LoadedModel:
    need(name)
    path = written(folder, "m.sdf", sdf)
    values = {"step": H, "gravity": [0.3, 0.0, -9.81], **settings}
    return engines()[name].load(ModelSpec(path, settings=values))


def outcome(name: str, sdf: str, folder: Path, **settings: object) -> Outcome:
    """Return the outcome of the file alone, compared with its own equations."""
    need(name)
    path = written(folder, "robot.sdf", sdf)
    task = model_task(prepare_tree(path), name)
    return judge(task.with_settings(**settings)).outcome


BALLS = text(kind="ball", xyz="").replace("<axis></axis>", "").replace(
    "</model>",
    """<link name="b"><pose>0 0.1 0.4 0.1 -0.4 0.2</pose><inertial><pose>0 0.03 -0.2 0 0 0</pose>
<mass>0.7</mass><inertia><ixx>0.01</ixx><iyy>0.012</iyy><izz>0.005</izz></inertia></inertial></link>
<joint name="k" type="ball"><pose>0 0 0.1 0.2 0.3 -0.4</pose><parent>a</parent><child>b</child>
<axis><dynamics><damping>0.02</damping></dynamics></axis></joint></model>""",
)  # fmt: skip
UNIVERSAL = BALLS.replace('"ball"', '"universal"').replace("</child><pose>0.1", "</child>"
    "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 1 0</xyz></axis2><pose>0.1").replace(
    "<axis><dyn", "<axis2><xyz>0 0.6 0.8</xyz><dynamics><damping>0.02</damping></dynamics></axis2>"
    "<axis><xyz>1 0 0</xyz><dyn")  # fmt: skip
SCREW = (
    BALLS.replace('"ball"', '"screw"')
    .replace(
        "</child><pose>0.1",
        "</child><axis><xyz>0 0.6 0.8</xyz></axis><thread_pitch>-8</thread_pitch><pose>0.1",
    )
    .replace("<axis><dyn", "<screw_thread_pitch>0.3</screw_thread_pitch><axis><xyz>1 0 0</xyz><dyn")
)
LOOSE = BALLS.replace(BALLS[BALLS.index('<joint name="j"') : BALLS.index('<link name="b"')], "")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("sdf", "old", "new"), [
    (BALLS, "", ""), (LOOSE, "", ""), (BALLS, "<mass>0.7", "<mass>0.707"),
    (BALLS, "0 0 0.1 0.2", "0 0 0.1001 0.2"), (BALLS, "<damping>0.02", "<damping>0.0201"),
    (UNIVERSAL, "", ""), (UNIVERSAL, "0 0.6 0.8", "0 0.8 0.6"),
    (SCREW, "", ""), (SCREW, "-8", "8"), (SCREW, ">0.3<", ">0.301<"),
])  # fmt: skip
def test_joints_of_several_axes_match_the_equations_unless_a_number_differs(
    name: str, sdf: str, old: str, new: str, tmp_path: Path
) -> None:
    need(name)
    path = written(tmp_path, "robot.sdf", sdf)
    prepared = prepare_tree(path, states=8)
    assert prepared.tree.nv == {BALLS: 6, LOOSE: 9, UNIVERSAL: 4, SCREW: 2}[sdf]
    path.write_text(sdf.replace(old, new, 1))
    dart = dict.fromkeys(("exact_turns", "ball_damping", "screw_pitches"), True)
    settings = dart if name == "dart" else {}
    task = model_task(prepared, name).with_settings(**settings)
    assert judge(task).outcome is (Outcome.DIFFERS if old else Outcome.AGREES)


@pytest.mark.parametrize(("sdf", "cause"), [
    (BALLS, "<damping> of ball joints (k)"),
    (SCREW, "own pitch of screws, <thread_pitch> in m per turn or 0.1 (j, k)"),
])  # fmt: skip
def test_number_that_dart_misreads_is_named(sdf: str, cause: str, tmp_path: Path) -> None:
    need("dart")
    task = model_task(prepare_tree(written(tmp_path, "r.sdf", sdf), states=8), "dart")
    explanations = diagnose_robot(task, is_reference=True).explanations
    causes = {str(one) for each in explanations for one in each.causes}
    assert any(cause in one for one in causes), causes


def test_joint_that_closes_a_loop_is_a_fault_in_dart(tmp_path: Path) -> None:
    need("dart")
    tree = written(tmp_path, "tree.sdf", BALLS)
    again = BALLS[BALLS.index('<joint name="k"') :].replace('"k"', '"z"')
    loop = written(tmp_path, "loop.sdf", BALLS.replace("</model></sdf>", again))
    faults = [one.message for one in robot_findings(read_robot(loop)) if one.severity == "finding"]
    assert faults == ["DART leaves out joint z, which closes a loop"]
    assert cli.main(["compare", str(loop), str(tree), "--engine", "dart"]) == DIFFER


DYNAMICS = (
    "<dynamics><damping>0.02</damping><spring_stiffness>3</spring_stiffness>"
    "<spring_reference>0.2</spring_reference></dynamics>"
)
IN_MODEL = "<use_parent_model_frame>1</use_parent_model_frame><xyz>0.1 -1 0.2</xyz>"


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "sdf",
    [
        text(DYNAMICS),
        text(DYNAMICS, kind="prismatic", xyz="<xyz>1 0.2 -0.4</xyz>"),
        text(xyz=IN_MODEL),
        text(version="1.4", xyz="<xyz>0.1 -1 0.2</xyz>"),  # in the model's frame
        text(
            version="1.9", xyz='<xyz expressed_in="__model__">0.1 -1 0.2</xyz>', kind="continuous"
        ),
        text(xyz=""),
    ],
    ids=["spring of a hinge", "spring of a slide", "in the model", "1.4", "1.9", "no axis"],
)
def test_poses_axes_springs_and_dampers_follow_the_format(
    name: str, sdf: str, tmp_path: Path
) -> None:
    assert outcome(name, sdf, tmp_path) is Outcome.AGREES


def test_dart_ignores_rotations_of_inertials_unless_set(tmp_path: Path) -> None:
    sdf = text(pose=TURNED)
    assert outcome("drake", sdf, tmp_path) is Outcome.AGREES
    assert outcome("dart", sdf, tmp_path) is Outcome.DIFFERS
    ((cause, remedy),) = load("dart", sdf, tmp_path).corrective_settings.items()
    assert "<inertial>s that are turned as if they were not (a)" in cause
    assert outcome("dart", sdf, tmp_path, **remedy) is Outcome.AGREES
    assert not load("dart", sdf, tmp_path, **remedy).corrective_settings
    assert not load("dart", text(), tmp_path).corrective_settings


@pytest.mark.parametrize(("name", "falls"), [("drake", True), ("dart", False)])
def test_link_without_gravity_falls_in_drake(name: str, falls: bool, tmp_path: Path) -> None:
    sdf = text(link="<gravity>false</gravity>")
    expected = Outcome.DIFFERS if falls else Outcome.AGREES
    assert outcome(name, sdf, tmp_path) is expected
    model = load(name, sdf, tmp_path)
    warned = any("Unsupported value for SDFormat element gravity" in one for one in model.warnings)
    assert warned is falls
    causes = ["Drake's ignoring of <gravity>false</gravity> (a)"] if falls else []
    assert list(model.corrective_settings) == causes


@pytest.mark.parametrize("stepping", ["sap", "tamsi", "continuous"])
@pytest.mark.parametrize("held", [True, False])
def test_setting_compensates_gravity_of_a_link_in_drake(
    stepping: str, held: bool, tmp_path: Path
) -> None:
    sdf = text(link="<gravity>false</gravity>")
    if not held:  # a floating root that carries the link
        base = "<link name='b'><inertial><mass>0.7</mass></inertial></link>"
        sdf = sdf.replace("<parent>world", "<parent>b").replace("<link ", f"{base}<link ", 1)
    settings = {"stepping": stepping, "weightless_links": True}
    assert outcome("drake", sdf, tmp_path, stepping=stepping) is Outcome.DIFFERS
    assert outcome("drake", sdf, tmp_path, **settings) is Outcome.AGREES
    assert not load("drake", sdf, tmp_path, **settings, floating=not held).corrective_settings


@pytest.mark.parametrize("name", NAMES)
def test_limits_act(name: str, tmp_path: Path) -> None:
    sdf = text("<limit><lower>-0.5</lower><upper>0.5</upper></limit>")
    still = {"gravity": [0.0, 0.0, 0.0]}
    z, v = np.array([[0.495]]), np.array([[1.0]])
    stopped = load(name, sdf, tmp_path, **still)
    assert stopped.limits.tolist() == stopped.sampling_range.tolist() == [[-0.5, 0.5]]
    assert stopped.rollout(z, v, H, 1000, None, 1000)[0][0, 0, 0] < 0.51
    smooth = load(name, sdf, tmp_path, smooth=True, **still)
    assert not np.isfinite(smooth.limits).any()
    assert smooth.rollout(z, v, H, 1000, None, 1000)[0][0, 0, 0] == pytest.approx(0.595, abs=1e-6)


def test_versions_that_dart_cannot_read_are_rejected_by_line(tmp_path: Path) -> None:
    sdf = text(version="1.9").replace("<pose>0 0 1", '<pose degrees="true">0 0 1')
    with pytest.raises(EngineError, match=r"m\.sdf:3: DART reads SDFormat to version 1\.6"):
        load("dart", sdf, tmp_path)
    assert outcome("drake", sdf, tmp_path) is Outcome.AGREES


def test_drake_replaces_an_impossible_inertia_by_a_ball(tmp_path: Path) -> None:
    with pytest.raises(
        EngineError, match=r"a ball of 0\.5 kg for the impossible inertia of link 'a'"
    ):
        load("drake", text(ixx="0.5"), tmp_path)
    assert load("dart", text(ixx="0.5"), tmp_path).coordinates == ("j",)


FOLLOWER = (
    "<link name='b'><inertial><mass>0.1</mass></inertial></link><joint name='k' type='revolute'>"
    "<parent>world</parent><child>b</child><axis><xyz>0 1 0</xyz><mimic joint='j'>"
    "<multiplier>2</multiplier></mimic></axis></joint>"
)


@pytest.mark.parametrize(("name", "stepping", "held"), [
    ("drake", "sap", True), ("drake", "tamsi", False),
])  # fmt: skip
def test_mimic_is_written_in_drakes_syntax(
    name: str, stepping: str, held: bool, tmp_path: Path
) -> None:
    sdf = text(version="1.11", extra=FOLLOWER)
    model = load(name, sdf, tmp_path, stepping=stepping)
    still = np.zeros((1, 2))
    z, _ = model.rollout(still, still, H, 500, None, 500)
    j, k = (z[0, 0, model.coordinates.index(one)] for one in ("j", "k"))
    assert abs(j) > 1e-5
    assert bool(abs(k - 2 * j) < 1e-3 * abs(j)) is held
    assert bool(model.corrective_settings) is not held


@pytest.mark.parametrize("name", NAMES)
def test_file_sets_step_and_gravity_unless_the_sidecar_does(name: str, tmp_path: Path) -> None:
    need(name)
    path = tmp_path / "m.sdf"
    world = "<gravity>0 0 -3</gravity><physics type='ode'><max_step_size>0.005</max_step_size>"
    inner = text().split("\n", 1)[1].removesuffix("</sdf>")
    path.write_text(f"<sdf version='1.6'><world name='w'>{world}</physics>{inner}</world></sdf>")
    engine = engines()[name]
    plain = engine.load(ModelSpec(path))
    assert (plain.step, plain.gravity) == (0.005, (0.0, 0.0, -3.0))
    changed = engine.load(ModelSpec(path, settings={"gravity": [0, 0, -5], "step": 0.001}))
    assert (changed.step, changed.gravity) == (0.001, (0.0, 0.0, -5.0))
    with pytest.raises(EngineError, match="floating contradicts the file"):
        engine.load(ModelSpec(path, settings={"floating": True}))
    path.write_text(text())
    with pytest.raises(EngineError, match="must set step: the file does not"):
        engine.load(ModelSpec(path))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("old", "new", "message"), [
    ("</sdf>", "<model name='n'/></sdf>", ":7: it has 2 models that move"),
    ("</model>", "<include/></model>", ":7: <include> is not covered; write what it includes"),
    ("</model>", "<model name='n'/></model>", ":7: <model> is not covered; write the links"),
    ("revolute", "gearbox", ":6: joint 'j' is of type 'gearbox', which no engine reads"),
    ("<mass>0.5", "<mass>0.5 kg", ":3: <mass> of link 'a' is '0.5 kg'; expected a finite number"),
    ("</model>", "<link name='b'/></model>", "no joint holds 'b'"),
    ("<mass>0.5", "<mass>inf", ":3: <mass> of link 'a' is 'inf'; expected a finite number"),
    ("<axis><xyz>0 -1 0</xyz></axis>", "", ":6: joint 'j' has no <axis>"),
])  # fmt: skip
def test_unsupported_content_is_rejected_by_line(
    name: str, old: str, new: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(EngineError) as error:
        load(name, text().replace(old, new), tmp_path)
    assert message in str(error.value)


@pytest.mark.parametrize("name", NAMES)
def test_equal_copies_of_an_element_count_once(name: str, tmp_path: Path) -> None:
    sdf = text("<limit><velocity>inf</velocity></limit>")
    assert outcome(name, sdf, tmp_path) is Outcome.AGREES
    sdf = sdf.replace("<mass>0.5</mass>", "<mass>0.5</mass><mass> 0.5 </mass>")
    assert outcome(name, sdf, tmp_path) is Outcome.AGREES


def diagnosed(folder: Path, engine: str) -> Cause:
    """Return the first cause of the only model's difference."""
    prepared = prepare_system(folder)
    (sidecar,) = model_files(folder)
    assert isinstance(sidecar, Sidecar)
    diagnosis = diagnose_model(model_task(prepared, engine, sidecar))
    assert diagnosis.explained
    (cause,) = diagnosis.explanations[0].causes
    return cause


@pytest.mark.parametrize(("address", "value"), [
    ("link[pendulum]/inertial/mass", "0.47"), ("link[pendulum]/inertial/pose[2]", "-0.77"),
])  # fmt: skip
def test_wrong_number_is_named_with_its_line(address: str, value: str, tmp_path: Path) -> None:
    need("dart")
    folder = tmp_path / "simple_pendulum"
    folder.mkdir()
    for name in ("system.py", "robot.sdf", "robot.sdf.toml"):
        shutil.copy(ROOT / "models" / "simple_pendulum" / name, folder)
    file = folder / "robot.sdf"
    place = find(file, [address])[address]
    data = file.read_bytes()
    file.write_bytes(data[: place.start] + value.encode() + data[place.end :])
    cause = diagnosed(folder, "dart")
    assert (cause.kind, cause.subject) == ("literal", (address,))
    assert [one.line for one in cause.locations] == [place.line]


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("effort", ["", "<effort>9</effort>", "<effort>0</effort>"])
def test_rotors_are_equations_of_the_file_in_drake(
    effort: str, smooth: bool, tmp_path: Path
) -> None:
    rotor = "<drake:rotor_inertia>0.5</drake:rotor_inertia><drake:gear_ratio>3</drake:gear_ratio>"
    sdf = text(f"<limit>{effort}</limit>").replace("</joint>", rotor + "</joint>")
    sdf = sdf.replace("<sdf ", '<sdf xmlns:drake="http://drake.mit.edu" ')
    assert outcome("drake", sdf, tmp_path, smooth=smooth) is Outcome.AGREES
    without = outcome("drake", sdf, tmp_path, smooth=smooth, rotors=False)
    assert without is (Outcome.AGREES if "0" in effort else Outcome.DIFFERS)


def test_dart_evaluates_springs_and_dampers_at_the_end_of_a_step(tmp_path: Path) -> None:
    rules = [load("dart", text(axis), tmp_path).step_rule for axis in ("", DYNAMICS)]
    assert [rule and rule.name for rule in rules] == [
        "semi-implicit Euler",
        "semi-implicit Euler, springs and dampers at the step's end",
    ]
    none, both = rules
    assert none is not None
    assert both is not None
    assert none.stiffness is none.damping is None
    np.testing.assert_array_equal([both.stiffness, both.damping], [[[3.0]], [[0.02]]])


def shaped(inertial: str = '<inertial auto="true"/>') -> str:
    """Return a link of two shapes, of which the second is rotated."""
    shapes = """<collision name="c"><pose>0.1 0 -0.3 0 0 0</pose><geometry><box><size>0.1 0.2 0.3
</size></box></geometry></collision><collision name="d"><pose>0 0.2 -0.5 0.4 0.5 0.6</pose>
<density>700</density><geometry><cone><radius>0.1</radius><length>0.4</length></cone></geometry>
</collision>"""
    return (
        f'<sdf version="1.11"><model name="m"><link name="a">{inertial}{shapes}</link><joint name'
        '="j" type="revolute"><parent>world</parent><child>a</child><axis><xyz>0.1 -1 0.2</xyz>'
        "</axis></joint></model></sdf>"
    )


@pytest.mark.parametrize("sdf", [
    shaped(), shaped('<inertial auto="1"><density>300</density><mass>5</mass></inertial>'),
])  # fmt: skip
def test_dart_ignores_an_automatic_inertia_that_drake_computes(sdf: str, tmp_path: Path) -> None:
    assert outcome("drake", sdf, tmp_path) is Outcome.AGREES
    assert outcome("dart", sdf, tmp_path) is Outcome.DIFFERS
    ((cause, remedy),) = load("dart", sdf, tmp_path).corrective_settings.items()
    assert cause == 'DART\'s own 1 kg and 1 kg m^2 for <inertial auto="true"> (a)'
    assert outcome("dart", sdf, tmp_path, **remedy) is Outcome.AGREES


def test_automatic_ball_of_water_is_a_valid_inertia_in_drake(tmp_path: Path) -> None:
    ball = "<collision name='c'><pose>0 0 1 0 0 0</pose><geometry><sphere/></geometry></collision>"
    sdf = (
        text().replace("<inertial>", '<inertial auto="true">').replace("</link>", ball + "</link>")
    )
    for tag in ("pose", "mass", "inertia"):
        start, end = (sdf.index(f"{part}{tag}>", sdf.index("<inertial")) for part in ("<", "</"))
        sdf = sdf[:start] + sdf[end + len(tag) + 3 :]
    assert outcome("drake", sdf, tmp_path) is Outcome.AGREES


def test_dart_assumes_other_moments_of_a_mass_without_inertia(tmp_path: Path) -> None:
    bare = "<inertial><mass>3</mass><pose>0 0 -0.4 0 0 0</pose></inertial>"
    assert outcome("drake", shaped(bare), tmp_path) is Outcome.AGREES
    assert outcome("dart", shaped(bare), tmp_path) is Outcome.DIFFERS
    ((cause, remedy),) = load("dart", shaped(bare), tmp_path).corrective_settings.items()
    assert cause == "DART's own moments, mass times 1 m^2, without <inertia> (a)"
    assert outcome("dart", shaped(bare), tmp_path, **remedy) is Outcome.AGREES


@pytest.mark.parametrize("name", NAMES)
def test_model_of_a_world_is_selected_by_name(name: str, tmp_path: Path) -> None:
    inner = text().split("\n", 1)[1].removesuffix("</sdf>")
    ground = "<model name='g'><static>1</static><link name='l'/></model>"
    other = "<model name='n'><link name='free'/></model>"
    include = "<include><uri>model://sun</uri></include>"
    whole = f"<sdf version='1.6'><world name='w'>{ground}{include}{inner}{{}}</world></sdf>"
    assert load(name, whole.format(""), tmp_path).coordinates == ("j",)
    assert load(name, whole.format(other), tmp_path, model="m").coordinates == ("j",)
    assert load(name, whole.format(other), tmp_path, model="n").coordinates[0] == "free:x"
    with pytest.raises(EngineError, match="it has no moving model of the name 'g'"):
        load(name, whole.format(other), tmp_path, model="g")
    with pytest.raises(EngineError, match="model is 3; expected a name"):
        load(name, whole.format(other), tmp_path, model=3)


@pytest.mark.parametrize("name", ["bench.sdf", "bench.world"])
def test_each_model_of_a_world_is_accepted_and_gated(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catch a model whose edit, or removal, the gate of its file doesn't see."""
    need("drake")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    model = text(version="1.9").partition("\n")[2].removesuffix("</sdf>")
    both = model + model.replace('name="m"', 'name="n"')
    file = written(tmp_path, name, f'<sdf version="1.9"><world name="w">{both}</world></sdf>')
    accept = ["accept", name, "--engine", "drake", "--reason", "right"]
    assert cli.main(accept) == AGREE
    assert "Accepted 1 case of bench.n.sdf" in capsys.readouterr().out
    accepted = file.read_text()
    before, _, last = accepted.rpartition("<ixx>0.01")
    for edit, seen in (
        (accepted, "2 cases as accepted (0 run"),
        (f"{before}<ixx>0.02{last}", f"{name}:8 ixx of link a 0.01 -> 0.02"),
        (accepted.replace('name="n"', 'name="k"'), "2 of 3 cases: 1 gone, 1 new"),
    ):
        file.write_text(edit)
        code = AGREE if edit == accepted else DIFFER
        assert cli.main(["gate", name, "--engine", "drake"]) == code
        assert seen in capsys.readouterr().out
