"""The installed wheel, in folders that contain packages with the names of ours."""

import json
import shutil
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.installed.conftest import ROOT, Installed
from tests.standing import shorten_scenarios

pytestmark = pytest.mark.release

TRAP = "raise RuntimeError('the package of the user')\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Create a user's folder with packages `harness` and `reference` and a module `mujoco`."""
    folder = tmp_path_factory.mktemp("user")
    for name in ("harness", "reference"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text(TRAP)
    (folder / "mujoco.py").write_text(TRAP)
    (folder / "models").mkdir()
    return folder


def test_installed_package_is_not_the_checkout(installed: Installed, place: Path) -> None:
    code = (
        "import physics_crosscheck.harness.modelfiles.folders as f; print(f.__file__, f.builtin())"
    )
    done = installed.shell(f'python -P -c "{code}"', place)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(str(installed.bin.parent)) == 2


def test_wheel_registers_the_commands_of_extras(installed: Installed, place: Path) -> None:
    done = installed.shell("crosscheck --help", place)
    assert "\n  sweep " in done.stdout
    assert "\n  versions " in done.stdout
    assert installed.shell("crosscheck versions --help", place).returncode == 0


def new_rod(installed: Installed, place: Path, target: str) -> None:
    """Create the template's folder with short motions."""
    done = installed.shell(f"crosscheck new {target}", place)
    assert done.returncode == 0, done.stderr
    shorten_scenarios(place / target)


def test_new_and_run_work_with_user_packages_of_the_same_names(
    installed: Installed, place: Path
) -> None:
    new_rod(installed, place, "models/rod")
    # The user's folder is first on the path, as in many projects.
    done = installed.shell("crosscheck run models --engine pymunk", place, PYTHONPATH=str(place))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "All 3 cases agree" in done.stdout
    results = json.loads((place / "reports" / "results.json").read_text())
    assert {m["engine"] for m in results["models"]} == {"pymunk"}
    (place / "reports" / "index.html").unlink()
    assert installed.shell("crosscheck report", place).returncode == 0
    assert (place / "reports" / "index.html").stat().st_size > 10_000


def test_python_functions_work_with_user_packages_of_the_same_names(
    installed: Installed, tmp_path: Path
) -> None:
    for name in ("harness", "reference"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(TRAP)
    script = """from physics_crosscheck import compare, simulate, solve
run = simulate("simple_pendulum/mujoco.xml", "free", duration=1)
errors = run - solve("simple_pendulum", "free", times=run.t, duration=1)
print(abs(errors["theta"]).max() < 0.01, errors.uncertainty_of("theta").max() < 1e-10)
print(compare("simple_pendulum/mujoco.xml", "simple_pendulum/robot.urdf", engine="mujoco").agree)
"""
    (tmp_path / "script.py").write_text(script)
    done = installed.shell("python script.py", tmp_path)
    assert done.stdout == "True True\nTrue\n", done.stderr


def test_module_in_the_folder_is_not_used_as_an_engine(installed: Installed, place: Path) -> None:
    done = installed.shell("crosscheck audit simple_pendulum --engine mujoco", place)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ok: literals and compiled terms" in done.stdout


def test_plugin_works_with_user_packages_of_the_same_names(
    installed: Installed, place: Path
) -> None:
    if not (place / "models" / "rod").is_dir():
        new_rod(installed, place, "models/rod")
    # `python -m pytest` puts the user's folder with its `mujoco.py` first.
    done = installed.shell(
        "python -m pytest -q --crosscheck models -m pymunk", place, PYTHONPATH=str(place)
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 passed" in done.stdout  # three motions and the audit


OURS = "from physics_crosscheck import System, check"
THEIRS = "import harness, reference; assert harness.MINE and reference.MINE"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Create a project with its own packages `harness` and `reference`, in both import orders."""
    for name in ("harness", "reference"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("MINE = 1\n")
    for number, lines in enumerate(([OURS, THEIRS], [THEIRS, OURS])):
        text = "\n".join((*lines, THEIRS))
        (tmp_path / f"order_{number}.py").write_text(text)
        (tmp_path / f"test_order_{number}.py").write_text(f"{text}\n\ndef test() -> None: pass\n")
    return tmp_path


def test_project_imports_its_own_harness_and_reference(installed: Installed, project: Path) -> None:
    for number in (0, 1):
        done = installed.shell(f"python order_{number}.py", project)
        assert done.returncode == 0, done.stderr


def test_project_imports_its_own_harness_under_pytest(installed: Installed, project: Path) -> None:
    (project / "conftest.py").write_text(THEIRS)
    new_rod(installed, project, "rod")
    words = "--crosscheck rod -m pymunk test_order_0.py test_order_1.py"
    done = installed.shell(f"python -m pytest -q {words}", project)
    assert done.returncode == 0, done.stdout + done.stderr


def test_wheel_has_one_folder_with_every_module(installed: Installed) -> None:
    """Catch a module of a command that the wheel lacks, without running each command."""
    script = "import importlib.metadata as m; print(*m.files('physics-crosscheck'), sep='|')"
    done = installed.shell(f'python -c "{script}"', installed.bin)
    files = [Path(name) for name in done.stdout.strip().split("|")]
    folders = {path.parts[0] for path in files if not path.parts[0].endswith((".dist-info", ".."))}
    assert folders == {"physics_crosscheck"}, done.stderr
    ours = [
        *(ROOT / "physics_crosscheck").glob("*.py"),
        *(path for name in ("harness", "reference") for path in (ROOT / name).rglob("*.py")),
    ]
    assert ours
    modules = {Path(*path.parts[1:]) for path in files if path.parts[0] == "physics_crosscheck"}
    for path in ours:
        place = path.relative_to(ROOT)
        assert (place if place.parts[0] != "physics_crosscheck" else Path(path.name)) in modules


def test_python_m_runs_the_package_by_its_full_name(installed: Installed, place: Path) -> None:
    done = installed.shell("python -m physics_crosscheck --help", place)
    assert done.returncode == 0, done.stderr
    assert "\n  run " in done.stdout
    assert "the package of the user" in installed.shell("python -m harness", place).stderr


def link_extra(home: Path, extra: str) -> None:
    """Link the distributions of exactly one extra into the environment's site folder."""
    (folder,) = home.glob("lib/python*/site-packages")
    needed = [Requirement(f"physics-crosscheck[{extra}]")]
    for need in needed:
        package = distribution(need.name)
        if need.name != "physics-crosscheck":
            for top in {file.parts[0] for file in package.files or ()} - {"..", "__pycache__"}:
                if not (folder / top).exists():
                    (folder / top).symlink_to(Path(str(package.locate_file(top))))
        inner = [Requirement(text) for text in package.requires or ()]
        wanted = [{"extra": name} for name in need.extras or ("",)]
        chosen = [r for r in inner if not r.marker or any(map(r.marker.evaluate, wanted))]
        needed += [r for r in chosen if r not in needed]


def test_picture_has_all_shapes_with_only_the_engines(installed: Installed, tmp_path: Path) -> None:
    home = tmp_path / "only"
    shutil.copytree(installed.bin.parent, home, symlinks=True)
    (dependencies,) = home.glob("lib/python*/site-packages/dependencies.pth")
    dependencies.unlink()
    link_extra(home, "engines")
    robot = Path(str(distribution("pybullet").locate_file("pybullet_data/franka_panda/panda.urdf")))
    command = f"{home / 'bin' / 'python'} -m physics_crosscheck run {robot} --engine mujoco --out o"
    done = installed.shell(command, tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    results = json.loads((tmp_path / "o" / "results.json").read_text())
    (system,) = results["systems"]
    drawn = {body["name"] for body in system["scene"]["bodies"] if body["shapes"]}
    assert {*(f"panda_link{i}" for i in range(8)), "panda_hand", "panda_leftfinger"} <= drawn
    assert not system["scene"]["unread"]
