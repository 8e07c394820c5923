"""`docs/engines/adapter.md`: its adapter conforms, and its tables list every hook."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from physics_crosscheck.engine import Engine, LoadedModel, conform_samples
from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.conformance import CHECKS
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.records import Outcome
from tests.faults.known_folder import SYSTEM

PAGE = (Path(__file__).parents[2] / "docs" / "engines" / "adapter.md").read_text()
TOY = 'names = ["x"]\nm = [1.3]\nc = [0.9]\nk = [{}]\nstep = 0.005\n'


def block(language: str) -> str:
    """Return the page's only block in a language."""
    (code,) = re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    return str(code)


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a distribution of the adapter, registered as on the page."""
    place = tmp_path / "site"
    info = place / "toy-1.0.dist-info"
    info.mkdir(parents=True)
    (place / "toy_engine.py").write_text(block("python"))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    points = tomllib.loads(block("toml"))["project"]["entry-points"]["crosscheck.engines"]
    lines = "".join(f"{name} = {value}\n" for name, value in points.items())
    (info / "entry_points.txt").write_text(f"[crosscheck.engines]\n{lines}")
    monkeypatch.syspath_prepend(place)


@pytest.mark.usefixtures("installed")
def test_example_adapter_conforms() -> None:
    assert sum(bool(line.strip()) for line in block("python").splitlines()) <= 40
    (checks,) = conform_samples(engines()["toy"]).values()
    assert len(checks) == len(CHECKS)
    assert [str(check) for check in checks if not check.passed] == []


@pytest.mark.usefixtures("installed")
def test_example_adapter_runs_a_folder_and_detects_a_wrong_number(tmp_path: Path) -> None:
    folder = tmp_path / "oscillator"
    folder.mkdir()
    (folder / "system.py").write_text(SYSTEM)
    prepared = prepare_system(folder, described=False)
    outcomes = {}
    for name, stiffness in (("good", "47.0"), ("off", "47.000047")):
        (folder / f"{name}.toy").write_text(TOY.format(stiffness))
        (folder / f"{name}.toy.toml").write_text('engines = ["toy"]\n')
        sidecar = read_sidecar(folder / f"{name}.toy.toml")
        outcomes[name] = judge(model_task(prepared, "toy", sidecar, scenario="driven")).outcome
    assert outcomes == {"good": Outcome.AGREES, "off": Outcome.DIFFERS}


def test_tables_list_every_hook_of_the_protocol() -> None:
    _, _, tables = PAGE.partition("## Required members")
    rows = [line for line in tables.splitlines() if line.startswith("|")]
    documented = {word for row in rows for word in re.findall(r"\w+", row.split("|")[1])}
    for base in (Engine, LoadedModel):
        hooks = {name for name in (*vars(base), *base.__annotations__) if name[0] != "_"}
        assert hooks - documented == set()
