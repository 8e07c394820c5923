"""The built-in models: every number that represents a constant is bound and correct."""

import re
import shutil
from pathlib import Path

import pytest

from physics_crosscheck import System
from physics_crosscheck.harness.modelfiles.bindings import bindings, mismatches, with_literals
from physics_crosscheck.harness.modelfiles.folders import builtin, system_folders
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.reference.load import load_system
from tests.files.literals import Number, unaccounted

MODELS = [s for folder in system_folders([]) for s in model_files(folder) if isinstance(s, Sidecar)]

SYSTEMS = {sidecar.model.parent.name for sidecar in MODELS}
LEVEL = {"anchored_pair", "free_pair", "mass_spring_damper", "torsional_disc"}
PAIRS = {"anchored_pair", "free_pair"}
DRUM, PENDULUM = {"drum_pendulum"}, {"simple_pendulum"}


def moments(number: str) -> list[tuple[str, str]]:
    return [(f"inertia {axis}", number) for axis in ("ixx", "iyy", "izz")]


# Numbers that represent no constant: reason, systems, file, (key, number).
EXCEPTED = [
    ("the ground does not move", SYSTEMS, "robot.urdf", [("mass value", "1"), *moments("1")]),
    ("the ground does not move", DRUM, "robot_folded.urdf", [("mass value", "1"), *moments("1")]),
    ("motion is horizontal or about a vertical axis, so gravity has no effect",
     LEVEL, "mujoco.xml", [("option gravity", "-9.81")]),
    ("the same", LEVEL, "robot.urdf.toml", [("settings.gravity", "-9.81")]),
    ("the same", LEVEL, "robot.sdf", [("gravity", "-9.81")]),
    ("the joints that a spring connects, with their signs",
     PAIRS, "mujoco.xml", [("joint coef", "1"), ("joint coef", "-1")]),
    ("the same",
     PAIRS, "robot.urdf.toml", [("spring.joints.x1", "-1"), ("spring.joints.x2", "1")]),
    ("the same",
     PAIRS, "robot.sdf.toml", [("spring.joints.x1", "-1"), ("spring.joints.x2", "1")]),
    ("a thin rod never rotates about its own axis",
     DRUM, "mujoco.xml", [("inertial diaginertia", "0.0001")]),
    ("the same", DRUM, "mujoco_rolling.xml", [("inertial diaginertia", "0.0001")]),
    ("the same", DRUM, "robot.urdf", [("inertia izz", "0.0001")]),
    ("the same", DRUM, "robot_folded.urdf", [("inertia izz", "0.0001")]),
    ("the same", DRUM, "robot_folded.sdf", [("izz", "0.0001")]),
    ("the axle only slides, so its moments have no effect",
     DRUM, "mujoco_rolling.xml", [("inertial diaginertia", "0.002")]),
    ("the same", DRUM, "robot.urdf", moments("0.002")),
    ("the setting is a flag", DRUM, "robot.urdf.toml",
     [(f"settings.{engine}.hold_mimics", "True") for engine in ("pinocchio", "idyntree", "drake")]),
    ("a point mass has no moments, but MuJoCo requires them",
     PENDULUM, "mujoco.xml", [("inertial diaginertia", "1e-14")]),
    ("the same", PENDULUM, "robot.urdf", moments("1e-14")),
    ("the same", PENDULUM, "robot.sdf", [(axis, "1e-14") for axis in ("ixx", "iyy", "izz")]),
    ("the position of relaxed springs is arbitrary",
     {"anchored_pair"}, "space.py", [("DISTANCE", "1.2"), ("REST_LENGTH", "0.75")]),
    ("the same", {"free_pair"}, "space.py", [("DISTANCE", "1.5"), ("REST_LENGTH", "1.2")]),
    ("the same", {"mass_spring_damper"}, "space.py", [("REST_LENGTH", "0.75")]),
    ("the same", DRUM, "space.py", [("REST_LENGTH", "1.1")]),
    ("the rest length of a spring without stiffness has no effect",
     {"anchored_pair"}, "space.py", [("rest_length", "0.9")]),
    ("the radius of the drum is visual, since the drum does not rotate",
     DRUM, "space.py", [("DRUM_RADIUS", "0.18")]),
]  # fmt: skip


def excepted(system: str) -> set[Number]:
    """Return the exceptions for a system: (file, key, number)."""
    return {(file, *item) for _, of, file, items in EXCEPTED if system in of for item in items}


def name(sidecar: Sidecar) -> str:
    return f"{sidecar.model.parent.name}-{sidecar.model.name}"


@pytest.fixture(scope="module", params=MODELS, ids=name)
def model(request: pytest.FixtureRequest) -> tuple[System, Sidecar]:
    return load_system(request.param.model.parent), request.param


def test_every_binding_is_exact(model: tuple[System, Sidecar]) -> None:
    system, sidecar = model
    bound = bindings(system, sidecar)
    assert bound
    assert [b.address for b in bound if not b.exact] == []
    assert [b.address for b in bound if b.correction != b.value] == []


@pytest.mark.parametrize("sidecar", [m for m in MODELS if m.model.parent.name in DRUM], ids=name)
def test_literal_off_by_a_few_roundings_is_reported(sidecar: Sidecar, tmp_path: Path) -> None:
    """Test the folder that has a model in every format."""
    system = load_system(sidecar.model.parent)
    bound = bindings(system, sidecar)
    for b in bound:
        off = b.value + 2 * b.rounding
        copy = with_literals(sidecar, {b.address: off}, tmp_path / "copy")
        assert [m.address for m in mismatches(bindings(system, copy))] == [b.address]


def test_every_physical_number_is_bound_or_excepted(model: tuple[System, Sidecar]) -> None:
    system, sidecar = model
    places = {b.address: b.place for b in bindings(system, sidecar)}
    assert unaccounted(sidecar, places, excepted(system.name)) == []


def test_every_exception_is_used() -> None:
    used: set[tuple[str, ...]] = set()
    files: set[tuple[str, str]] = set()
    for sidecar in MODELS:
        system = load_system(sidecar.model.parent)
        files |= {(system.name, sidecar.model.name), (system.name, f"{sidecar.model.name}.toml")}
        places = {b.address: b.place for b in bindings(system, sidecar)}
        used |= {(system.name, *item) for item in unaccounted(sidecar, places, ())}
    declared = {(system, *item) for system in SYSTEMS for item in excepted(system)}
    every = {(system, file) for _, of, file, _ in EXCEPTED if of is not SYSTEMS for system in of}
    assert every <= files
    # An exception of all systems is unused only in systems with a file of that name.
    assert {one for one in declared - used if one[:2] in files} == set()


@pytest.mark.parametrize(("folder", "file", "old", "new", "expected"), [
    ("drum_pendulum", "mujoco.xml", 'axis="0 -1 0"', 'axis="0 -1 0" damping="0.02"',
     ("mujoco.xml", "joint damping", "0.02")),
    ("drum_pendulum", "mujoco.xml", 'name="rod">', 'name="rod"><geom mass="0.1" size="1"/>',
     ("mujoco.xml", "geom mass", "0.1")),
    ("drum_pendulum", "robot.urdf", 'friction="0"', 'friction="0.1"',
     ("robot.urdf", "dynamics friction", "0.1")),
    ("drum_pendulum", "robot.urdf", "<springReference>0<", "<springReference>0.1<",
     ("robot.urdf", "springReference", "0.1")),
    ("drum_pendulum", "robot.urdf", 'xyz="0 0 -0.3"', 'xyz="0.01 0 -0.3"',
     ("robot.urdf", "origin xyz", "0.01")),
    ("drum_pendulum", "robot_folded.sdf", "<pose>0 0 -0.3 0", "<pose>0.01 0 -0.3 0",
     ("robot_folded.sdf", "pose", "0.01")),
    ("free_pair", "robot.urdf.toml", "rest = 0", "rest = 0.1",
     ("robot.urdf.toml", "spring.rest", "0.1")),
    ("drum_pendulum", "space.py", "GRAVITY = 9.81", "DRAG = 0.5\nGRAVITY = 9.81",
     ("space.py", "DRAG", "0.5")),
    ("drum_pendulum", "space.py", "pymunk.Body(ROD_MASS,", "pymunk.Body(0.8,",
     ("space.py", "Body", "0.8")),
    ("drum_pendulum", "space.py", "damping=0)", "damping=0.5)",
     ("space.py", "damping", "0.5")),
    ("drum_pendulum", "space.py", "(0, -GRAVITY)", "(0, -9.81)",
     ("space.py", "gravity", "9.81")),
])  # fmt: skip
def test_added_number_without_a_binding_is_reported(
    tmp_path: Path, folder: str, file: str, old: str, new: str, expected: Number
) -> None:
    shutil.copytree(builtin() / folder, tmp_path / folder)
    path = tmp_path / folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    sidecar = read_sidecar(tmp_path / folder / (re.sub(r"\.toml$", "", file) + ".toml"))
    system = load_system(tmp_path / folder)
    places = {b.address: b.place for b in bindings(system, sidecar)}
    assert unaccounted(sidecar, places, excepted(system.name)) == [expected]
