"""Only `harness/engines/` contains code for particular engines."""

import re
from pathlib import Path

from physics_crosscheck.engine import Engine, LoadedModel
from physics_crosscheck.harness.engines.registry import default_engines, engines, engines_reading

ROOT = Path(__file__).parents[2]
SEARCHED = ("harness", "reference", "physics_crosscheck")
HOME = ROOT / "harness" / "engines"
EXAMPLES = (
    "harness/records/codes.toml",
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
        *("mujoco", "pinocchio", "drake", "newton", "mjx"),
    ]
    assert [engine.name for engine in default_engines(".xml")] == ["mujoco"]
    assert engines_reading(".skel") == ()


def test_every_format_of_an_adapter_has_a_sample() -> None:
    for engine in engines().values():
        assert {Path(sample.file).suffix for sample in engine.samples()} == set(engine.formats)
