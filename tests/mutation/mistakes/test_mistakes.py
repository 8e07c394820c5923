"""Known mistakes: each is caught, and its cause is named from the motions alone."""

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from physics_crosscheck.harness.checks.task import load, model_task
from physics_crosscheck.harness.checks.verdict import judge
from physics_crosscheck.harness.diagnosis.task import ranked
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.records import Outcome
from tests.physics import physics
from tests.standing import keep_default_engines

Edits = tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Mistake:
    """One mistake."""

    name: str
    system: str
    model: str
    engine: str
    edits: Edits
    causes: tuple[str, ...]
    needs: Edits = ()


XML, URDF, SPACE = "mujoco.xml", "robot.urdf", "space.py"
SETTINGS = "[settings]\n"


def xml(
    name: str, system: str, old: str, new: str, *causes: str, needs: Edits = (), model: str = XML
) -> Mistake:
    return Mistake(name, system, model, "mujoco", ((model, old, new),), causes, needs)


def urdf(
    name: str, system: str, old: str, new: str, *causes: str, engine: str = "pybullet"
) -> Mistake:
    return Mistake(name, system, URDF, engine, ((URDF, old, new),), causes)


def setting(name: str, system: str, line: str, *causes: str) -> Mistake:
    edit = (f"{URDF}.toml", SETTINGS, f"{SETTINGS}{line}\n")
    return Mistake(name, system, URDF, "pybullet", (edit,), causes)


def space(name: str, system: str, old: str, new: str, *causes: str) -> Mistake:
    return Mistake(name, system, SPACE, "pymunk", ((SPACE, old, new),), causes)


MSD = "mass_spring_damper"
FREE, DRUM, PENDULUM = "free_pair", "drum_pendulum", "simple_pendulum"

# The same pendulum with its frame drawn at 0.5 rad.
ROTATED_ZERO = (
    (XML, '<body name="pendulum" pos="0 0 1">',
     '<body name="pendulum" pos="0 0 1" quat="0.9689124217106447 0 -0.24740395925452294 0">'),
    (XML, 'axis="0 -1 0"', 'axis="0 -1 0" ref="0.5"'),
)  # fmt: skip
MISTAKES = (
    xml("damping left out", MSD, ' damping="0.9"', "", "c", "damping on x"),
    urdf("damping left out", MSD, 'damping="0.9"', 'damping="0"', "joint[x]/dynamics@damping"),
    xml("a rod's inertia about its end where its centre is meant", DRUM,
        '0.024 0.024', '0.096 0.096',
        "body[rod]/inertial@diaginertia[0], body[rod]/inertial@diaginertia[1]"),
    space("gravity off", DRUM, "space.gravity = (0, -GRAVITY)\n", "", "gravity along y"),
    xml("ref in degrees, for want of angle=radian", PENDULUM, 'angle="radian" ', "",
        "zero of theta", needs=ROTATED_ZERO),
    xml("a rest offset", MSD, 'springref="0"', 'springref="0.02"', "offset force on x"),
    xml("a soft equality with the default solref", DRUM,
        '\n           solref="1e-6 0.5" solimp="0.9999 0.9999 0.001 0.5 2"', "",
        "soft equality (solref, solimp)", model="mujoco_rolling.xml"),
    setting("PyBullet's damping left on", MSD, "link_damping = 0.04",
            "PyBullet's own damping of links"),
    setting("PyBullet's motors left on", MSD, "motors = true", "PyBullet's own motors"),
    space("Space.damping", MSD, "space.gravity = (0, 0)",
          "space.gravity = (0, 0)\n    space.damping = 0.9", "Space.damping"),
    Mistake("two constants exchanged", FREE, SPACE, "pymunk",
            ((SPACE, "MASS_1 = 1.1", "MASS_1 = 0.7"), (SPACE, "MASS_2 = 0.7", "MASS_2 = 1.1")),
            ("m1, m2 exchanged",)),
)  # fmt: skip


CopyModel = Callable[[Mistake, Edits], Sidecar]

SEGMENTS = 8
"""Segments of each scenario; few are enough here."""

SCENARIOS = 2
"""The first two scenarios: one is free, one is forced."""


def cases(mistakes: Iterable[Mistake]) -> list[ParameterSet]:
    absent = {name for name, engine in engines().items() if engine.version() is None}
    return [
        pytest.param(
            m,
            id=f"{m.name}-{m.system}-{m.engine}",
            marks=[
                pytest.mark.skipif(m.engine in absent, reason=f"{m.engine} is not installed"),
                *([pytest.mark.slow] if m.system.endswith("pendulum") else ()),
            ],
        )
        for m in mistakes
    ]


@pytest.fixture
def copy_model(tmp_path: Path) -> CopyModel:
    """Return a function that copies a built-in folder with texts replaced."""

    def make(mistake: Mistake, edits: Edits) -> Sidecar:
        folder = tmp_path / f"copy{len(list(tmp_path.iterdir()))}"
        shutil.copytree(builtin() / mistake.system, folder)
        keep_default_engines(folder)
        for name, old, new in edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return read_sidecar(folder / f"{mistake.model}.toml")

    return make


def outcome(mistake: Mistake, sidecar: Sidecar) -> Outcome:
    """Return the outcome of the second scenario, which has a known force."""
    prepared = physics(mistake.system)
    name = list(prepared.motions)[1]
    motion = prepared.motions[name]
    model, coordinates = load(prepared.system, sidecar, mistake.engine)
    claimed, _ = model.exponents(motion.varying)
    segments = motion.pick(motion.informative(SEGMENTS))
    result = extrapolate(model, coordinates, segments, resolution=1e-9)
    return judge(result.limit, segments, prepared.components, claimed, 1e-9).outcome


@pytest.mark.parametrize("mistake", cases(MISTAKES))
def test_mistake_is_caught_and_named(
    mistake: Mistake, copy_model: CopyModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.diagnosis.samples.SEGMENTS_PICKED", SEGMENTS)
    sidecar = copy_model(mistake, (*mistake.needs, *mistake.edits))
    prepared = physics(mistake.system)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    motions = dict(list(prepared.motions.items())[:SCENARIOS])
    task = model_task(prepared, mistake.engine, sidecar).with_target(motions=motions)
    ranking = ranked(task)
    first = ranking.fits[0]
    named = {str(cause) for cause in (*first.causes, *first.tied_with)}
    assert named & set(mistake.causes), (named, first.remaining)
    assert first.remaining < 1e-3
    assert ranking.explained


@pytest.mark.parametrize("mistake", cases([m for m in MISTAKES if m.needs]))
def test_model_before_a_mistake_agrees(mistake: Mistake, copy_model: CopyModel) -> None:
    assert outcome(mistake, copy_model(mistake, mistake.needs)) is Outcome.AGREES


def test_pybullet_reloads_a_rewritten_file(copy_model: CopyModel) -> None:
    if engines()["pybullet"].version() is None:
        pytest.skip("pybullet is not installed")
    mistake = next(m for m in MISTAKES if m.engine == "pybullet" and m.edits[0][0] == URDF)
    sidecar = copy_model(mistake, mistake.edits)
    assert outcome(mistake, sidecar) is Outcome.DIFFERS
    shutil.copy(builtin() / mistake.system / mistake.model, sidecar.model)
    assert outcome(mistake, sidecar) is Outcome.AGREES
