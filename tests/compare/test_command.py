"""The command `compare`, also for laws of rows and drives."""

import io
import re
import subprocess
from pathlib import Path

import pytest
from rich.console import Console

from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.render.terminal.comparison import print_comparison
from physics_crosscheck.records import ComparisonResult, Outcome
from tests import commands
from tests.compare.arm import MJCF
from tests.compare.asking import changed, compared, laws, model, result
from tests.compare.test_acting import SOFT, URDF
from tests.models import written
from tests.report.page import Page
from tests.robots.files import LAMP

ROOT = Path(__file__).parents[2]

MODEL = """names = ["a"]
M = [[2.0]]
C = [[0.5]]
K = [[40.0]]
W = [0.0]
step = 0.002
method = "euler"
claims = 1
"""


def crosscheck(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return commands.crosscheck("compare", *arguments, cwd=cwd, known_engine=True)


def test_difference_exits_1_and_is_printed_and_recorded(tmp_path: Path) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    other = changed(tmp_path / "new", path, ("0.024 0.024 0.0001", "0.024 0.024012 0.0001"))
    done = crosscheck(path, other, "--json", "out/record.json", cwd=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "motions differ by 1.4e-04" in done.stdout
    assert "body[rod]/inertial@diaginertia[1]: 0.024, new/mujoco.xml:59: 0.024012" in done.stdout
    done = crosscheck(path, other, "--details", "--json", "out/record.json", cwd=tmp_path)
    assert "link rod: principal moments of inertia (0.0001, 0.024, 0.024) in A" in done.stdout
    line = next(
        i for i, text in enumerate(path.read_text().splitlines(), 1) if "0.024 0.024" in text
    )
    first, fix, *_, last = done.stdout.splitlines()
    assert last == "Explain a code: crosscheck explain XC320"
    address = "body[rod]/inertial@diaginertia[1]"
    # Both files have one name, so that folders are needed.
    a, b = f"drum_pendulum/mujoco.xml:{line}", f"new/mujoco.xml:{line}"
    assert first.startswith(f"FAIL  XC320 {a} {address}: 0.024, {b}: 0.024012")
    assert first.endswith("(100 % of the difference)")
    assert fix == f"Fix: set {a} to 0.024012, or {b} to 0.024"
    record = decoded((tmp_path / "out" / "record.json").read_bytes(), ComparisonResult)
    assert record.outcome is Outcome.DIFFERS
    assert list(record.models[0].gravity or ()) == [0, 0, -9.81]
    comparison = record.compared
    assert comparison is not None
    assert [(one.kind, one.about) for one in comparison.properties] == [("inertia", "rod")]
    assert comparison.explained is not None
    assert comparison.explained > 0.999
    assert comparison.terms == ()
    assert str(comparison.differences[0].edits[0].where_a).endswith(f"mujoco.xml:{line}")
    assert comparison.runs.count > comparison.runs.driven > 0
    assert [one.case for one in record.models] == [None, None]  # sidecars add to the files
    assert "Report: reports/compare.html" in done.stdout
    lines = Page((tmp_path / "reports" / "compare.html").read_text()).lines("overview")
    assert lines[1] == f"{a} {address}: 0.024, {b}: 0.024012 (100 % of the difference)"
    assert any(row.startswith("| principal moments of inertia of link rod") for row in lines), lines


def test_engine_that_alters_its_file_is_named_with_the_line(tmp_path: Path) -> None:
    """PyBullet gives 1 kg to a link without <inertial>; MuJoCo does not."""
    path = ROOT / "docs" / "cases" / "leg.urdf"
    engines = ("--engine-a", "mujoco", "--engine-b", "pybullet")
    done = crosscheck(path, path, *engines, "--json", "record.json", cwd=tmp_path)
    lines = done.stdout.splitlines()
    begin = lines.index("each engine against the equations of its own file")
    assert lines[0].startswith("FAIL  XC320 leg.urdf in pybullet: XC207 PyBullet's own 1 kg ")
    assert lines[begin + 1].startswith("ok  leg.urdf in mujoco: difference ")
    record = decoded((tmp_path / "record.json").read_bytes(), ComparisonResult)
    cases = [one.case for one in record.models]
    assert [one.outcome for one in cases if one] == [Outcome.AGREES, Outcome.DIFFERS]


def test_first_lines_name_both_places_and_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path, "a.xml", MJCF)
    written(tmp_path, "b.xml", MJCF, ('damping="0.07"', 'damping="0.08"'))
    monkeypatch.chdir(tmp_path)
    comparison = compared("a.xml", "b.xml")
    cause = (
        "FAIL XC320 a.xml:6 joint[shoulder]@damping: 0.07, b.xml:6: 0.08 (100 % of the difference)"
    )
    fix = "Fix: set a.xml:6 to 0.08, or b.xml:6 to 0.07"
    for width in (60, 80, 120):
        text = io.StringIO()
        print_comparison(Console(file=text, width=width, highlight=False, emoji=False), comparison)
        lines = text.getvalue().splitlines()
        top = " ".join(" ".join(lines[:8]).split())
        assert top.startswith(f"{cause} {fix} motions differ by")
        assert all(len(line) <= width for line in lines)


def test_comments_and_white_space_are_no_difference_and_exit_0(tmp_path: Path) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    other = changed(
        tmp_path / "new",
        path,
        ("Example 2.5", "Fig. 7"),
        ('mass="0.8" ', '\n   mass="0.80"\t'),
        ("0 0 -0.3", " 0  0.0\n -3e-1"),
    )
    done = crosscheck(path, other, "--json", "record.json", cwd=tmp_path)
    assert (done.returncode, done.stdout[:4]) == (0, "ok  "), done.stdout + done.stderr
    comparison = decoded((tmp_path / "record.json").read_bytes(), ComparisonResult).compared
    assert comparison is not None
    assert comparison.differences == ()


def test_range_that_no_run_reaches_differs_by_its_law(tmp_path: Path) -> None:
    for name, end in (("a.xml", "90"), ("b.xml", "91")):
        written(tmp_path, name, LAMP, ('name="hinge"', f'name="hinge" range="-90 {end}"'))
    done = crosscheck("a.xml", "b.xml", cwd=tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "range[1] of joint hinge: " in done.stdout
    assert "motions without such forces are alike" in done.stdout
    assert "joint limits" not in done.stdout
    assert "not compared: limits" not in done.stdout


def test_brief_table_comes_first_and_minor_differences_last(tmp_path: Path) -> None:
    changes = [('mass="0.35"', 'mass="0.36"'), ('damping="0.07"', 'damping="0.08"'),
               ("0.041", "0.04100008"), ("0.039", "0.03900008")]  # fmt: skip
    friction = ('name="elbow"', 'name="elbow" frictionloss="0.2"')
    for name, edits in (("a.xml", [friction]), ("b.xml", changes)):
        written(tmp_path, name, MJCF, *edits)
    text = io.StringIO()
    comparison = compared(tmp_path / "a.xml", tmp_path / "b.xml")
    console = Console(file=text, width=80, highlight=False, emoji=False)
    print_comparison(console, comparison, details=False)
    top = "\n".join(text.getvalue().splitlines()[:8])
    words = (
        r"A:\d+, B:\d+  link hand: mass",
        r"damping of joint shoulder",
        r"friction\w* of joint",
    )
    assert all(re.search(word, top) for word in words), top
    assert re.search(r"minor differences? .*\nFix: ", text.getvalue()), text.getvalue()


def test_similar_differences_and_rounding_take_one_line_each(tmp_path: Path) -> None:
    joints = re.findall(r'<joint name="\w+"', MJCF)
    armature = [(joint, f'{joint} armature="0.01"') for joint in joints]
    numbers = ("0.041", "0.039", "0.017", "0.0008")
    other = [(number, f"{float(number) * (1 + 2e-6):.10g}") for number in numbers]
    written(tmp_path, "a.xml", MJCF)
    written(tmp_path, "b.xml", MJCF, *armature, *other, ('mass="0.35"', 'mass="0.36"'))
    text = io.StringIO()
    comparison = compared(tmp_path / "a.xml", tmp_path / "b.xml")
    print_comparison(Console(file=text, width=300, highlight=False, emoji=False), comparison)
    printed = [line.strip() for line in text.getvalue().splitlines()]
    row = re.compile(r".*armature of joints (\w+, ){2}\w+: 0 in A, 0.01 in B")
    mass = next(i for i, line in enumerate(printed) if "link hand: mass 0.35 in A" in line)
    # The verdict names an armature, with 55 % of the difference.
    assert any(map(row.fullmatch, printed[:mass]))
    assert any(line.endswith("(below 1e-5), see --json") for line in printed)


def test_crash_of_an_engine_exits_3_and_is_reported(tmp_path: Path) -> None:
    a = written(tmp_path, "a.known", MODEL)
    b = written(tmp_path, "b.known", MODEL + "[fault]\nsegfault = 1\n")
    done = crosscheck(a, b, "--json", "record.json", cwd=tmp_path)
    assert done.returncode == 3, done.stdout + done.stderr
    assert done.stdout.startswith("ERROR  XC604 ")
    assert f"{b} [known]: the process died (SIGSEGV)" in done.stdout
    record = decoded((tmp_path / "record.json").read_bytes(), ComparisonResult)
    assert record.outcome is Outcome.FAILED
    assert "SIGSEGV" in record.reason
    assert record.compared is None


def test_wrong_usage_exits_2_in_one_line(tmp_path: Path) -> None:
    done = crosscheck(model("simple_pendulum", "mujoco.xml"), "b.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "crosscheck: b.xml: there is no such file\n"


def test_joints_without_a_match_exit_2_in_one_line(tmp_path: Path) -> None:
    a = written(tmp_path, "a.known", MODEL)
    b = written(tmp_path, "b.known", MODEL, ('"a"', '"swing"'))
    done = crosscheck(a, b, cwd=tmp_path)
    assert done.returncode == 2
    assert "--joints a=swing" in done.stderr
    assert done.stderr.count("\n") == 1


def test_rejected_files_fail_before_a_worker_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def started(*_: object) -> None:
        raise AssertionError("a worker process was started")

    monkeypatch.setattr(Workers, "submit", started)
    for name, text in {
        "a.urdf": "<!DOCTYPE r [<!ENTITY a 'b'>]><robot/>", "b.urdf": "hello", "c.xml": "",
    }.items():  # fmt: skip
        (tmp_path / name).write_text(text)
    for first, second, message in (
        ("a.urdf", "b.urdf", "a.urdf:1: refused: it declares entities or a DTD"),
        ("b.urdf", "a.urdf", "b.urdf:1: not XML at column 1: syntax error; write well-formed XML"),
        ("c.xml", "a.urdf", "c.xml:1: not XML: the file has no element; write well-formed XML"),
    ):
        done = commands.crosscheck("compare", first, second, cwd=tmp_path)
        assert (done.returncode, done.stderr) == (3, f"crosscheck: {message}\n")


HOPPER = """<mujoco>
<compiler angle="radian"/>
<default><joint frictionloss="0.4" solreflimit="0.03 1"/></default>
<worldbody><geom name="floor" type="plane" size="5 5 1" friction="0.5"/>
<body name="trunk" pos="0 0 0.3"><freejoint/><geom name="trunk" type="sphere" size="0.1" mass="2"/>
<body name="leg" pos="0 0 -0.1">
<joint name="hip" axis="0 1 0" range="-0.5 0.5"/>
<geom name="foot" type="capsule" fromto="0 0 0 0 0 -0.17" size="0.03" mass="0.5" friction="0.8"/>
</body></body></worldbody>
<actuator>
<position name="servo" joint="hip" kp="30" kv="1" forcerange="-4 4"/>
</actuator></mujoco>"""


def hoppers(folder: Path, old: str, new: str) -> tuple[Path, Path]:
    return written(folder, "a.xml", HOPPER), written(folder, "b.xml", HOPPER, (old, new))


@pytest.mark.parametrize(("old", "new", "message", "line"), [
    ('friction="0.8"', 'friction="0.7"', "friction[0] of geom foot: 0.8 in A, 0.7 in B", 8),
    ('solreflimit="0.03 1"', 'solreflimit="0.03 0.9"',
     "solreflimit[1] of joint hip: 1 in A, 0.9 in B", 3),
    ('range="-0.5 0.5"', "", "range of joint hip: (-0.5 0.5) in A, none in B", 7),
    ('"-4 4"', '"-4 4.1"', "forcerange[1] of actuator servo: 4 in A, 4.1 in B", 11),
    ('angle="radian"/>', 'angle="radian"/><option cone="elliptic"/>',
     "cone of options: pyramidal in A, elliptic in B", 0),
])  # fmt: skip
def test_one_number_of_the_laws_is_named_with_its_line(
    old: str, new: str, message: str, line: int, tmp_path: Path
) -> None:
    """Catch a number of the laws that compare skips or gives no effect."""
    (row,) = laws(*hoppers(tmp_path, old, new))
    assert row.message == message
    assert row.effect is not None
    assert row.effect > 1e-7
    if line:
        assert row.where_a is not None
        assert row.where_a.line == line


@pytest.mark.parametrize(("new", "outcome"), [("0.4", Outcome.AGREES), ("0.9", Outcome.DIFFERS)])
def test_number_is_a_difference_if_it_has_an_effect(
    new: str, outcome: Outcome, tmp_path: Path
) -> None:
    """Catch a verdict from numbers that no contact uses: the larger friction acts."""
    floor = 'size="5 5 1" friction="{}"'
    comparison = compared(*hoppers(tmp_path, floor.format("0.5"), floor.format(new)))
    (row,) = result(comparison).laws or ()
    assert comparison.outcome is outcome
    assert bool(result(comparison).decisive) == bool(row.effect) == (outcome is Outcome.DIFFERS)


def test_equal_files_have_no_different_laws(tmp_path: Path) -> None:
    assert not laws(*hoppers(tmp_path, 'name="trunk" type', 'name="trunk" rgba="1 0 0 1" type'))


@pytest.mark.parametrize(("old", "new", "message"), [
    ('upper="1"', 'upper="0.9"', "range[1] of joint shoulder: 0.9 in A, 1 in B"),
    ('effort="20"', 'effort="19"', "forcerange of actuator on shoulder"),
    ('effort="20"', 'effort="20"', ""),
])  # fmt: skip
@pytest.mark.parametrize("is_first", [True, False])
def test_limits_of_a_urdf_are_compared_with_those_of_an_mjcf(
    old: str, new: str, message: str, is_first: bool, tmp_path: Path
) -> None:
    """Catch limits of rigid and soft joints that compare leaves out or invents."""
    pytest.importorskip("pybullet")
    urdf = written(tmp_path, "a.urdf", URDF, (old, new)), "pybullet"
    mjcf = written(tmp_path, "b.xml", SOFT), "mujoco"
    (a, engine_a), (b, engine_b) = (urdf, mjcf) if is_first else (mjcf, urdf)
    rows = laws(a, b, engine_a, engine_b)
    if not message:
        assert not rows
        return
    (row,) = rows
    effort = "effort of joint shoulder" if is_first else message
    swapped = "range[1] of joint shoulder: 1 in A, 0.9 in B" if not is_first else message
    assert row.message.startswith(effort if "actuator" in message else swapped)
    assert row.effect
    assert row.where_a is not None
    assert row.where_b is not None


LEG = """<robot name="leg"><link name="body"><contact><lateral_friction value="0.6"/></contact>
<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="knee" type="revolute"><parent link="body"/><child link="shin"/>
<origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
<limit lower="-0.3" upper="0.4" effort="20" velocity="9"/></joint>
<link name="shin"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.1 0.1 0.2"/></geometry></collision></link></robot>"""


@pytest.mark.parametrize(("old", "new", "message", "line"), [
    ('value="0.6"', 'value="0.5"', "lateral_friction of link body: 0.6 in A, 0.5 in B", 1),
    ('effort="20"', 'effort="21"', "effort of joint knee: 20 in A, 21 in B", 6),
])  # fmt: skip
def test_numbers_of_impulses_are_compared(
    old: str, new: str, message: str, line: int, tmp_path: Path
) -> None:
    """Catch numbers of limits, motors and contacts that differ between two URDFs."""
    pytest.importorskip("pybullet")
    a = written(tmp_path, "a.urdf", LEG)
    b = written(tmp_path, "b.urdf", LEG, (old, new))
    (row,) = laws(a, b, "pybullet", "pybullet", floating=True)
    assert row.message == message
    assert row.effect
    assert row.where_a is not None
    assert row.where_a.line == line
