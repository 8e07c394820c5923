"""A humanoid with 29 joints and one wrong number, as a run writes it."""

from pathlib import Path

import numpy as np
from msgspec.structs import replace

from physics_crosscheck.harness.checks.scene import errors_record, scene_record
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.numerics.stepping import StepDefects
from physics_crosscheck.records import CauseId, Diagnosis, Outcome, Results, SourceLine
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.segments import Segments
from tests.report.samples import changed_model, explanation, located, results

STATES, WORST = 6, 3
WRONG = "left_knee"
CHAINS = {
    "leg": ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"),
    "arm": ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll",
            "wrist_pitch", "wrist_yaw"),
}  # fmt: skip


def humanoid() -> str:
    """Return an MJCF of a trunk with three joints, two legs and two arms: 29 hinges."""
    lines = ["<mujoco model='humanoid'>", "<worldbody>", "<body name='pelvis' pos='0 0 0.8'>"]
    lines += ["<geom type='box' size='0.1 0.12 0.06' mass='8'/>"]
    for prefix, y in (("left", 0.1), ("right", -0.1)):
        lines += _chain(prefix, CHAINS["leg"], (0, y, -0.1), (0, 0, -0.14))
    lines += _chain("waist", ("yaw", "roll", "torso"), (0, 0, 0.08), (0, 0, 0.1), close=False)
    for prefix, y in (("left", 0.2), ("right", -0.2)):
        lines += _chain(prefix, CHAINS["arm"], (0, y, 0.2), (0, np.sign(y) * 0.1, 0))
    return "\n".join([*lines, "</body>" * 4, "</worldbody>", "</mujoco>"]) + "\n"


def _chain(
    prefix: str,
    names: tuple[str, ...],
    start: tuple[float, ...],
    step: tuple[float, ...],
    close: bool = True,
) -> list[str]:
    lines, position = [], start
    for i, name in enumerate(names):
        body = f"{prefix}_{name}"
        mass = 2.97 if body == WRONG else 2.0
        lines += [
            f"<body name='{body}' pos='{' '.join(map(str, position))}'>",
            f"<joint name='{body}_joint' axis='{'1 0 0' if i % 2 else '0 1 0'}' range='-1 1'/>",
            f"<geom type='capsule' fromto='0 0 0 {' '.join(map(str, step))}' size='0.04'"
            f" mass='{mass}'/>",
        ]
        position = step
    return [*lines, "</body>" * len(names)] if close else lines


def states_of(tree: Tree, seed: int = 2) -> Segments:
    """Random states that move for a millisecond with random accelerations."""
    random = np.random.default_rng(seed)
    start = random.uniform(-0.8, 0.8, (STATES, 2 * tree.dof))
    segments = Segments.unsolved(start, 1e-3, np.zeros((STATES, 0)))
    rates: Array = random.uniform(-5, 5, (STATES, 2 * tree.dof))
    return Segments(**{**vars(segments), "end": start + 1e-3 * rates})


def humanoid_results(folder: Path) -> tuple[Results, Tree, Segments, Array]:
    """Return the file's results: tree, states, and differences of the engine at their ends."""
    text = humanoid()
    file = folder / "humanoid.xml"
    file.write_text(text)
    robot = read_robot(file)
    assert robot.tree is not None
    tree, states = robot.tree, states_of(robot.tree)
    scene = scene_record(tree, states, [part.link for part in robot.parts], robot.placed)
    names = tuple(link.name for link in tree.links)
    apart = np.random.default_rng(3).uniform(-1e-6, 1e-6, states.end.shape)
    apart[WORST] *= 100
    defects = StepDefects(defect=np.abs(apart), uncertainty=np.full_like(apart, 1e-12))
    errors = errors_record(tree, states, names, defects, apart)
    line = next(i for i, row in enumerate(text.splitlines(), 1) if "2.97" in row)
    where = located(SourceLine(file="humanoid.xml", line=line), text, "2.97")
    cause = explanation(CauseId(kind="literal", subject=("geom[29]@mass",)), 1e-10, (), "there")
    shown = replace(cause.causes[0], nominal=2.97, estimate=2.0, locations=(where,))
    sample = results(1)
    changed = changed_model(
        sample, 0, model="humanoid.xml", text=text, folder=str(file),
        diagnosis=Diagnosis(explained=True, explanations=(replace(cause, causes=(shown,)),)),
    ).models[0]  # fmt: skip
    case = replace(
        sample.cases[0], model="humanoid.xml", folder=str(file), scenario="states", series=None,
        full_run=None, outcome=Outcome.DIFFERS, by_state=errors,
    )  # fmt: skip
    system = replace(sample.systems[0], folder=str(file), sketch=None, derivation=None, scene=scene)
    results_ = replace(sample, systems=(system,), models=(changed,), cases=(case,))
    return results_, tree, states, apart
