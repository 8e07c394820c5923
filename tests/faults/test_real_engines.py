"""The same faults in real engines, in copies of the built-in model files."""

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from physics_crosscheck.records import Case
from tests.faults.known_folder import (
    discrepancy,
    off,
    one_scenario,
    run_folders,
    uncertainty,
    variant,
)
from tests.standing import keep_default_engines, shorten_scenarios

Ran = dict[tuple[str, str, str], list[Case]]
"""Cases by system, file and name of the variant."""

pytestmark = [pytest.mark.xdist_group("real engines"), pytest.mark.slow]

for engine in ("mujoco", "pybullet", "pymunk"):
    pytest.importorskip(engine)

# Literals off by a factor of 1 + 1e-6, by system and file: name -> text whose last number changes.
# tests/diagnosis/test_random_draws.py has those of the mass on a spring.
LITERALS: dict[tuple[str, str], dict[str, str]] = {
    ("simple_pendulum", "mujoco.xml"): {"length": 'pos="0 0 -0.75'},
    ("simple_pendulum", "robot.urdf"): {"mass": 'mass value="0.45'},
    ("simple_pendulum", "space.py"): {"gravity": "GRAVITY = 9.81"},
    ("drum_pendulum", "mujoco.xml"): {
        "armature": 'armature="1.2', "inertia": 'diaginertia="0.024 0.024',
    },
    ("drum_pendulum", "robot.urdf"): {
        "rolling": 'multiplier="5.555555555555555', "turning": 'ixx="0.02744" iyy="0.03888',
    },
    ("drum_pendulum", "mujoco_rolling.xml"): {"ratio": 'polycoef="0 5.555555555555555'},
    ("drum_pendulum", "space.py"): {"rest": "REST_LENGTH = 1.1", "inertia": "INERTIA = 0.024"},
}  # fmt: skip

# Friction is a share of this force: stiffness times amplitude, or weight times length.
FRICTION = {
    f"friction_{e}": [('springref="0"', f'springref="0" frictionloss="{12 * 10.0**-e:.3g}"')]
    for e in (1, 4)
}
HARD = 'solref="1e-6 0.5" solimp="0.9999 0.9999 0.001 0.5 2"'
BOUNDS = '<limit lower="-0.8" upper="0.8" effort="1000" velocity="100"/>'
HINGE = '<axis xyz="0 -1 0"/>'
OTHERS: dict[tuple[str, str], dict[str, list[tuple[str, str]]]] = {
    ("mass_spring_damper", "mujoco.xml"): FRICTION | {
        "good": [],
        "range": [('springref="0"', 'springref="0" limited="true" range="-0.12 0.12"')],
        "far_range": [('springref="0"', 'springref="0" limited="true" range="-2 2"')],
        "coarse": [('timestep="0.002"', 'timestep="0.5"')],
        "broken": [("</worldbody>", "</worldbodi>")],
    },
    ("mass_spring_damper", "robot.urdf"): {
        "limit": [('lower="-100" upper="100"', 'lower="-0.12" upper="0.12"')],
        "friction": [('friction="0"', 'friction="0.12"')],
        "coarse": [("step = 0.002", "step = 0.5")],
        "broken": [("</robot>", "</robo>")],
    },
    ("mass_spring_damper", "space.py"): {
        "drag": [("(0, 0)\n", "(0, 0)\n    space.damping = 0.99\n")],
        "coarse": [("step = 0.002", "step = 0.5")],
        "broken": [("pymunk.Body(MASS", "pymunk.Body(MAS")],
    },
    ("simple_pendulum", "mujoco.xml"): {
        "range": [('axis="0 -1 0"', 'axis="0 -1 0" limited="true" range="-0.8 0.8"')],
        "friction": [('axis="0 -1 0"', 'axis="0 -1 0" frictionloss="0.03"')],
    },
    ("simple_pendulum", "robot.urdf"): {
        "limit": [('type="continuous"', 'type="revolute"'), (HINGE, HINGE + BOUNDS)],
    },
    ("drum_pendulum", "mujoco.xml"): {
        "range": [('springref="0"', 'springref="0" limited="true" range="-0.05 0.05"')],
        "springref": [('springref="0"', 'springref="1e-6"')],
    },
    ("drum_pendulum", "mujoco_rolling.xml"): {"soft": [(HARD, "")]},
    ("drum_pendulum", "robot.urdf"): {
        "limit": [('lower="-100" upper="100"', 'lower="-0.05" upper="0.05"')],
    },
}  # fmt: skip

SCENARIO = {
    "mass_spring_damper": "resonance",
    "simple_pendulum": "driven",
    "drum_pendulum": "driven",
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """Run every variant; return cases by system, file and name of the variant."""
    place = tmp_path_factory.mktemp("real")
    folders: dict[str | tuple[str, str], Path] = {}
    for system, scenario in SCENARIO.items():
        folders[system] = one_scenario(system, place / system, scenario)
        # A pendulum reaches its limit only in a scenario with a large swing.
        folders["far", system] = one_scenario(system, place / f"{system}_far", "free")
        # An unstable motion needs time to diverge.
        folders["long", system] = one_scenario(system, place / f"{system}_long", scenario)
    for (system, source), names in LITERALS.items():
        for name, text in names.items():
            file = f"{source.split('.')[0]}-literal_{name}"
            variant(folders[system], system, source, file, off(text))
    for (system, source), faults in OTHERS.items():
        for name, changes in faults.items():
            far = system == "simple_pendulum" and name in {"range", "limit"}
            kind = "far" if far else "long" if name == "coarse" else ""
            folder = folders[kind, system] if kind else folders[system]
            variant(folder, system, source, f"{source.split('.')[0]}-{name}", *changes)
    used = [f for f in folders.values() if any(f.glob("*.toml"))]
    for folder in used:
        keep_default_engines(folder)
        if not folder.name.endswith("_long"):
            shorten_scenarios(folder, 3)
    results = run_folders(*used, out=place / "results.json", verdicts=True)
    cases: Ran = {}
    for case in results.cases:
        stem, suffix = case.model.split(".")
        source, name = stem.split("-")
        cases.setdefault((case.system, f"{source}.{suffix}", name), []).append(case)
    return cases


def pairs(
    table: Mapping[tuple[str, str], Mapping[str, object]], *wanted: str
) -> list[tuple[str, str, str]]:
    """Return (system, file, name) of all variants, or of the wanted ones."""
    everything = [(*key, name) for key, entry in table.items() for name in entry]
    return [p for p in everything if not wanted or p[-1] in wanted]


@pytest.mark.parametrize(("system", "source", "name"), pairs(OTHERS, "good", "far_range"))
def test_unmodified_file_agrees(ran: Ran, system: str, source: str, name: str) -> None:
    for case in ran[system, source, name]:
        assert case.outcome == "AGREES", case.reason
        assert uncertainty(case) < 1e-10


@pytest.mark.parametrize(("system", "source", "name"), pairs(LITERALS))
def test_literal_error_of_1e_6_differs(ran: Ran, system: str, source: str, name: str) -> None:
    for case in ran[system, source, f"literal_{name}"]:
        assert case.outcome == "DIFFERS", case.reason
        # The effect depends on the number's share of the forces; a pendulum's length counts twice.
        assert 5e-8 < discrepancy(case) < 1e-5
        assert uncertainty(case) < discrepancy(case) / 1000


@pytest.mark.parametrize("exponent", [1, 4])
def test_joint_friction_differs_in_proportion_to_its_force(ran: Ran, exponent: int) -> None:
    (case,) = ran["mass_spring_damper", "mujoco.xml", f"friction_{exponent}"]
    assert case.outcome == "DIFFERS", case.reason
    assert 0.2 < discrepancy(case) * 10**exponent < 5


# Drag, friction in a hinge, a rest position off by a micrometre, and rolling by a soft equality.
SINGLE = [("mass_spring_damper", "space.py", "drag"), ("simple_pendulum", "mujoco.xml", "friction"),
          ("drum_pendulum", "mujoco.xml", "springref"),
          ("drum_pendulum", "mujoco_rolling.xml", "soft")]  # fmt: skip


@pytest.mark.parametrize("fault", SINGLE)
def test_single_fault_differs(ran: Ran, fault: tuple[str, str, str]) -> None:
    (case,) = ran[fault]
    assert case.outcome == "DIFFERS", case.reason
    assert discrepancy(case) > 1e-4 or fault[-1] != "soft"


def test_urdf_friction_differs_in_engines_that_apply_it(ran: Ran) -> None:
    by_engine = {c.engine: c for c in ran["mass_spring_damper", "robot.urdf", "friction"]}
    assert by_engine["mujoco"].outcome == "DIFFERS"
    assert 2e-3 < discrepancy(by_engine["mujoco"]) < 5e-2
    # PyBullet's joint friction is its default motor, which is off here: the motion has none.
    assert by_engine["pybullet"].outcome == "AGREES"


@pytest.mark.parametrize(("system", "source", "name"), pairs(OTHERS, "range", "limit"))
def test_reached_joint_limit_never_agrees(ran: Ran, system: str, source: str, name: str) -> None:
    for case in ran[system, source, name]:
        assert case.outcome in {"DIFFERS", "UNRESOLVED"}
        assert discrepancy(case) > 0.01
        if case.outcome == "UNRESOLVED":
            assert "not smooth" in case.reason


@pytest.mark.parametrize("fault", pairs(OTHERS, "coarse", "broken"))
def test_unstable_step_and_invalid_file_are_reported(ran: Ran, fault: tuple[str, str, str]) -> None:
    suffix = fault[1].split(".")[1]
    reason = {"coarse": r"at dt = 0\.5 s the motion", "broken": rf"-broken\.{suffix}:.*\d"}
    for case in ran[fault]:
        assert case.outcome == "FAILED"
        assert re.search(reason[fault[-1]], case.reason)
