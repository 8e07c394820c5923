"""How PhysX reads USD, and its drives in substeps, as listed in `docs/engines/physx.md`."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, LoadedModel, ModelSpec
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.poses import case_poses
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.forward_dynamics import forward_dynamics
from physics_crosscheck.harness.numerics.stepping import step_engine
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.solving.next_state import SteppedBodies
from tests.engines.extras import need
from tests.models import written

BODY = """def Xform "{}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
{{
    float physics:mass = {}
    point3f physics:centerOfMass = (0.05, -0.03, -0.1)
    float3 physics:diagonalInertia = (0.02, 0.015, 0.01)
    quatf physics:principalAxes = (0.8, 0.6, 0, 0)
}}
"""
HINGE = """def PhysicsRevoluteJoint "{1}"
  (prepend apiSchemas = ["PhysicsDriveAPI:angular", "NewtonJointAPI"])
{{
    uniform token physics:axis = "{2}"
    rel physics:body0 = </r/{0}>
    rel physics:body1 = </r/{1}_link>
    point3f physics:localPos0 = (0.1, 0.05, -0.2)
    float drive:angular:physics:stiffness = 5
    float drive:angular:physics:damping = 0.1
    float drive:angular:physics:targetPosition = 10
    float newton:damping = 0.01
    float newton:armature = 0.02
}}
"""
COUNT = "    int physxArticulation:solverPositionIterationCount = 4\n"
APIS = '"PhysicsArticulationRootAPI", "PhysxArticulationAPI"'
HEAD = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def PhysicsScene "scene"
{
}
def PhysicsFixedJoint "anchor"
{
    rel physics:body1 = </r/base>
}
"""
JOINTS = (("base", "a", "Y"), ("a_link", "b", "X"), ("a_link", "c", "Z"), ("b_link", "d", "Y"))
TREE = f'{HEAD}def Xform "r" (prepend apiSchemas = [{APIS}])\n{{\n{COUNT}' + BODY.format("base", 2)
TREE += "".join(BODY.format(f"{one[1]}_link", 0.5 + k / 4) for k, one in enumerate(JOINTS))
TREE += "".join(HINGE.format(*one) for one in JOINTS) + "}\n"
"""A fixed base and four hinges with drives: d is below b, whose sibling is c."""

ON_BODY = (
    (f" (prepend apiSchemas = [{APIS}])", ""), (COUNT, ""),
    ('"base" (prepend apiSchemas = [', f'"base" (prepend apiSchemas = [{APIS}, '),
    ("    float physics:mass = 2", f"{COUNT}    float physics:mass = 2"),
)  # fmt: skip
"""Edits that place the articulation root on the body of the base."""

LOOP = 'def PhysicsRevoluteJoint "a"', """def PhysicsSphericalJoint "loop" {
    uniform bool physics:excludeFromArticulation = 1
    rel physics:body0 = </r/c_link>
    rel physics:body1 = </r/d_link>
}
def PhysicsRevoluteJoint "a\""""  # fmt: skip
SLIDES = ("RevoluteJoint", "PrismaticJoint"), (":angular", ":linear")
STATED = (
    ('"PhysicsMassAPI"]', '"PhysicsMassAPI", "PhysxRigidBodyAPI"]'),
    (
        "    float physics:mass",
        "    float physxRigidBody:angularDamping = 0\n    float physics:mass",
    ),
)


def load(folder: Path, *edits: tuple[str, str], **settings: object) -> LoadedModel:
    need("physx")
    name = f"r{len(list(folder.iterdir()))}.usda"  # PhysX reads a path once
    path = written(folder, name, TREE, *edits)
    return engines()["physx"].load(ModelSpec(path, settings={"smooth": True, **settings}))


@pytest.mark.parametrize("edits", [
    (),
    [("upAxis", "kilogramsPerUnit = 1000\n    upAxis")],
    [("Count = 4", "Count = 32")],
    [("rel physics:body0 = </r/b_link>\n    rel physics:body1 = </r/d_link>\n"
      "    point3f physics:localPos0",
      "rel physics:body0 = </r/d_link>\n    rel physics:body1 = </r/b_link>\n"
      "    point3f physics:localPos1")],
], ids=["tree", "tonnes", "iterations", "turned"])  # fmt: skip
def test_next_states_and_accelerations_match_the_equations(
    edits: list[tuple[str, str]], tmp_path: Path
) -> None:
    """Include drives, whose order shows in the fourth digit of a step at four iterations."""
    need("physx")
    robot = prepare_tree(written(tmp_path, "r.usda", TREE, *edits), states=8)
    model, coordinates = model_task(robot, "physx").load()
    bodies, drawn = SteppedBodies(robot.tree), robot.samples
    for compare, largest in ((step_engine, 5e-5), (forward_dynamics, 1e-5)):
        result = compare(model, coordinates, bodies, drawn.start, drawn.start_inputs, 1e-5)
        assert result is not None
        assert result.judgement.largest_discrepancy < largest


def test_bodies_at_the_origin_are_where_the_file_puts_them(tmp_path: Path) -> None:
    need("physx")
    hinge = TREE.partition('def Xform "b_link"')[0] + HINGE.format(*JOINTS[0]) + "}\n"
    edits = ("(0.1, 0.05, -0.2)", "(0, 0, 0)"), ("(0.05, -0.03, -0.1)", "(0.1, 0.2, 0.33)")
    path = written(tmp_path, "r.usda", hinge, *edits)
    task = model_task(prepare_tree(path, states=8), "physx")
    check = case_poses(task, *task.load())
    assert check is not None
    assert check.findings == ()  # rounding about centers that are 0.4 m away


def motion(model: LoadedModel, h: float = 1e-3, n: int = 1, speed: float = 1.0) -> np.ndarray:
    """Return velocities after some steps from the same state."""
    z = model.home[None] + 0.2
    v = speed * np.ones_like(z)
    return np.asarray(model.rollout(z, v, h, n, None, n)[1][0, 0])


def test_articulation_root_on_the_base_frees_it_and_a_setting_moves_it(tmp_path: Path) -> None:
    right, freed = load(tmp_path), load(tmp_path, *ON_BODY)
    ((cause, remedy),) = freed.corrective_settings.items()
    assert "articulation root" in cause
    assert right.corrective_settings == {}
    assert freed.coordinates == right.coordinates
    still = freed.home[None]
    assert freed.accelerations(still, 0 * still, 0 * still) is None
    moved = load(tmp_path, *ON_BODY, **remedy)
    assert moved.corrective_settings == {}
    assert np.array_equal(motion(moved), motion(right))
    assert not np.array_equal(motion(freed), motion(right))
    case = run_case(model_task(prepare_tree(written(tmp_path, "r.usda", TREE, *ON_BODY)), "physx"))
    assert case.outcome is Outcome.UNRESOLVED


@pytest.mark.parametrize(("setting", "value", "speed", "edits"), [
    ("angular_damping", 0.05, 1.0, ()), ("angular_damping", 0.05, 1.0, STATED),
    ("bounded_speeds", True, 150.0, ()),
])  # fmt: skip
def test_own_effects_act_only_on_request_where_the_file_states_none(
    setting: str, value: float, speed: float, edits: tuple[tuple[str, str]], tmp_path: Path
) -> None:
    quiet, active = load(tmp_path), load(tmp_path, *edits, **{setting: value})
    assert quiet.corrective_settings == {}
    ((_, remedy),) = active.corrective_settings.items()
    assert remedy == {setting: type(value)(0)}
    difference = np.abs(motion(active, speed=speed) / motion(quiet, speed=speed) - 1).max()
    assert difference == 0 if edits else difference > 1e-5


def test_slow_articulations_stay_awake(tmp_path: Path) -> None:
    still = [("stiffness = 5", "stiffness = 0"), ("amping = 0.", "amping = 0.0000")]
    gravity = '"scene"\n{', '"scene"\n{\n    float physics:gravityMagnitude = 0'
    v = motion(load(tmp_path, gravity, *still), h=0.1, n=20, speed=1e-3)
    assert np.abs(v).min() > 1e-4


def test_units_are_those_of_the_stage(tmp_path: Path) -> None:
    meters = load(tmp_path, *SLIDES)
    gravity, wanted = meters.gravity, motion(meters)
    del meters  # PhysX holds stages of one unit at a time
    tenths = load(
        tmp_path, *SLIDES, ("metersPerUnit = 1", "metersPerUnit = 0.1"),
        ("(0.1, 0.05, -0.2)", "(1, 0.5, -2)"), ("(0.05, -0.03, -0.1)", "(0.5, -0.3, -1)"),
        ("(0.02, 0.015, 0.01)", "(2, 1.5, 1)"), ("Position = 10", "Position = 100"),
    )  # fmt: skip
    assert tenths.gravity == pytest.approx(gravity)
    np.testing.assert_allclose(motion(tenths), wanted, rtol=1e-5)
    with pytest.raises(EngineError, match="stages of one metersPerUnit at a time"):
        load(tmp_path, *SLIDES)


def test_limits_and_loops_and_held_joints(tmp_path: Path) -> None:
    lower, upper = (f"    float physics:{one}" for one in ("lowerLimit = -30", "upperLimit = 30"))
    limited = 'axis = "X"', f'axis = "X"\n{lower}\n{upper}'
    assert np.isinf(load(tmp_path, limited).limits).all()
    model = load(tmp_path, limited, smooth=False)
    row = model.coordinates.index("b")
    assert model.limits[row] == pytest.approx([-np.pi / 6, np.pi / 6])
    assert np.isinf(np.delete(model.limits, row, axis=0)).all()
    z = model.home[None] + 0.5
    assert model.rollout(z, 3 + 0 * z, 0.01, 10, None, 1)[0][0, :, row].max() < np.pi / 6 + 1e-4
    free, closed = (motion(load(tmp_path, LOOP, smooth=one)) for one in (True, False))
    assert np.array_equal(free, motion(load(tmp_path)))
    assert np.abs(closed - free).max() > 1e-3
    others = tuple(name for name in model.coordinates if name != "d")
    assert load(tmp_path, held=["d"]).coordinates == others


@pytest.mark.parametrize(("edit", "problem"), [
    (('"PhysicsArticulationRootAPI", ', ""), "0 prims have PhysicsArticulationRootAPI"),
    (("PhysicsRevoluteJoint", "PhysicsSphericalJoint"), "neither a slide nor a hinge"),
    (("#usda 1.0", "#usda 1.0\n)"), "not a USD layer"),
])  # fmt: skip
def test_files_that_it_cannot_run_are_refused(
    edit: tuple[str, str], problem: str, tmp_path: Path
) -> None:
    with pytest.raises(EngineError, match=problem):
        load(tmp_path, edit)


def test_assumed_mass_and_moments_are_remarks(tmp_path: Path) -> None:
    model = load(tmp_path, ("(0.02, 0.015, 0.01)", "(0, 0, 0)"), ("mass = 2", "mass = 0"))
    still = model.home[None]
    messages = " ".join(one.message for one in model.remarks(still, 0 * still))
    assert "PhysX gives base 1 kg" in messages
    assert "replaces the moments of base" in messages
