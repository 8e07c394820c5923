"""Robot files without a folder: accepted and gated like the models of a folder."""

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

import physics_crosscheck.harness.commands.gate.gate as gating
from physics_crosscheck.command import AGREE, DIFFER, FAIL, USAGE
from physics_crosscheck.harness.baseline.fingerprint import robot_file
from physics_crosscheck.harness.baseline.stale import match, robot_options, stale
from physics_crosscheck.harness.baseline.store import read_baseline, write_baseline
from physics_crosscheck.harness.commands.gate.accept import Acceptance, AcceptError, accept
from physics_crosscheck.harness.commands.gate.gate import accepted_targets, gate, robots_in
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.text import gate_lines, notes, summary
from physics_crosscheck.harness.engines.mujoco import MujocoEngine
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.records.baseline import WholeSteps
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import Results
from tests.gate.conftest import ignore_progress
from tests.models import edited
from tests.report.page import Page

ROOT = Path(__file__).parents[2]
ARM = """\
<robot name="arm">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="boom"><inertial><origin xyz="0.01 0.02 -0.2"/><mass value="1.3"/>
    <inertia ixx="0.021" iyy="0.018" izz="0.006" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
  <joint name="lift" type="continuous">
    <parent link="base"/><child link="boom"/><axis xyz="0 1 0"/>
  </joint>
</robot>
"""
PART = '<mujocoinclude><geom name="ball" size="0.1" pos="0.1 0 0" mass="1.2"/></mujocoinclude>'
SCENE = (
    '<mujoco model="arm"><worldbody><body><joint axis="0 1 0"/><include file="part.xml"/>'
    "</body></worldbody></mujoco>"
)
LEG = """\
<mujoco model="leg">
  <option timestep="0.002" integrator="implicitfast" cone="elliptic"/>
  <default><geom friction="0.8 0.01 0.001"/></default>
  <asset>
    <mesh name="foot" file="foot.obj"/>
    <material name="skin" rgba="1 0 0 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1"/>
    <body name="thigh" pos="0 0 0.3">
      <joint name="hip" axis="0 1 0" range="-1 1" limited="true" solreflimit="0.03 1"/>
      <geom size="0.05" mass="1" pos="0 0 -0.27" contype="1"/>
      <geom type="mesh" mesh="foot" mass="0"/>
    </body>
  </worldbody>
  <actuator><motor name="m" joint="hip" forcerange="-2 2"/></actuator>
</mujoco>
"""
FOOT = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ARM_CASE = "robots/arm.urdf/states [mujoco]"
TWIN_CASE = "robots/left/arm.urdf/states [mujoco]"
SCENE_CASE = "robots/scene.xml/states [mujoco]"
MASSLESS = """\
  <link name="tip"><inertial><mass value="0"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="weld" type="fixed"><parent link="boom"/><child link="tip"/></joint>
"""


@dataclass(frozen=True)
class Robots:
    """A repository with robot files and an accepted baseline."""

    root: Path

    @property
    def baseline(self) -> Path:
        return self.root / "reports" / "baseline"

    @property
    def arm(self) -> Path:
        return self.root / "robots" / "arm.urdf"

    def edit(self, old: str, new: str, name: str = "arm.urdf") -> None:
        path = self.root / "robots" / name
        text = path.read_text()
        assert text.count(old) == 1, (name, old)
        path.write_text(text.replace(old, new))

    def gate(self, *targets: Path, **options: Any) -> GateResult:
        chosen = targets or accepted_targets(self.baseline)
        wanted = Options(baseline=self.baseline, engines=("mujoco",), jobs=1, **options)
        return gate(chosen, wanted, ignore_progress)

    def accept(self, reason: str, result: GateResult, *, untested: bool = False) -> Acceptance:
        return accept(result, (), reason, self.baseline, untested=untested)

    def run(self, **options: Any) -> Results:
        wanted = Options(("mujoco",), baseline=self.baseline, jobs=1, **options)
        return run([], wanted, ignore_progress, robots=[self.arm]).results


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> Robots:
    """Accept robot files in a repository that no test changes."""
    robots = Robots(tmp_path_factory.mktemp("robots"))
    (robots.root / "robots" / "left").mkdir(parents=True)
    for name, text in {
        "arm.urdf": ARM,
        "left/arm.urdf": ARM.replace("1.3", "1.4"),
        "scene.xml": SCENE,
        "part.xml": PART,
    }.items():
        (robots.root / "robots" / name).write_text(text)
    robots.accept("first", robots.gate(*robots_in(robots.root / "robots", robots.baseline)))
    return robots


@pytest.fixture
def robots(accepted: Robots, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Robots:
    """Copy that repository as the working directory."""
    shutil.copytree(accepted.root, tmp_path / "repository")
    monkeypatch.chdir(tmp_path / "repository")
    return Robots(tmp_path / "repository")


def statuses(result: GateResult) -> dict[str, Status]:
    return {str(change.id): change.status for change in result.changes}


def test_files_of_the_same_name_are_systems_named_by_path(accepted: Robots) -> None:
    baseline = read_baseline(accepted.baseline)
    assert sorted(baseline) == ["robots/arm.urdf", "robots/left/arm.urdf", "robots/scene.xml"]
    assert (accepted.baseline / "robots/left/arm.urdf.json").is_file()
    (scene,) = baseline["robots/scene.xml"].cases.values()
    assert set(scene.files) == {"scene.xml", "part.xml"}
    text = accepted.baseline / "robots/left/arm.urdf/arm.urdf.accepted"
    assert text.read_text() == ARM.replace("1.3", "1.4")
    assert str(accepted.root) not in (accepted.baseline / "robots/arm.urdf.json").read_text()


def test_unchanged_files_pass_without_an_engine_or_sympy(accepted: Robots) -> None:
    code = (
        "import sys; from physics_crosscheck.harness.interfaces.cli.main import main;"
        "code = main(['gate', '--engine', 'mujoco', '--out', sys.argv[1]]);"
        "heavy = {'sympy', 'scipy', 'mujoco', 'asyncio', 'urllib.request', 'rich.progress',"
        " 'multiprocessing.connection', 'physics_crosscheck.harness.run'};"
        "print(code, *sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(accepted.root / "out")],
        cwd=accepted.root,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        check=False,
    )
    assert done.stdout.splitlines()[-1] == "0", done.stdout + done.stderr
    assert "3 cases as accepted (0 run" in done.stdout


def test_changed_number_is_named_by_file_and_line_first(
    robots: Robots, capsys: pytest.CaptureFixture[str]
) -> None:
    robots.edit('mass value="1.3"', 'mass value="1.35"')
    assert cli.main(["gate", "robots", "--engine", "mujoco"]) == DIFFER
    headline, fix, command, *_ = capsys.readouterr().out.splitlines()
    assert headline == (
        "FAIL  robots/arm.urdf:4 mass of link boom 1.3 -> 1.35 changed 1 of 3 cases"
    )
    assert fix == "Fix: set it back to 1.3, or accept the change:"
    assert command.strip().startswith("crosscheck accept")
    assert "'robots/arm.urdf/*'" in command
    record = json.loads(Path("reports/gate/gate.json").read_text())
    changed = [one for one in record["cases"] if one["status"] == "changed"]
    assert [(one["system"], one["kinds"]) for one in changed] == [
        ("robots/arm.urdf", ["model", "equations"])
    ]
    (diff,) = record["files"]
    assert [one["line"] for one in diff["changes"]] == [4]
    page = Page(Path("reports/gate/gate.html").read_text())
    lines = page.lines("overview")
    assert headline == f"FAIL  {lines[1]}"
    assert lines.count("robots/arm.urdf:4 mass of link boom 1.3 -> 1.35") == 1
    assert any(id_.startswith("case-") and "arm.urdf/mujoco" in id_ for id_ in page.ids())


def test_annotations_and_the_summary_name_the_changed_line(robots: Robots) -> None:
    robots.edit('mass value="1.3"', 'mass value="1.35"')
    result = robots.gate()
    (note,) = notes(result)
    assert (note.file.name, note.line) == ("arm.urdf", 4)
    assert note.title == f"changed: {ARM_CASE}"
    assert "**robots/arm.urdf**" in summary(result)
    assert robots.accept("heavier", result).cases == (result.changes[0].id,)
    assert set(statuses(robots.gate()).values()) == {Status.SAME}


def test_comment_order_and_the_robots_name_change_no_motion(robots: Robots) -> None:
    """Catch a file that fails since an exporter wrote it in another order."""
    robots.edit('<link name="base">', '<!-- the base --><link name="base">')
    robots.edit('<robot name="arm">', '<robot name="crane">')
    robots.edit('<parent link="base"/><child link="boom"/>', "")
    robots.edit("</joint>", '<child link="boom"/><parent link="base"/></joint>')
    text = robots.arm.read_text()
    boom = text[text.index('  <link name="boom">') : text.index("  <joint")]
    robots.edit(boom, "")
    robots.edit("</robot>", f"{boom}</robot>")
    assert statuses(robots.gate()) == {
        ARM_CASE: Status.WITHIN, TWIN_CASE: Status.SAME, SCENE_CASE: Status.SAME,
    }  # fmt: skip


@pytest.fixture(scope="module")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Robots:
    """Accept a file with limits, contacts, a drive and a mesh, which includes its bodies."""
    robots = Robots(tmp_path_factory.mktemp("leg"))
    (robots.root / "robots").mkdir()
    bodies = LEG[LEG.index("<worldbody>") : LEG.index("</worldbody>") + 12]
    for name, text in {
        "leg.xml": LEG.replace(bodies, '<include file="bodies.xml"/>'),
        "bodies.xml": f"<mujocoinclude>\n{bodies}\n</mujocoinclude>",
        "foot.obj": FOOT,
    }.items():
        (robots.root / "robots" / name).write_text(text)
    robots.accept("first", robots.gate(robots.root / "robots" / "leg.xml"))
    return robots


@pytest.mark.parametrize(("name", "old", "new", "named"), [
    ("leg.xml", 'timestep="0.002"', 'timestep="0.003"', "timestep 0.002 -> 0.003"),
    ("leg.xml", "implicitfast", "RK4", "integrator implicitfast -> RK4"),
    ("leg.xml", ' cone="elliptic"', "", "cone elliptic -> none"),
    ("leg.xml", "/>\n  <default>", '><flag limit="disable"/></option>\n  <default>', "<flag limit"),
    ("leg.xml", '"0.8 0.01', '"0.8 0.02', "friction[1] 0.01 -> 0.02"),
    ("leg.xml", 'range="-2 2"', 'range="-2 3"', "forcerange[1] of motor m 2 -> 3"),
    ("bodies.xml", '<geom name="floor" type="plane" size="5 5 0.1"/>', "", "removed: <geom"),
    ("bodies.xml", 'axis="0', 'frictionloss="0.1" axis="0', "frictionloss of joint hip none"),
    ("bodies.xml", 'solreflimit="0.03', 'solreflimit="0.04', "solreflimit[0] of joint hip 0.03"),
    ("bodies.xml", 'contype="1"', 'contype="2"', "contype of body thigh 1 -> 2"),
    ("foot.obj", "v .1 0 0", "v .2 0 0", "foot.obj: its content changed"),
])  # fmt: skip
def test_edit_of_a_robot_file_fails_and_is_named(
    leg: Robots, tmp_path: Path, name: str, old: str, new: str, named: str
) -> None:
    """Catch an edit that no smooth segment shows."""
    robots = Robots(Path(shutil.copytree(leg.root, tmp_path / "copy")))
    robots.edit(old, new, name)
    (change,) = (result := robots.gate()).changes
    assert change.status is Status.CHANGED
    assert named in " ".join(" ".join(gate_lines(result, 500)).split())
    robots.accept("wanted", result)
    (change,) = robots.gate().changes
    assert change.status is Status.SAME


def test_whole_step_of_another_engine_version_fails(leg: Robots, tmp_path: Path) -> None:
    """Catch an engine whose limits or contacts act otherwise, with the same file."""
    robots = Robots(Path(shutil.copytree(leg.root, tmp_path / "copy")))
    accepted = read_baseline(robots.baseline)["robots/leg.xml"]
    (entry,) = accepted.cases.values()
    assert isinstance(entry.steps, WholeSteps)
    first, *others = entry.steps.ends.values
    moved = (first[0] or 0.0) + 0.01 * (entry.steps.scale[0] or 0.0)
    ends = msgspec.structs.replace(entry.steps.ends, values=((moved, *first[1:]), *others))
    laws = {**entry.steps.laws, "limits[0].upper": 9.0}
    steps = msgspec.structs.replace(entry.steps, ends=ends, laws=laws)
    entry = msgspec.structs.replace(entry, steps=steps)
    write_baseline(robots.baseline, [replace(accepted, cases={entry.id: entry})], {})
    (change,) = robots.gate(every=True).changes
    assert (change.status, change.diff.changed) == (Status.CHANGED, ("steps",))
    assert change.messages == (
        "with limits, friction, contacts and drives, hip_ddot changed by 1.0 % of its largest"
        " value, at state 1",
        "compiled limits[0].upper 9.0 -> 0.017453292519943295",
    )


def test_format_comments_and_colors_change_no_motion(leg: Robots, tmp_path: Path) -> None:
    robots = Robots(Path(shutil.copytree(leg.root, tmp_path / "copy")))
    robots.edit('rgba="1 0 0 1"', 'rgba="0 0 1 1"', "leg.xml")
    robots.edit('size="0.05" mass="1"', 'mass="1.0"\n  size="5e-2"', "bodies.xml")
    robots.edit("<worldbody>", "<worldbody> <!-- light -->", "bodies.xml")
    (change,) = robots.gate().changes
    assert (change.status, change.kinds) == (Status.WITHIN, ("text",))


def test_included_file_counts_with_its_model(robots: Robots) -> None:
    robots.edit('mass="1.2"', 'mass="1.3"', "part.xml")
    result = robots.gate()
    assert statuses(result)[SCENE_CASE] is Status.CHANGED
    assert [diff.file for diff in result.file_diffs] == ["part.xml"]


def test_included_part_is_a_model_if_accepted(robots: Robots) -> None:
    folder = robots.root / "robots"
    (folder / "part.xml").write_text(SCENE.replace('<include file="part.xml"/>', PART[15:-16]))
    (folder / "scene.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    assert folder / "part.xml" not in robots_in(folder, robots.baseline)
    robots.accept("alone", robots.gate(folder / "part.xml"))
    assert folder / "part.xml" in robots_in(folder, robots.baseline)
    assert "robots/part.xml/states [mujoco]" in statuses(robots.gate())


def test_accepted_file_is_gated_in_any_subfolder(robots: Robots) -> None:
    deep = robots.root / "robots" / "build" / "arm.xml"
    deep.parent.mkdir()
    # The search for models reads no further than the comment.
    deep.write_text(f"<!--{'x' * 5000}-->{SCENE.replace('part.xml', '../part.xml')}")
    robots.accept("generated", robots.gate(deep))
    assert deep in robots_in(robots.root / "robots", robots.baseline)
    assert deep.resolve() in [one.resolve() for one in accepted_targets(robots.baseline)]
    (robots.root / "robots" / "system").mkdir()
    (robots.root / "robots" / "system" / "system.py").touch()
    assert len(robots_in(robots.root / "robots", robots.baseline)) == 4


def test_gone_new_and_renamed_files_fail_and_can_be_accepted(robots: Robots) -> None:
    robots.arm.rename(robots.arm.with_name("crane.urdf"))
    result = robots.gate()
    assert statuses(result) == {
        ARM_CASE: Status.GONE, "robots/crane.urdf/states [mujoco]": Status.NEW,
        TWIN_CASE: Status.SAME, SCENE_CASE: Status.SAME,
    }  # fmt: skip
    parents = robots.gate(robots.arm.with_name("crane.urdf"), parents=(robots.root / "robots",))
    assert statuses(parents)[ARM_CASE] is Status.GONE
    elsewhere = robots.gate(robots.root / "robots/scene.xml", parents=(robots.root / "models",))
    assert ARM_CASE not in statuses(elsewhere)
    robots.accept("renamed", result)
    assert set(statuses(robots.gate()).values()) == {Status.SAME}
    assert not (robots.baseline / "robots/arm.urdf.json").exists()
    assert not list((robots.baseline / "robots/arm.urdf").iterdir())


def test_another_engine_version_runs_the_files_again(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MujocoEngine, "version", lambda _: "99.0")
    (change,) = robots.gate(robots.arm, parents=()).changes
    assert (change.status, change.kinds) == (Status.WITHIN, ("engine",))
    assert change.messages[0].startswith("engine version mujoco ")
    assert change.case is not None


def test_damaged_entry_is_reported_with_its_file(
    robots: Robots, capsys: pytest.CaptureFixture[str]
) -> None:
    edited(robots.baseline / "robots/arm.urdf.json", '"outcome": "AGREES"', '"outcome": "DIFFERS"')
    assert cli.main(["gate", "robots"]) == FAIL
    assert "robots/arm.urdf.json" in capsys.readouterr().err


def test_invalid_or_changing_file_does_not_pass(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots.edit("</robot>", "")
    result = robots.gate()
    assert [change.id.scenario for change in result.with_status(Status.NOT_RUN)] == ["-"]
    assert not result.with_status(Status.GONE)
    robots.arm.write_text(ARM.replace("boom", "jib"))
    real = gating._run

    def meanwhile(*arguments: Any) -> Any:
        ran = real(*arguments)
        robots.edit('mass value="1.3"', 'mass value="1.35"')
        return ran

    monkeypatch.setattr(gating, "_run", meanwhile)
    assert statuses(robots.gate())[ARM_CASE] is Status.NOT_RUN


def test_gate_reads_a_file_with_its_accepted_options(robots: Robots) -> None:
    floating = "robots/arm.urdf/floating states [mujoco]"
    result = robots.gate(floating=True)
    assert statuses(result)[ARM_CASE] is Status.GONE
    assert statuses(result)[floating] is Status.NEW
    robots.accept("it floats", result)
    assert {change.case for change in robots.gate().changes} == {None}
    robots.edit('mass value="1.3"', 'mass value="1.35"')
    result = robots.gate()
    assert statuses(result)[floating] is Status.CHANGED
    robots.accept("heavier", result)
    assert statuses(robots.gate())[floating] is Status.SAME
    # A run with other options has a new case, and none is missing.
    changes = robots.run().baseline
    assert changes is not None
    assert [(one.scenario, one.status) for one in changes.changes] == [("states", Status.NEW)]


def test_another_model_of_a_file_is_another_robot(robots: Robots) -> None:
    file = robots.arm.with_suffix(".sdf")
    file.write_text('<sdf version="1.9"/>')
    first, other = (robot_options(file, floating=True, model=name) for name in ("a", "b"))
    assert not first.floating
    entry = read_baseline(robots.baseline)["robots/arm.urdf"]
    first_file = robot_file(robots.arm, ("mujoco",), first)
    declared = msgspec.structs.replace(entry.declared, robot=first)
    versions = {"mujoco": MujocoEngine().version()}
    entry = type(entry)(declared=declared, snapshots=entry.snapshots, cases=entry.cases)
    assert not stale(first_file, first_file.models[0], "mujoco", entry, versions, 1e-9)
    other_file = robot_file(robots.arm, ("mujoco",), other)
    assert stale(other_file, other_file.models[0], "mujoco", entry, versions, 1e-9)


def test_moved_baseline_matches_files_by_name(robots: Robots) -> None:
    moved = robots.root / "accepted"
    robots.baseline.rename(moved)
    baseline = read_baseline(moved)
    matched = match(robots.arm, moved, baseline)
    assert matched is not None
    assert matched.system == "robots/arm.urdf"
    assert match(robots.root / "robots/left/other.urdf", moved, baseline) is None


def test_known_difference_passes_and_is_marked_in_a_run(robots: Robots) -> None:
    robots.edit("  <joint", f"{MASSLESS}  <joint")
    robots.accept("MuJoCo drops it", robots.gate())
    assert statuses(robots.gate(every=True))[ARM_CASE] is Status.EXPECTED
    results = robots.run()
    (case,), (model,) = results.cases, results.models
    assert (case.accepted, model.accepted) == ("MuJoCo drops it", "MuJoCo drops it")
    assert results.baseline is not None
    assert not results.baseline.changes
    robots.edit('ixx="0.01" iyy="0.01"', 'ixx="0.01" iyy="0.02"')
    (case,) = robots.run().cases
    assert not case.accepted
    assert "was accepted here (MuJoCo drops it), but" in case.reason


def test_file_rejected_by_an_engine_can_be_accepted(robots: Robots) -> None:
    possible, impossible = 'izz="0.006"', 'izz="0.6"'
    robots.edit(possible, impossible)
    result = robots.gate()
    (change,) = result.with_status(Status.CHANGED)
    assert change.messages[0] == "the verdict changed from AGREES to REFUSED"
    assert "inertia must satisfy" in change.messages[1]
    assert gate_lines(result)[0].startswith("FAIL  ")
    with pytest.raises(AcceptError, match=r"robots/arm.urdf: every engine refuses it.*--untested"):
        robots.accept("MuJoCo refuses it", result)
    robots.accept("MuJoCo refuses it", result, untested=True)
    assert "1 known difference in robots/arm.urdf: REFUSED" in "\n".join(gate_lines(robots.gate()))
    assert statuses(robots.gate(every=True))[ARM_CASE] is Status.EXPECTED
    (refused,) = robots.run().cases
    assert refused.accepted == "MuJoCo refuses it"
    robots.edit('mass value="1.3"', 'mass value="1.35"')
    result = robots.gate()
    assert statuses(result)[ARM_CASE] is Status.NOT_RUN  # nothing tries the edit
    (unaccepted,) = robots.run().cases
    assert not unaccepted.accepted
    robots.accept("heavier", result, untested=True)
    assert statuses(robots.gate())[ARM_CASE] is Status.EXPECTED
    robots.edit(impossible, possible)
    assert statuses(robots.gate())[ARM_CASE] is Status.IMPROVED


def test_gate_runs_only_accepted_engines(robots: Robots) -> None:
    wanted = Options(baseline=robots.baseline, jobs=1)
    robots.edit('mass value="1.3"', 'mass value="1.35"')
    result = gate([robots.arm], wanted, ignore_progress)
    assert statuses(result)[ARM_CASE] is Status.CHANGED
    assert not result.with_status(Status.NEW)


def test_files_and_folders_are_targets_of_accept(
    robots: Robots, capsys: pytest.CaptureFixture[str]
) -> None:
    robots.edit('mass value="1.3"', 'mass value="1.35"')
    robots.edit('mass value="1.4"', 'mass value="1.45"', "left/arm.urdf")
    words = ["--reason", "heavier", "--engine", "mujoco"]
    assert cli.main(["accept", "robots/arm.urdf", *words]) == AGREE
    assert "Accepted 1 case of robots/arm.urdf" in capsys.readouterr().out
    assert statuses(robots.gate())[TWIN_CASE] is Status.CHANGED
    assert cli.main(["accept", "robots", *words]) == AGREE
    assert set(statuses(robots.gate()).values()) == {Status.SAME}


def test_model_of_a_system_folder_is_not_gated_alone(
    robots: Robots, capsys: pytest.CaptureFixture[str]
) -> None:
    (robots.root / "robots" / "system.py").touch()
    assert cli.main(["gate", "robots/arm.urdf"]) == USAGE
    assert "name its folder, robots" in capsys.readouterr().err


def test_two_files_of_one_name_are_rejected(
    robots: Robots, capsys: pytest.CaptureFixture[str]
) -> None:
    inner = robots.root / "reports" / "robots" / "arm.urdf"
    inner.parent.mkdir()
    inner.write_text(ARM)
    assert cli.main(["gate", "robots/arm.urdf", str(inner), "--engine", "mujoco"]) == USAGE
    assert "both hold the system 'robots/arm.urdf'" in capsys.readouterr().err
