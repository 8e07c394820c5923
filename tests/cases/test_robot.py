"""Standalone robot files: read, solved, and compared with every engine that reads them."""

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pybullet_data
import pytest
from msgspec import structs

from physics_crosscheck import check
from physics_crosscheck.harness.checks.case import follow, judge, run_case
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.documents import elements
from physics_crosscheck.harness.documents.elements import xml_problem
from physics_crosscheck.harness.engines.registry import default_engines, engines
from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.readers import RobotError
from physics_crosscheck.records import Outcome, read_results
from physics_crosscheck.reference.solving.segments import Motion
from tests import commands
from tests.models import robot_task, written
from tests.robots.files import ADRIFT, TIPPED, UNLIMITED

DATA = Path(pybullet_data.getDataPath())
SUITE = (*(engine.name for engine in default_engines(".urdf")), "pinocchio")
"""Engines that the development environment installs."""

ENGINES = [name for name in SUITE if engines()[name].version() is not None]


@pytest.mark.parametrize("engine", ENGINES)
def test_correct_robot_agrees_to_ten_digits(engine: str) -> None:
    prepared = prepare_tree(DATA / "r2d2.urdf", states=8)
    case = run_case(model_task(prepared, engine))
    assert case.outcome is Outcome.AGREES, case.reason
    assert case.verdict is not None
    assert case.verdict.largest_discrepancy is not None
    assert case.verdict.largest_discrepancy < 1e-11
    assert len(prepared.names) == 8
    assert any("collision geometry" in one for one in prepared.left_out)


def test_unused_sidecar_of_a_standalone_file_is_reported(tmp_path: Path) -> None:
    for name in ("alone.urdf", "with.urdf"):
        (tmp_path / name).write_text((DATA / "cartpole.urdf").read_text())
    (tmp_path / "with.urdf.toml").write_text("[settings]\nmotors = true\n")
    remarks = [
        one
        for one in prepare_tree(tmp_path / "with.urdf", states=2).left_out
        if "with.urdf.toml" in one
    ]
    assert len(remarks) == 1
    assert not any(
        ".toml" in one for one in prepare_tree(tmp_path / "alone.urdf", states=2).left_out
    )


@pytest.fixture(scope="module")
def kuka(tmp_path_factory: pytest.TempPathFactory) -> PreparedTree:
    file = tmp_path_factory.mktemp("kuka") / "right.urdf"
    file.write_text((DATA / "kuka_iiwa" / "model.urdf").read_text())
    return prepare_tree(file, states=8)


@pytest.mark.parametrize(("engine", "old", "new"), [
    ("mujoco", '<mass value="3"/>', '<mass value="3.000003"/>'),
    ("pybullet", 'izz="0.01"', 'izz="0.0100001"'),
    ("pinocchio", 'damping="0.5"', 'damping="0.500001"'),
    ("mujoco", 'xyz="0.0003 0.059 0.042"', 'xyz="0.0003 0.0590001 0.042"'),
])  # fmt: skip
def test_number_off_by_a_millionth_differs(
    kuka: PreparedTree, tmp_path: Path, engine: str, old: str, new: str
) -> None:
    text = kuka.place.read_text()
    assert old in text
    (tmp_path / "wrong.urdf").write_text(text.replace(old, new, 1))
    case = judge(model_task(kuka, engine).with_file(tmp_path / "wrong.urdf"))
    assert case.outcome is Outcome.DIFFERS
    assert "of its displacement at the end of the segment" in case.reason


def test_inertia_dropped_by_an_engine_differs_and_names_the_link(tmp_path: Path) -> None:
    """MuJoCo drops the moments of links without mass that it welds to others, PyBullet does not."""
    file = written(tmp_path, "tipped.urdf", TIPPED)
    tipped = prepare_tree(file, states=8)
    both = ("mujoco", "pybullet")
    outcomes = {name: judge(model_task(tipped, name)).outcome for name in both}
    assert outcomes == {"mujoco": Outcome.DIFFERS, "pybullet": Outcome.AGREES}
    messages = [one.message for one in tipped.findings if one.severity == "finding"]
    assert [one for one in messages if "'tip' has inertia" in one and "no mass" in one]


def test_all_problems_of_a_file_are_reported_together() -> None:
    with pytest.raises(RobotError) as error:
        prepare_tree(DATA / "husky" / "husky.urdf")
    message = str(error.value)
    assert message.count("husky.urdf:97: ") == 2
    assert "rpy of <origin>" in message
    assert "xyz of <origin>" in message


def test_engine_with_different_joints_is_refused_with_their_names(tmp_path: Path) -> None:
    text = (DATA / "cartpole.urdf").read_text()
    file = written(tmp_path, "r.urdf", text)
    task = model_task(prepare_tree(file, states=8), ENGINES[0])
    file.write_text(text.replace("cart_to_pole", "cart_to_stick"))
    case = run_case(task)
    assert case.outcome is Outcome.REFUSED
    assert "no cart_to_pole and it has the additional cart_to_stick" in case.reason


def crosscheck(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return commands.crosscheck("run", *arguments, "--out", "out", "--jobs", "1", cwd=folder)


def test_command_line_selects_one_model_of_a_world(tmp_path: Path) -> None:
    link = "<inertial><mass>{}</mass></inertial>"
    models = "".join(
        f"<model name='{name}'><link name='{name}'>{link.format(mass)}</link></model>"
        for name, mass in (("box", 2), ("ball", 3))
    )
    (tmp_path / "w.sdf").write_text(f"<sdf version='1.9'><world name='w'>{models}</world></sdf>")
    either = crosscheck(tmp_path, "w.sdf")
    systems = read_results(tmp_path / "out" / "results.json").systems
    assert sorted(one.title.split(", ")[-1] for one in systems) == ["2 kg", "3 kg"], either.stdout
    assert "w.sdf  1 joint" in crosscheck(tmp_path, "w.sdf", "--model", "ball").stdout
    assert (
        "no moving model of the name 'bell'"
        in crosscheck(tmp_path, "w.sdf", "--model", "bell").stdout
    )


def test_two_files_of_one_folder_are_two_systems_in_the_report(tmp_path: Path) -> None:
    (tmp_path / "one.urdf").write_text(UNLIMITED)
    (tmp_path / "two.urdf").write_text(UNLIMITED.replace('"unlimited"', '"free"'))
    done = crosscheck(tmp_path, "two.urdf", "one.urdf", "--engine", "mujoco")
    assert done.returncode == 0, done.stdout + done.stderr
    results = read_results(tmp_path / "out" / "results.json")
    assert [system.name for system in results.systems] == ["free", "unlimited"]
    assert [case.model for case in results.cases] == ["two.urdf", "one.urdf"]
    page = (tmp_path / "out" / "index.html").read_text()
    assert 'href="#system-free"' in page
    assert 'href="#system-unlimited"' in page


def test_unsupported_format_is_refused_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "arm.py").write_text("")
    done = crosscheck(tmp_path, "arm.py")
    assert done.returncode == 2
    assert "arm.py: only .urdf, .sdf, .xml, .usd, .usda, .usdc and .usdz run" in done.stderr
    assert "Traceback" not in done.stderr


def test_invalid_urdf_fails_with_its_name(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text("<sdf/>")
    done = crosscheck(tmp_path, "arm.urdf")
    assert done.returncode == 3
    assert "arm.urdf" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_floating_base_with_offset_and_rotated_center_of_mass(tmp_path: Path, engine: str) -> None:
    file = written(tmp_path, "adrift.urdf", ADRIFT)
    prepared = prepare_tree(file, floating=True, states=8)
    assert prepared.names[:2] == ("hub_free:rx", "hub_free:ry"), "a joint has the link's name"
    task = model_task(prepared, engine)
    assert run_case(task).outcome is Outcome.AGREES
    for old, new in (("0.1 -0.2 0.05", "0.1 -0.2000002 0.05"), ("0.3 0.2 0.1", "0.3 0.2 0.100001")):
        file.write_text(ADRIFT.replace(old, new))
        assert judge(task).outcome is Outcome.DIFFERS, new
    assert run_case(model_task(prepare_tree(file, states=8), engine)).outcome is Outcome.AGREES


@pytest.mark.slow
def test_command_line_option_floating_frees_the_root(tmp_path: Path) -> None:
    (tmp_path / "adrift.urdf").write_text(ADRIFT)
    chosen = [word for name in ENGINES for word in ("--engine", name)]
    done = crosscheck(tmp_path, "adrift.urdf", "--floating", *chosen)
    assert done.returncode == 0, done.stdout + done.stderr
    results = read_results(tmp_path / "out" / "results.json")
    assert {case.scenario for case in results.cases} == {"floating states"}
    assert "2 joints, 2 links in 2 bodies" in done.stdout


def test_missing_file_is_reported_and_other_files_run(tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text("<sdf/>")
    (tmp_path / "arm.urdf").write_text(UNLIMITED)
    (tmp_path / "arm.skel").write_text("<sdf/>")
    names = ("bad.urdf", "missing.urdf", "arm.skel", "arm.urdf")
    done = crosscheck(tmp_path, *names, "--engine", "mujoco")
    assert done.returncode == 3
    assert (
        "crosscheck: arm.skel: only .urdf, .sdf, .xml, .usd, .usda, .usdc and .usdz run"
        in done.stderr
    )
    assert done.stderr.endswith("skipped unknown targets: missing.urdf, arm.skel\n")
    assert (
        "crosscheck: missing.urdf: there is no such file; continuing with the others" in done.stderr
    )
    results = read_results(tmp_path / "out" / "results.json")
    assert [(case.model, case.outcome) for case in results.cases] == [
        ("bad.urdf", "FAILED"), ("arm.urdf", "AGREES"),
    ]  # fmt: skip
    failed = crosscheck(tmp_path, "missing.urdf")
    assert failed.returncode == 2
    assert failed.stderr == "crosscheck: missing.urdf: there is no such file\n"


@pytest.mark.slow
def test_cause_and_tested_numbers_are_reported(tmp_path: Path) -> None:
    """MuJoCo drops the moments of links without mass."""
    (tmp_path / "tipped.urdf").write_text(TIPPED)
    done = crosscheck(tmp_path, "tipped.urdf", "--engine", "mujoco")
    assert done.returncode == 1
    top = "\n".join(done.stdout.splitlines()[:8])
    assert "cause: XC205 MuJoCo drops the inertia of massless links" in top
    assert "tipped.urdf:5 tip" in top
    assert "fix:   give the link a mass, or remove its inertia" in top
    assert "the audit finds" not in done.stdout, "the cause already explains it"
    (model,) = read_results(tmp_path / "out" / "results.json").models
    assert model.diagnosis is not None
    assert model.diagnosis.explained
    assert model.coverage is not None
    assert f"{model.coverage.seen} of {model.coverage.numbers} numbers tested" in done.stdout
    page = (tmp_path / "out" / "index.html").read_text()
    assert "moments of link[tip]/inertial/inertia" in page
    assert f"{model.coverage.seen} of {model.coverage.numbers} numbers tested" in page


def test_strict_fails_if_a_file_has_unchecked_features(tmp_path: Path) -> None:
    limit = '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>'
    (tmp_path / "arm.urdf").write_text(UNLIMITED.replace("</joint>", f"{limit}</joint>"))
    arguments = ("arm.urdf", "--engine", "mujoco")
    done = crosscheck(tmp_path, *arguments, "--strict")
    assert done.returncode == 3
    assert "--strict: arm.urdf: it has more than is checked; not compared: limits" in done.stderr
    (tmp_path / "arm.urdf").write_text(UNLIMITED)
    assert crosscheck(tmp_path, *arguments, "--strict").returncode == 0


def test_refusal_by_the_only_engine_fails_and_by_one_of_two_only_with_strict(
    tmp_path: Path,
) -> None:
    """Pinocchio's parser rejects a revolute joint without `<limit>`."""
    (tmp_path / "arm.urdf").write_text(UNLIMITED)
    both = ("arm.urdf", "--engine", "mujoco", "--engine", "pinocchio")
    done = crosscheck(tmp_path, *both)
    assert done.returncode == 0, done.stderr
    assert "1 of 2 engines refuses the file, 1 agrees to " in done.stdout
    assert "is of type REVOLUTE but it does not specify limits" in done.stdout
    refused = read_results(tmp_path / "out" / "results.json").refusals
    assert [case.engine for case in refused] == ["pinocchio"]
    strict = crosscheck(tmp_path, *both, "--strict")
    assert strict.returncode == 3
    assert "--strict: unlimited/arm.urdf/states [pinocchio]: refused: " in strict.stderr
    failed = crosscheck(tmp_path, "arm.urdf", "--engine", "pinocchio")
    assert failed.returncode == 3


@pytest.mark.parametrize(("optional", "code"), [(("pinocchio",), 0), ((), 1)])
def test_refusal_by_a_default_engine_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, optional: tuple[str, ...], code: int
) -> None:
    """Catch a green run of a file that an engine of every installation does not load."""
    file = written(tmp_path, "arm.urdf", UNLIMITED)
    results = check(file, engines=("mujoco", "pinocchio"))
    results = structs.replace(results, optional=optional)
    assert exit_code(results, require_engines=False) == code
    assert results.agree is (code == 0)


SERVO = """<mujoco><worldbody><body pos="0 0 1"><joint name="stiff" axis="0 1 0" range="-60 60"/>
<inertial pos="0 0 -0.1" mass="1e-4" diaginertia="1e-6 1e-6 1e-6"/></body></worldbody>
<actuator><position joint="stiff" kp="2" kv="{}"/></actuator></mujoco>"""


@pytest.mark.parametrize(("damping", "order", "reason"), [
    (0.15, 1, ""),
    # It settles in microseconds: weights for order 1 amplify the rounding of the position.
    (0.5, 4, "stepped by RK4, since by euler the limit of stiff has an uncertainty of"),
])  # fmt: skip
def test_stiff_servo_is_resolved(tmp_path: Path, damping: float, order: int, reason: str) -> None:
    case = run_case(robot_task(tmp_path, "servo.xml", SERVO.format(damping)))
    assert case.outcome is Outcome.AGREES
    assert case.reason.startswith(reason)
    assert case.verdict is not None
    assert case.verdict.claimed_order == order
    assert (case.verdict.largest_uncertainty or 1) < 1e-9


def test_malformed_xml_fails_before_a_worker_process_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def started(*_: object) -> None:
        raise AssertionError("a worker process was started")

    monkeypatch.setattr(Workers, "begin", started)
    monkeypatch.setattr(Workers, "submit", started)
    (tmp_path / "text.urdf").write_text("hello\n")
    (tmp_path / "empty.sdf").write_text("")
    (tmp_path / "binary.urdf").write_bytes(b"<robot>\0\1</robot>")
    (tmp_path / "text.xml").write_text("hello\n")
    (tmp_path / "cut.urdf").write_text("<robot>\n  <link>\n    <inertial>\n")
    (tmp_path / "tag.urdf").write_text("<robot>\n  <link name=")
    (tmp_path / "cut.xml").write_text("<mujoco>\n")
    (tmp_path / "none.urdf").write_text("<!-- nothing -->\n")
    files = ("cut.urdf", "tag.urdf", "cut.xml", "none.urdf")
    done = crosscheck(tmp_path, "text.urdf", "empty.sdf", "binary.urdf", "text.xml", *files)
    assert done.returncode == 3
    for line in (
        "text.urdf:1: not XML at column 1: syntax error; write well-formed XML",
        "empty.sdf:1: not XML: the file has no element; write well-formed XML",
        "binary.urdf:1: not XML at column 8: the file is binary; write well-formed XML",
        "text.xml:1: not XML at column 1: syntax error; write well-formed XML",
        "cut.urdf:3: the file ends before </robot>, inside <inertial>; restore the missing end",
        "tag.urdf:2: the file ends before </robot>; restore the missing end of the file",
        "cut.xml:1: the file ends before </mujoco>; restore the missing end of the file",
        "none.urdf:1: not XML: the file has no element; write well-formed XML",
    ):
        assert line in " ".join(done.stdout.split())


@pytest.mark.workers
def test_file_is_parsed_only_in_a_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[str] = []
    written(
        tmp_path,
        "inner.urdf",
        "<robot>\n  <link name='a'><inertial><mass value='1'/></inertial>\n</robot>\n",
    )
    monkeypatch.setattr(elements, "_parse", lambda source: parsed.append(source.file.name))
    done = crosscheck(tmp_path, "inner.urdf")
    assert done.returncode == 3
    assert "inner.urdf:3: not XML at column 3: mismatched tag; write" in " ".join(
        done.stdout.split()
    )
    assert not parsed


def test_malformed_xml_is_left_to_an_engine_that_reads_it(tmp_path: Path) -> None:
    file = written(tmp_path, "arm.xml", "before <mujoco/>")
    assert xml_problem(file, strict=False) == ""
    assert xml_problem(file, strict=True) == (
        f"{file}:1: not XML at column 1: syntax error; write well-formed XML"
    )


def test_xacro_file_is_refused_with_commands_to_convert_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)  # as without the extra
    (tmp_path / "my arm.urdf.xacro").write_text("<robot/>")
    done = crosscheck(tmp_path, "my arm.urdf.xacro")
    assert done.returncode == 2
    assert "`xacro 'my arm.urdf.xacro' > 'my arm.urdf'`, and give 'my arm.urdf'" in done.stderr


@pytest.mark.parametrize(("damping", "every_segment"), [("0.1", False), ("0.1 0.3", True)])
def test_quadratic_drag_measures_rounding_of_every_segment(
    tmp_path: Path, damping: str, every_segment: bool
) -> None:
    """Rounding differs between segments, so a sample of them is not enough."""
    file = tmp_path / "drag.xml"
    file.write_text(
        f'<mujoco><worldbody><body><joint axis="0 1 0" name="j" damping="{damping}"/>'
        '<inertial pos="0 0 -0.3" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody>'
        "</mujoco>"
    )
    task = model_task(prepare_tree(file), "mujoco")
    limits = follow(task).limits
    starts = len(task.target.samples.start)
    pairs = starts if every_segment else starts // 4
    assert limits.steps == sum(limits.rungs) * (starts + 2 * pairs)


REPLACED = """<mujoco><compiler balanceinertia="true" boundmass="0.05" boundinertia="0.02"
  settotalmass="2.1"/>
<worldbody><body name="a"><joint stiffness="-2" axis="0 1 0"/>
<inertial pos="0 0 1" mass="0.01" diaginertia="1 1 5"/>
<body name="b" pos="0 0 1"><joint damping="-0.1" armature="-0.001" axis="1 0 0"/>
<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.012 0.011"/></body></body></worldbody></mujoco>
"""

SIGNS = """<robot name="r"><mujoco><compiler boundmass="0.5"/></mujoco>
<link name="base"/><link name="a"><inertial><origin xyz="0 0 1"/><mass value="0.1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<dynamics damping="-0.5"/></joint></robot>
"""


def findings(file: Path, text: str) -> dict[str, tuple[str, int | None]]:
    file.write_text(text)
    reported = prepare_tree(file, states=8).findings
    return {
        one.message: (one.severity, one.location.line if one.location else None) for one in reported
    }


def test_masses_replaced_by_the_compiler_are_reported_with_both_values_and_line(
    tmp_path: Path,
) -> None:
    reported = findings(tmp_path / "r.xml", REPLACED)
    replaced = {
        message.removeprefix("<compiler "): (severity, line)
        for message, (severity, line) in reported.items()
        if message.startswith("<compiler ")
    }
    assert replaced == {
        "settotalmass> replaces the total mass: 1.05 kg in the file, 2.1 kg in MuJoCo": ("note", 2),
        "boundmass> replaces the mass of 1 body (a: 0.01 in the file, 0.05 in MuJoCo)": ("note", 1),
        "boundinertia> replaces the inertia of 1 body (b: 0.01 0.012 0.011 in the file,"
        " 0.02 0.02 0.02 in MuJoCo)": ("note", 1),
        "balanceinertia> replaces the inertia of 1 body (a: 1 1 5 in the file, 2.33333 2.33333"
        " 2.33333 in MuJoCo)": ("note", 1),
    }


def test_compiler_that_replaces_nothing_is_not_reported(tmp_path: Path) -> None:
    text = re.sub(r'settotalmass="[^"]*"', "", REPLACED).replace('"0.05"', '"0.001"')
    text = text.replace('"0.02"', '"0.0002"').replace('"1 1 5"', '"1 1 1"')
    assert not [one for one in findings(tmp_path / "r.xml", text) if one.startswith("<compiler")]


def test_negative_damping_stiffness_and_armature_are_reported_by_line(tmp_path: Path) -> None:
    reported = findings(tmp_path / "r.xml", REPLACED)
    signs = {place for message, place in reported.items() if "negative" in message}
    assert signs == {("note", 3), ("finding", 5)}
    assert len([message for message in reported if "negative" in message]) == 3
    assert findings(tmp_path / "r.urdf", SIGNS) == {
        "joint[j]/dynamics@damping is -0.5: negative damping adds energy to the motion. Write a"
        " positive number": ("finding", 5),
        # Other engines use the mass of the file, so MuJoCo differs from the equations.
        "<compiler boundmass> replaces the mass of 1 body (a: 0.1 in the file, 0.5 in MuJoCo)":
            ("finding", 1),
    }  # fmt: skip


def test_negative_damping_is_stepped_like_mujoco(tmp_path: Path) -> None:
    """Cover a model without a positive damper, which MuJoCo's Euler method steps explicitly."""
    case = run_case(robot_task(tmp_path, "r.xml", REPLACED))
    assert case.outcome is Outcome.AGREES
    assert case.stepping is not None
    assert case.stepping.outcome is Outcome.AGREES


def test_error_of_a_motion_from_rest_matches_a_manual_run() -> None:
    prepared = prepare_tree(DATA / "cartpole.urdf", motion=0.5, states=8)
    assert isinstance(prepared.rest, Motion)
    case = run_case(model_task(prepared, "mujoco"))
    model = mujoco.MjModel.from_xml_path(str(DATA / "cartpole.urdf"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    names = [model.joint(i).name for i in range(model.njnt)]
    start = dict(zip(prepared.names, prepared.samples.start[0], strict=False))
    data.qpos[:] = [start[name] for name in names]
    worst = 0.0
    order = [prepared.names.index(name) for name in names]
    sizes = prepared.rest.amplitude[order]
    sizes = np.maximum(sizes, 0.01 * sizes.max())
    for step in range(1, 251):
        mujoco.mj_step(model, data)
        exact = prepared.rest.states_at(np.array([step * model.opt.timestep]))[0, order]
        worst = max(worst, float(np.max(np.abs(data.qpos - exact) / sizes)))
    assert case.full_run is not None
    assert case.outcome is Outcome.AGREES
    assert case.full_run.global_error == pytest.approx(worst, rel=1e-6)
    assert case.full_run.order == pytest.approx(1.0, abs=0.01)
    # The page plots it; the verdict is at drawn states, so no defects lie on it.
    assert case.series is not None
    assert case.series.components[: len(order)] == tuple(prepared.names)
    last = [case.series.engine[place][-1] for place in order]
    assert last == pytest.approx(data.qpos, rel=1e-4)
    assert not any(case.series.defect)


def test_time_step_longer_than_the_motion_is_reported() -> None:
    prepared = prepare_tree(DATA / "cartpole.urdf", motion=0.003, states=8)
    case = run_case(model_task(prepared, "mujoco"))
    assert (case.outcome, case.full_run) == (Outcome.AGREES, None)
    assert "no motion from rest: dt = 0.002 s is too long for a motion of 0.003 s" in case.reason
