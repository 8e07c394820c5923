"""Pages of engines are generated from their code, and engine names are in their homes only."""

import re
import tomllib
from pathlib import Path
from types import FunctionType

import pytest

from physics_crosscheck.engine import Engine, EngineError, LoadedModel, ModelSpec, conform_samples
from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.conformance import CHECKS
from physics_crosscheck.harness.engines.pages import own_settings, pages, phrases
from physics_crosscheck.harness.engines.registry import (
    BUILT_IN,
    default_engines,
    engines,
    engines_reading,
)
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.records import Outcome
from tests.faults.known_folder import SYSTEM
from tests.models import written

FOLDER = Path(__file__).parents[2] / "docs" / "engines"
ENGINES = [kind() for kind in BUILT_IN]


def test_generated_parts_are_current() -> None:
    rendered = pages(FOLDER)
    assert {path.stem for path in rendered} == {"index", *(engine.name for engine in ENGINES)}
    for path, text in rendered.items():
        assert path.read_text() == text, "python -m physics_crosscheck.harness.engines.pages ..."


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_engine_matches_its_page(engine: Engine, tmp_path: Path) -> None:
    if engine.version() is None:
        pytest.skip(f"{engine.name} is not installed")
    page = phrases(engine)
    for sample in engine.samples():
        path = written(tmp_path, sample.file, sample.text)
        model = engine.load(ModelSpec(path, sample.springs, sample.settings))
        still = 0 * model.home[None]
        has_accelerations = model.accelerations(model.home[None], still, still) is not None
        assert has_accelerations == (page["accelerations"] != "no")
        assert (model.step_rule is not None) == (page["next state"] != "no")
        order = model.exponents(varying_input=False)[0]
        assert f"order {order}" in page["steps"]


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_engine_accepts_the_listed_settings(engine: Engine, tmp_path: Path) -> None:
    if engine.version() is None:
        pytest.skip(f"{engine.name} is not installed")
    sample = engine.samples()[0]
    path = written(tmp_path, sample.file, sample.text)
    for setting, default in own_settings(engine).items():
        if default == "of the file":
            continue
        engine.load(ModelSpec(path, sample.springs, {**sample.settings, setting: default}))
    with pytest.raises(EngineError, match="no setting nonsense"):
        engine.load(ModelSpec(path, sample.springs, {**sample.settings, "nonsense": True}))


PAGE = (Path(__file__).parents[2] / "docs" / "engines" / "adapter.md").read_text()
TOY = 'names = ["x"]\nm = [1.3]\nc = [0.9]\nk = [{}]\nstep = 0.005\n'


def block(language: str) -> str:
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


@pytest.mark.parametrize("base", [Engine, LoadedModel])
def test_every_hook_of_the_protocol_has_a_text(base: type) -> None:
    """Check the docstrings, which the reference shows, and the page's required hooks."""
    hooks = {name for name in (*vars(base), *base.__annotations__) if name[0] != "_"}
    attributes = set(re.findall(r"\w+", base.__doc__ or ""))
    code = {name for name in hooks if isinstance(vars(base).get(name), (FunctionType, property))}
    assert hooks - attributes == {name for name in code - attributes if vars(base)[name].__doc__}
    required = PAGE.partition("## Required members")[2]
    assert all(name in required for name in vars(base)["__abstractmethods__"])


ROOT = Path(__file__).parents[2]
SEARCHED = ("harness", "reference", "physics_crosscheck")
HOME = ROOT / "harness" / "engines"
EXAMPLES = (
    "harness/records/codes.toml",
    "harness/documents/schemas.toml",
    "harness/extras/sweep/command.py",
    "harness/extras/versions/command.py",
    "harness/interfaces/cli/arguments.py",
    "harness/interfaces/cli/commands.py",
    "harness/interfaces/cli/reference.py",
    "harness/modelfiles/mjcf/stated.py",
    "harness/modelfiles/mjcf/stated_drives.py",
    "reference/laws",
    "reference/mechanism/laws.py",
)
"""Examples for users quote what engines do; laws cite the documentation that states them."""
NAMES = re.compile(
    r"(?<!<)mujoco|pybullet|pymunk|pinocchio|\bdrake|\bdart|\bmjx|known_answer", re.IGNORECASE
)


def texts() -> list[Path]:
    """Return every file of the packages: code, pages and schemas."""
    files = [ROOT / name for name in SEARCHED if (ROOT / name).is_file()]
    for name in SEARCHED:
        files += [path for path in (ROOT / name).rglob("*") if path.is_file()]
    return [
        path
        for path in files
        if "__pycache__" not in path.parts
        and HOME not in path.parents
        and not any(path.is_relative_to(ROOT / one) for one in EXAMPLES)
    ]


def test_no_engine_is_named_outside_the_engines_folder() -> None:
    files = texts()
    assert len(files) > 100
    named = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in files
        for number, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), 1)
        if NAMES.search(line)
    ]
    assert named == []


def test_hooks_are_declared_and_not_looked_up_by_name() -> None:
    hooks = {
        name
        for base in (Engine, LoadedModel)
        for name in (*vars(base), *base.__annotations__)
        if not name.startswith("_")
    }
    assert {
        "home",
        "sampling_range",
        "gravity",
        "corrective_settings",
        "remarks",
        "epsilon",
    } <= hooks
    lookup = re.compile(rf"(?:getattr|hasattr)\([^()]*,\s*\"(?:{'|'.join(sorted(hooks))})\"")
    files = [path for path in texts() if lookup.search(path.read_text("utf-8", errors="replace"))]
    assert files == []


def test_known_answer_engine_is_not_built_in() -> None:
    built_in = (HOME / "registry.py").read_text()
    assert "known_answer" not in built_in


def test_preferred_engine_of_a_format_comes_first() -> None:
    everyones = ["pybullet", "mujoco"]
    extras = ["pinocchio", "drake", "dart", "newton", "mjx", "idyntree", "sapien"]
    assert [engine.name for engine in engines_reading(".urdf")] == [*everyones, *extras]
    assert [engine.name for engine in default_engines(".urdf")] == everyones
    assert [engine.name for engine in engines_reading(".xml")] == [
        *("mujoco", "pinocchio", "drake", "newton", "mjx")
    ]
    assert [engine.name for engine in default_engines(".xml")] == ["mujoco"]
    assert engines_reading(".skel") == ()


def test_every_format_of_an_adapter_has_a_sample() -> None:
    for engine in engines().values():
        assert {Path(sample.file).suffix for sample in engine.samples()} == set(engine.formats) - {
            ".usdc",
            ".usdz",
        }
