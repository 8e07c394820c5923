"""Commands that take robot files as they take system folders, and `audit`."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.engines.mujoco import MujocoEngine
from physics_crosscheck.harness.engines.registry import engines_to_run
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.mutation import FaultVerdict
from tests.commands import crosscheck
from tests.models import edited
from tests.robots.files import ARM, LAMP, TIPPED
from tests.standing import keep_default_engines, shorten_scenarios


def test_fix_writes_the_stated_number_and_prints_the_change(faulty: Path, tmp_path: Path) -> None:
    shutil.copytree(faulty / "pendulum", tmp_path / "pendulum")
    file = tmp_path / "pendulum" / "mujoco.xml"
    others = [tmp_path / "package.xml", tmp_path / "start.launch.xml"]
    for other in others:
        other.write_text("<launch/>\n")
    names = ["pendulum/mujoco.xml", *(one.name for one in others)]
    listed = crosscheck("audit", *names, "--format", "concise", cwd=tmp_path)
    assert listed.returncode == 1
    lines = r"(pendulum/mujoco.xml:\d+: XC101 .* -g = -9.8 .*\n)(pendulum/mujoco.xml: XC1.*\n)*"
    assert re.fullmatch(lines, listed.stdout)
    assert "skipped, without <mujoco>: package.xml, start.launch.xml" in listed.stderr
    before = file.read_text()
    done = crosscheck("audit", *names, "--fix", "--format", "concise", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert file.read_text() == before.replace("-9.81", "-9.8")
    assert [line[0] for line in done.stdout.splitlines()] == ["-", "+", "@", "-", "+"]


@pytest.mark.parametrize("text", ["<!-- <a> --><mujco><worldbody/></mujco>", "<Mojuco/>", ""])
def test_audit_does_not_skip_a_misspelled_model(text: str, tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(text)
    listed = crosscheck("audit", "arm.xml", cwd=tmp_path)
    assert listed.returncode != 0
    assert "arm.xml" in listed.stdout + listed.stderr
    assert "skipped" not in listed.stderr


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Create a working folder with two robots in `robots`."""
    (tmp_path / "robots" / "deep").mkdir(parents=True)
    (tmp_path / "robots" / "arm.urdf").write_text(ARM)
    (tmp_path / "robots" / "deep" / "lamp.xml").write_text(LAMP)
    return tmp_path


def names(suffix: str) -> list[str]:
    return [engine.name for engine in engines_to_run(suffix)]


@pytest.mark.parametrize("words", [(), (".",), ("robots",), ("robots/arm.urdf", "robots/deep")])
def test_list_has_a_case_for_each_engine_of_each_file(place: Path, words: tuple[str, ...]) -> None:
    done = crosscheck("list", *words, cwd=place)
    assert (done.returncode, done.stdout.splitlines()) == (0, [
        *(f"swing/arm.urdf/states [{name}]" for name in names(".urdf")),
        *(f"lamp/lamp.xml/states [{name}]" for name in names(".xml")),
    ]), done.stderr  # fmt: skip


def test_list_selects_cases_of_files_as_run_does(place: Path) -> None:
    words = ("robots", "--engine", "mujoco", "-k", "swing", "--floating", "--format", "json")
    done = crosscheck("list", *words, cwd=place)
    assert json.loads(done.stdout) == [{
        "folder": "robots/arm.urdf", "system": "swing", "model": "arm.urdf",
        "scenario": "floating states", "engine": "mujoco",
    }]  # fmt: skip


def test_unreadable_file_is_reported_with_the_others(place: Path) -> None:
    (place / "robots" / "broken.urdf").write_text(ARM.replace('value="2"', 'value="two"'))
    done = crosscheck("list", "robots", cwd=place)
    assert done.returncode == 2
    assert "swing/arm.urdf/states [mujoco]" in done.stdout
    assert "robots/broken.urdf:3: " in done.stderr


def test_folder_of_robots_runs_unless_it_contains_systems(place: Path) -> None:
    done = crosscheck("run", "robots", "--engine", "mujoco", cwd=place)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 systems, 2 models" in done.stdout
    (place / "robots" / "deep" / "system.py").write_text("oops\n")
    done = crosscheck("list", "robots", cwd=place)
    assert "arm.urdf" not in done.stdout
    assert f"{Path('deep') / 'system.py'}:1: NameError" in done.stderr


SDF = """<sdf version="1.9"><model name="swing"><link name="rod"><inertial>
<pose>0 0 -0.5 0 0 0</pose><mass>2</mass>
<inertia><ixx>0.3</ixx><iyy>0.3</iyy><izz>0.1</izz></inertia></inertial>
</link>
<joint name="hinge" type="revolute"><parent>world</parent><child>rod</child><axis><xyz>0 1 0</xyz>
<dynamics><friction>0.1</friction></dynamics></axis></joint></model></sdf>
"""


def test_numbers_are_counted_in_the_engine_that_shows_the_shapes(place: Path) -> None:
    """Lost: the radius, if the numbers are counted in the engine that comes first."""
    path = place / "robots" / "arm.urdf"
    ball = '<link name="{}"><collision><geometry><sphere radius="0.1"/></geometry></collision>'
    path.write_text(re.sub('<link name="(\\w+)">', lambda link: ball.format(link[1]), ARM))
    engines = ("--engine", "mujoco", "--engine", "pinocchio", "--engine", "pybullet")
    crosscheck("run", path, *engines, "--out", place / "out", cwd=place)
    models = json.loads((place / "out" / "results.json").read_text())["models"]
    assert {model["coverage"]["engine"] for model in models} == {"pybullet"}
    untested = [one["reason"] for one in models[0]["coverage"].get("untested", ())]
    assert "collision shapes" not in untested


def test_derive_prints_the_same_equation_of_a_robot_in_each_format(place: Path) -> None:
    (place / "robots" / "swing.sdf").write_text(SDF)
    for file in ("arm.urdf", "deep/lamp.xml", "swing.sdf"):
        done = crosscheck("derive", f"robots/{file}", cwd=place)
        assert done.returncode == 0, done.stderr
        assert "  0.8*hinge'' = -9.81*sin(hinge)\n" in done.stdout
        assert "M = [ 0.8 ]" in done.stdout
        assert ("Not in the equations: dry friction." in done.stdout) is (file == "swing.sdf")


def test_derive_prints_numbers_for_long_equations(place: Path) -> None:
    done = crosscheck("derive", "robots/arm.urdf", "--floating", cwd=place)
    assert "Degrees of freedom: 7." in done.stdout
    assert "is a free joint" in done.stdout
    force = [line.strip("f= []") for line in done.stdout.splitlines()[-9:] if "[" in line]
    assert [float(value) for value in force] == [0, 0, 0, 0, 0, pytest.approx(-4 * 9.81), 0]


def test_derive_reports_the_line_that_prevents_equations(place: Path) -> None:
    (place / "robots" / "arm.urdf").write_text(ARM.replace('value="2"', 'value="two"'))
    done = crosscheck("derive", "robots/arm.urdf", cwd=place)
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr.startswith("crosscheck: robots/arm.urdf:2: ")


def test_audit_prints_findings_shared_by_all_engines_once(place: Path) -> None:
    (place / "robots" / "deep" / "lamp.xml").write_text(
        LAMP.replace('axis="0 1 0"', 'axis="0 1 0" damping="-0.1" frictionloss="0.2"')
    )
    done = crosscheck("audit", "robots", cwd=place)
    assert done.returncode == 1, done.stderr
    file = Path("robots", "deep", "lamp.xml")
    assert done.stdout.splitlines() == [
        f"swing/arm.urdf [{', '.join(names('.urdf'))}]",
        "  ok: no inertia or sign is impossible; compiled terms match the equations",
        f"lamp/lamp.xml [{', '.join(names('.xml'))}]",
        f"  finding  XC109 {file}:2: joint[hinge]@damping is -0.1: negative damping"
        " adds energy to the motion. Write a positive number",
        "  note     left out: dry friction, how MuJoCo compiles the file",
        "Explain a code: crosscheck explain XC109",
    ]


def test_finished_audit_is_reused(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("robots/arm.urdf", "--engine", "mujoco", "--cache", "kept")
    # Use the engines of the other cache tests: a process reads their versions once.
    done = crosscheck("audit", *words, cwd=place, known_engine=True)
    assert done.returncode == 0, done.stdout + done.stderr

    def submit(*_: object, **__: object) -> None:
        raise AssertionError("something is prepared")

    monkeypatch.setattr(Workers, "submit", submit)
    done = crosscheck("audit", *words, "--jobs", "1", cwd=place, known_engine=True)
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, "swing/arm.urdf [mujoco]")
    with pytest.raises(AssertionError, match="something is prepared"):
        crosscheck("audit", *words, "--floating", cwd=place, known_engine=True)


def test_audit_reports_an_unreadable_file_and_needs_no_engine(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place / "robots" / "arm.urdf").write_text(ARM.replace('value="2"', 'value="two"'))
    done = crosscheck("audit", "robots/arm.urdf", cwd=place)
    assert done.returncode == 3
    assert done.stdout.startswith("arm/arm.urdf [-]\n  ERROR    XC613 robots/arm.urdf:2: ")
    monkeypatch.setattr(MujocoEngine, "version", lambda _: None)
    (place / "robots" / "arm.urdf").write_text(ARM)
    done = crosscheck("audit", "robots/arm.urdf", "--engine", "mujoco", cwd=place)
    assert done.returncode == 0
    assert done.stdout.startswith("swing/arm.urdf [mujoco]\n  ok: ")


@pytest.mark.slow
def test_mutate_plants_faults_in_a_robot_file(place: Path) -> None:
    words = ("robots/deep", "--engine", "mujoco", "--json", "faults.json")
    done = crosscheck("mutate", *words, cwd=place)
    assert done.returncode == 0, done.stderr
    assert "small faults: " in done.stdout
    assert "lamp/lamp.xml [mujoco]" in done.stdout
    record = json.loads((place / "faults.json").read_text())
    named = {row["location"] for row in record["rows"] if row["verdict"] == FaultVerdict.NAMED}
    assert "body[rod]/inertial@mass" in named
    (place / "robots" / "arm.urdf").write_text(TIPPED)
    done = crosscheck("mutate", "robots/arm.urdf", "--engine", "mujoco", cwd=place)
    assert done.returncode == 3
    assert "arm.urdf: it does not agree with its equations in mujoco" in done.stderr
    done = crosscheck("mutate", "robots", "no.urdf", cwd=place)
    assert (done.returncode, done.stderr) == (2, "crosscheck: no.urdf: there is no such file\n")


def test_file_that_no_selected_engine_reads_is_named(place: Path) -> None:
    """Catch a run without a case that gives no reason."""
    done = crosscheck("run", "robots/deep/lamp.xml", "--engine", "pybullet", cwd=place)
    assert done.returncode == 3, done.stdout + done.stderr
    words = "crosscheck: robots/deep/lamp.xml was not judged: pybullet reads only .urdf files"
    assert words in done.stderr.splitlines()


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Create a folder `pendulum` whose models have the wrong gravity; return its parent."""
    folder = tmp_path_factory.mktemp("audited") / "pendulum"
    shutil.copytree(builtin() / "simple_pendulum", folder)
    keep_default_engines(folder)
    shorten_scenarios(folder)
    edited(folder / "system.py", "9.81", "9.8")
    return folder.parent


@pytest.mark.parametrize(("name", "audited"), [
    ("pendulum/mujoco.xml", ["pendulum/mujoco.xml [mujoco]"]),
    ("pendulum/robot.urdf/free [pybullet]", ["pendulum/robot.urdf [pybullet]"]),  # a case's name
])  # fmt: skip
def test_name_of_a_model_audits_only_that_model(
    faulty: Path, name: str, audited: list[str]
) -> None:
    ran = crosscheck("audit", name, cwd=faulty)
    assert ran.returncode == 1, ran.stderr
    *printed, hint = ran.stdout.splitlines()
    assert hint == "Explain a code: crosscheck explain XC101"
    assert [line.replace("simple_pendulum", "pendulum") for line in printed if line[0] != " "] == (
        audited
    )
    lines = [line for line in printed if line.startswith("  finding  XC101 ")]
    assert lines
    file = audited[0].partition(" ")[0]
    assert all(
        re.search(rf" {re.escape(file)}(\.toml)?:\d+: .* -g = -9\.8 ", line) for line in lines
    )


@pytest.fixture
def _without_xacro(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the package of the extra `ros`."""
    monkeypatch.setitem(sys.modules, "xacro", None)


@pytest.mark.usefixtures("_without_xacro")
@pytest.mark.parametrize(("name", "message"), [
    ("pendulum/mujoco.xml [pymunk]", "no model matches these names and engines; run `cross"),
    ("pendulum/other.xml", "pendulum/other.xml: there is no such file"),
    ("arm.xacro", "arm.xacro: it is source for xacro, which no engine reads; expand it"),
])  # fmt: skip
def test_invalid_target_is_reported_with_a_remedy(faulty: Path, name: str, message: str) -> None:
    (faulty / "arm.xacro").write_text("<robot name='arm'/>")
    ran = crosscheck("audit", name, cwd=faulty)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert message in ran.stderr
    assert ran.stderr.count("\n") == 1


@pytest.mark.usefixtures("_without_xacro")
def test_invalid_targets_do_not_stop_the_audit_of_a_model(faulty: Path) -> None:
    (faulty / "arm.xacro").write_text("<robot name='arm'/>")
    ran = crosscheck("audit", "pendulum/mujoco.xml", "pendulums", "arm.xacro", cwd=faulty)
    assert "mujoco.xml [mujoco]" in ran.stdout
    assert "pendulums: no such folder" in ran.stderr
    assert "arm.xacro: it is source for" in ran.stderr
    assert ran.returncode == 2


def test_unreadable_sidecar_is_an_error_of_its_model(faulty: Path, tmp_path: Path) -> None:
    shutil.copytree(faulty / "pendulum", tmp_path / "pendulum")
    (tmp_path / "pendulum" / "mujoco.xml.toml").write_text("engines = 3\n")
    ran = crosscheck("audit", "pendulum/mujoco.xml [mujoco]", cwd=tmp_path)
    assert ran.returncode == 3
    assert "  ERROR    " in ran.stdout
    assert "mujoco.xml.toml" in ran.stdout
