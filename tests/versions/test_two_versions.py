"""Comparison of two versions in real environments of `venv` and `pip`, each in its own process.

The engine is the toy engine of docs/engines/adapter.md, installed from wheels in a folder without
a package index. This package is installed too; `test_mujoco_versions.py` runs from the checkout.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.sweep.store import read_rows
from physics_crosscheck.harness.extras.versions.environments import interpreter, site_folders
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.versions import Versions
from tests.commands import crosscheck
from tests.faults.known_folder import ROOT, SYSTEM

PAGE = (ROOT / "docs" / "engines" / "adapter.md").read_text(encoding="utf-8")
TOY = 'names = ["x"]\nm = [1.3]\nc = [0.9]\nk = [47.0]\nstep = 0.005\n'
POINTS = "[crosscheck.engines]\ntoy = toy_engine:ToyEngine\n"


def engine(version: str, old: str = "", new: str = "") -> str:
    """Return the toy engine's module with a version and a replaced text."""
    (text,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    text = text.replace('return "1.0"', f'return "{version}"')
    assert old in text
    return str(text.replace(old, new)) if old else str(text)


def files(version: str, module: str) -> dict[str, str]:
    """Return the files of a distribution of the toy engine."""
    info = f"toy-{version}.dist-info"
    return {
        "toy_engine.py": module,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: toy\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: t\nRoot-Is-Purelib: true\n"
        "Tag: py3-none-any\n",
        f"{info}/entry_points.txt": POINTS,
        f"{info}/RECORD": "",
    }


@dataclass(frozen=True)
class Home:
    """An environment with this package and toy engine 1.0, and a wheel of toy engine 2.0.

    `own` is an environment that a user made for version 3.0.
    """

    place: Path

    def versions(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        """Run `crosscheck versions` in it."""
        return self.run("versions", *words)

    def run(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        """Run a command in it."""
        clean = {k: v for k, v in os.environ.items() if not k.startswith(("PIP_", "PYTHON"))}
        return subprocess.run(
            [interpreter(self.place / "home"), "-m", "physics_crosscheck", *words],
            cwd=self.place,
            capture_output=True,
            text=True,
            timeout=1800,
            check=False,
            env={
                **clean,
                "PIP_NO_INDEX": "1",
                "PIP_FIND_LINKS": str(self.place / "wheels"),
                "XDG_CACHE_HOME": str(self.place / "cache"),
                "CI": "1",
            },
        )


def create_environment(place: Path, version: str) -> Path:
    """Create an environment with a version of the toy engine; return its package folder."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (site,) = place.rglob("site-packages")
    for name, text in files(version, engine(version)).items():
        (site / name).parent.mkdir(exist_ok=True)
        (site / name).write_text(text)
    return site


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Home:
    place = tmp_path_factory.mktemp("versions")
    site, _ = create_environment(place / "home", "1.0"), create_environment(place / "own", "3.0")
    lines = [f"import site; site.addsitedir({folder!r})" for folder in site_folders()]
    (site / "dependencies.pth").write_text("\n".join(lines) + "\n")
    shutil.copytree(ROOT / "physics_crosscheck", site / "physics_crosscheck")
    (place / "wheels").mkdir()
    stiffer = engine("2.0", "- self._k * q", "- 1.001 * self._k * q")
    with zipfile.ZipFile(place / "wheels" / "toy-2.0-py3-none-any.whl", "w") as archive:
        for name, text in files("2.0", stiffer).items():
            archive.writestr(name, text)
    folder = place / "oscillator"
    folder.mkdir()
    (folder / "system.py").write_text(SYSTEM.replace("duration=1.0", "duration=0.5"))
    (folder / "good.toy").write_text(TOY)
    (folder / "good.toy.toml").write_text('engines = ["toy"]\n')
    return Home(place)


@pytest.fixture(scope="module")
def done(home: Home) -> subprocess.CompletedProcess[str]:
    """Compare three versions."""
    words = "oscillator", "--engine", "toy", "1.0", "2.0", "3.0=own", "--json", "found.json"
    return home.versions(*words)


@pytest.mark.release
def test_change_and_its_reversal_are_reported(
    home: Home, done: subprocess.CompletedProcess[str]
) -> None:
    assert done.returncode == 1, done.stdout + done.stderr
    comparison = decoded((home.place / "found.json").read_bytes(), Versions)
    steps = [(upgrade.before, upgrade.after) for upgrade in comparison.upgrades]
    assert steps == [("1.0", "2.0"), ("2.0", "3.0")]
    for upgrade, outcomes in zip(
        comparison.upgrades,
        [(Outcome.AGREES, Outcome.DIFFERS), (Outcome.DIFFERS, Outcome.AGREES)],
        strict=True,
    ):
        assert {case.scenario for case in upgrade.cases} == {"free", "driven"}
        for case in upgrade.cases:
            assert case.changed[:2] == ("verdict", "limit")
            assert case.outcomes == outcomes
            assert case.moved is not None
            assert 1e-5 < case.moved < 1e-2
        (model,) = upgrade.models
        assert "linearization" in model.kinds
    assert "\nFAIL  toy 1.0 -> 3.0 changes results. Check them before you upgrade" in done.stdout


@pytest.mark.release
def test_page_links_the_report_of_each_version(
    home: Home, done: subprocess.CompletedProcess[str]
) -> None:
    out = home.place / "reports" / "versions"
    page = (out / "index.html").read_text()
    for version in ("1.0", "2.0", "3.0"):
        assert (out / f"toy-{version}" / "results.json").is_file()
        assert f'href="toy-{version}/index.html"' in page
        assert (out / f"toy-{version}" / "index.html").is_file()
    assert done.stdout.splitlines()[-1].startswith("reports/versions/index.html")


@pytest.mark.release
def test_missing_environment_is_created_and_user_environment_is_used(
    home: Home, done: subprocess.CompletedProcess[str]
) -> None:
    assert "toy 1.0: the one that is installed here" in done.stdout
    assert done.stdout.count("its environment is made, once") == 1
    wrong = home.versions("oscillator", "--engine", "toy", "2.5=own", "1.0")
    assert wrong.returncode == 3
    assert wrong.stderr.strip().endswith("it has toy 3.0")


@pytest.mark.release
def test_unavailable_version_is_reported_before_running(home: Home) -> None:
    missing = home.versions("oscillator", "--engine", "toy", "1.0", "9.9", "--out", "nothing")
    assert missing.returncode == 3
    (line,) = missing.stderr.strip().splitlines()
    assert line.startswith("crosscheck: toy 9.9 can't be installed: ERROR: ")
    assert "toy==9.9" in line
    assert "pip index versions toy" in line
    assert not (home.place / "nothing").exists()
    assert not list((home.place / "cache").rglob("toy-9.9-*/"))


@pytest.mark.release
def test_sweep_runs_the_same_cases_under_each_version(
    home: Home, done: subprocess.CompletedProcess[str]
) -> None:
    words = "sweep", "oscillator", "--out", "rows", "--versions", "toy", "1.0"
    ran = home.run(*words, "3.0=own", "2.0")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    assert "is made, once" not in ran.stdout
    rows = {
        version: {row.index: row for row in read_rows(home.place / "rows" / f"toy-{version}")}
        for version in ("1.0", "2.0")
    }
    assert {len(cases) for cases in rows.values()} == {2}
    for index, row in rows["1.0"].items():
        assert row.outcome.value == "AGREES"
        assert rows["2.0"][index].outcome.value == "DIFFERS"
    lines = ran.stdout.splitlines()
    same, moved = (line for line in lines if line.startswith("toy") and " -> " in line)
    assert same == "toy 1.0 -> 3.0: 2 cases: none changed"
    assert moved.startswith(
        "toy 3.0 -> 2.0: 2 cases: 2 with another verdict; 2 with another discrepancy"
    )
    # A row's command repeats its case under the same version.
    _, *again = shlex.split(rows["2.0"][1].command)
    assert again[-5:] == ["--versions", "toy", "2.0", "--only", "1"]
    single = home.run(*again)
    assert single.returncode == 1
    assert "FAIL  #1 " in single.stdout
    check_usage_error(home.run(*words, "2.0", "--vary", "m=none"), "none")


@pytest.mark.parametrize("worst", [0, 1, 3])
def test_sweep_without_a_change_ends_with_the_worst_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, worst: int
) -> None:
    codes = iter((worst, 0))
    launch = "physics_crosscheck.harness.extras.sweep.versions.launch"
    monkeypatch.setattr(launch, lambda *_: next(codes))
    interpreter(tmp_path).parent.mkdir()
    interpreter(tmp_path).touch()
    words = "sweep", "simple_pendulum", "--versions", "pymunk", "1.0=.", "2.0=."
    assert crosscheck(*words, cwd=tmp_path).returncode == worst


@pytest.mark.parametrize(("words", "message"), [
    (("1.0",), "name two versions of it or more"),
    (("1.0", "2.0", "--engine", "mujoco"), "--engine names another engine"),
    (("1.0", "2.0", "--scheduler", "tcp://x"), "leave out --scheduler"),
])  # fmt: skip
def test_invalid_sweep_of_versions_is_reported_once(
    tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    ran = crosscheck("sweep", "simple_pendulum", "--versions", "pymunk", *words, cwd=tmp_path)
    check_usage_error(ran, message)


def check_usage_error(ran: subprocess.CompletedProcess[str], message: str) -> None:
    assert ran.returncode == 2, ran.stdout + ran.stderr
    (line,) = ran.stderr.strip().splitlines()
    assert line.startswith("crosscheck: ")
    assert message in line
