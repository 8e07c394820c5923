"""Contacts against the shapes of a file: right files agree, faults after loading differ."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from campaigns.compiled_arrays import plant_in
from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.law_states import KeptSteps
from physics_crosscheck.harness.checks.shared_contacts import with_shared_contacts
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.reference.laws.solids import KINDS, Solid, distance, gap, overlap
from physics_crosscheck.reference.mechanism.rotations import from_rpy
from tests.laws.scenes import URDF_BOX, URDF_LEG
from tests.models import written
from tests.report import samples

pytest.importorskip("mujoco")

SHAPES = """<mujoco><option timestep="0.002"/><worldbody>
<geom name="floor" type="{}" size="3 3 .1" pos="0 0 {}" margin=".001" gap=".001"/>
<body pos="0 0 .11"><freejoint/><geom type="box" size=".1 .08 .1" mass="1"/>
<body pos=".3 0 0"><joint axis="0 1 0"/>
<geom name="arm" type="capsule" size=".03 .1" mass=".4"/><geom type="sphere" size=".05" mass=".1"/>
</body></body>
<body pos=".1 .5 .2"><freejoint/><geom type="ellipsoid" size=".1 .07 .05" mass="1"/></body>
<body pos="-.3 .5 .2" euler="3 5 0"><freejoint/>
<geom type="cylinder" size=".1 .05" mass="1"/></body></worldbody></mujoco>"""
SCENES = {"plane": SHAPES.format("plane", 0), "slab": SHAPES.format("box", -0.1)}


_CAPSULE = '<geom type="capsule" size=".08" fromto="0 0 0 -.2 -.2 0"/>'
HIP = f"""<mujoco><worldbody>{_CAPSULE}<body pos="-.2 -.2 0"><joint range="-30 30"/>{_CAPSULE}
</body></worldbody></mujoco>"""
"""Capsules whose axes meet at a hinge, where any normal is right."""

TILTED = URDF_BOX.replace('"0 0 0"/><geometry><box', '"0 0 0" rpy="0 5e-5 0"/><geometry><box')
UPRIGHT = re.sub("<box[^>]*>", '<cylinder radius=".2" length=".2"/>', TILTED)
"""A box and a cylinder on the floor, with a tilt that FCL neglects."""


def check(
    folder: Path, text: str, plant: Callable[[Any], None], engine: str = "mujoco"
) -> WholeStepCheck:
    """Compare a file whose loaded model is changed."""
    urdf = text.startswith("<robot")
    file = written(folder, ("robot.urdf" if urdf else "scene.xml"), text)
    spec = ModelSpec(file, settings={**SETTINGS, "floating": True} if urdf else {})
    steps = KeptSteps()
    plant(steps.model(engine, spec))
    result = check_whole_step(file, spec, engine, 1e-9, steps)
    assert result is not None
    return result


def scale(array: str, factor: float) -> Callable[[Any], None]:
    """Return a change of an array of a compiled model."""

    def plant(whole: Any) -> None:
        values = getattr(whole._model, array)
        values[:] = values * factor

    return plant


def _without_filter(whole: Any) -> None:
    import pybullet as p

    for link in range(-1, p.getNumJoints(whole._body)):
        p.setCollisionFilterGroupMask(whole._body, link, 0, 0)


def _no_change(whole: Any) -> None:
    assert whole is not None


@pytest.mark.usefixtures("few_states")
@pytest.mark.parametrize(
    ("text", "engine"),
    [(SCENES["plane"], "mujoco"), (SCENES["slab"], "mujoco"), (HIP, "mujoco"), (URDF_BOX, "mujoco"),
     (URDF_BOX, "pybullet"), (TILTED, "drake"), (UPRIGHT, "drake")],
)  # fmt: skip
def test_right_contacts_agree(tmp_path: Path, text: str, engine: str) -> None:
    """Catch a false alarm, and contacts that no one judges."""
    pytest.importorskip("pydrake" if engine == "drake" else engine)
    result = check(tmp_path, text, _no_change, engine)
    assert not result.record.differs
    assert result.record.contacts > 8
    partly = [one for one in result.record.omitted if "exact depths" in one]
    assert len(result.record.unjudged) == len(partly) == (text == SCENES["slab"])


FAULTS = {
    "masks": (SCENES["plane"], "mujoco", scale("geom_contype", 0), "missing"),
    "masks on a box": (SCENES["slab"], "mujoco", scale("geom_contype", 0), "missing"),
    "masks of a URDF": (URDF_BOX, "mujoco", scale("geom_contype", 0), "missing"),
    "larger": (SCENES["plane"], "mujoco", scale("geom_size", 1.5), "distance"),
    "larger by 1e-4": (SCENES["slab"], "mujoco", scale("geom_size", 1.0001), "distance"),
    "filter": (URDF_BOX, "pybullet", _without_filter, "missing"),
}


@pytest.mark.usefixtures("few_states")
@pytest.mark.parametrize("name", FAULTS)
def test_contact_lost_or_moved_after_loading_differs(tmp_path: Path, name: str) -> None:
    """Catch an engine whose steps agree with its law at contacts that the file does not have."""
    text, engine, plant, words = FAULTS[name]
    pytest.importorskip(engine)
    result = check(tmp_path, text, plant, engine)
    assert result.record.differs
    assert result.kind == "contact"
    assert words in result.record.contact_faults[0]


BOX = """<mujoco><worldbody><geom type="plane" size="3 3 .1"/><body pos="0 0 .1"><freejoint/>
<inertial pos="0 0 .01" mass="1" diaginertia=".01 .02 .02"/>
<geom type="box" size=".1 .1 .1" pos="0 .01 0" friction=".7"/></body></worldbody></mujoco>"""


ROTOR = """<transmission><type>SimpleTransmission</type><joint name="hip"/><actuator name="m">
<drake:rotor_inertia value=".001"/><drake:gear_ratio value="20"/></actuator></transmission>
</robot>"""
ARM = """<mujoco><option density="900" viscosity="1" integrator="implicitfast"/>
<default><joint range="-60 40" damping=".2"/><geom contype="0" conaffinity="0"/></default>
<worldbody><body><joint name="a" axis="0 1 0" frictionloss=".3" armature=".1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/><body pos=".3 0 0">
<joint name="b" axis="0 1 0" stiffness="2"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
</body></body></worldbody><tendon><fixed name="t" range="-.5 .4"><joint joint="a" coef="1"/>
<joint joint="b" coef="-.5"/></fixed></tendon>
<equality><joint joint1="b" joint2="a" polycoef="0 .5 0 0 0" solref=".1 1"/></equality>
<actuator><position joint="a" kp="20" ctrlrange="-1 1" forcerange="-5 5"/></actuator></mujoco>"""
_CYLINDER = '<geom type="cylinder" size=".05 .06" mass="1" {}/>'
CYLINDERS = f"""<mujoco><option gravity="0 0 0"/><worldbody><geom type="box" size=".1 .06 .05"/>
<body pos=".1 .02 .03"><joint axis="0 0 1" range="-60 60"/>{_CYLINDER.format("")}
<body pos="0 0 .1"><joint axis="1 .5 0" range="-40 40"/>{_CYLINDER.format('pos=".1 0 .02"')}
</body></body></worldbody><contact><exclude body1="world" body2="world"/></contact></mujoco>"""
WEDGE = '<asset><mesh name="w" vertex="-.1 -.1 -.1 .1 -.1 -.1 0 .1 -.1 0 0 .1"/></asset>'
MESHES = CYLINDERS.replace("<worldbody>", f"{WEDGE}<worldbody>").replace(
    'type="cylinder" size=".05 .06"', 'type="mesh" mesh="w"'
)
BETWEEN = {
    "same": (
        _no_change,
        r"depth of (\d+) of \1 contacts .*, on the normal of \1 and the point of \1",
    ),
    "larger": (scale("geom_size", 1.2), "depth of 0 of .*m deep in mjx.* in mjx is too large"),
    "lost": (scale("geom_contype", 0), r"depth of 0 of 0 .*; \d+ contacts in mujoco alone: geom:"),
}


@pytest.mark.usefixtures("few_states")
@pytest.mark.parametrize(("name", "text"), [*((one, CYLINDERS) for one in BETWEEN),
                                            ("same", MESHES)])  # fmt: skip
def test_contacts_without_a_closed_form_are_compared_between_engines(
    tmp_path: Path, name: str, text: str
) -> None:
    """Catch a contact of two cylinders that another engine finds deeper, or not at all."""
    plant, words = BETWEEN[name]
    case = samples.results().cases[0]
    cases = [
        replace(case, engine=engine, whole_step=check(tmp_path, text, change).record)
        for engine, change in (("mujoco", _no_change), ("mjx", plant))
    ]
    for compared in with_shared_contacts([*cases, replace(cases[0], scenario="other")])[:2]:
        assert compared.whole_step is not None
        (sentence,) = compared.whole_step.between
        assert re.search(words, sentence)


def test_contacts_of_one_link_belong_to_the_nearest_shape(tmp_path: Path) -> None:
    """Catch a contact of one of two boxes of a link that is looked for on the other box."""
    pytest.importorskip("pybullet")
    shape = '<collision><origin xyz="{} 0 .02"/><geometry>{}</geometry></collision>'
    box, end = '<box size=".1 .1 .1"/>', '</link>\n<link name="wheel">'
    text = URDF_BOX.replace(end, shape.format(-0.2, box) + shape.format(0.2, box) + end)
    assert not check(tmp_path, text, _no_change, "pybullet").record.contact_faults


PLANTED = {
    "mujoco": (BOX, "geom_(size|pos|solref)|body_mass|opt.timestep", 5),
    "mujoco, all kinds": (
        ARM, "jnt_range|dof_(damping|frictionloss|armature)|jnt_stiffness|tendon_range"
        "|actuator_(gainprm|ctrlrange|forcerange|gear)|eq_(data|solref)|opt.(density|viscosity)",
        14,
    ),
    "pybullet": (URDF_BOX, "mass|lateralFriction|restitution|setCollisionFilter.*", 5),
    "drake": (URDF_LEG.replace("</robot>", ROTOR),
              "set_(contact_model|position_limits|default_(rotor|gear).*)|SetMass|SetCenter.*", 5),
    "dart": (URDF_LEG.replace('damping=".2"', 'damping=".2" friction=".3"'),
             "set(CoulombFriction|Mass|MomentOfInertia|DampingCoefficient)", 4),
}  # fmt: skip
"""Files, and patterns of arrays or setters whose faults must all be detected."""


@pytest.mark.usefixtures("few_states")
@pytest.mark.parametrize("case", PLANTED)
def test_no_changed_number_is_wrongly_green(tmp_path: Path, case: str) -> None:
    """Catch a number of a loaded model that acts, counts as tested and makes no difference."""
    engine, (text, only, count) = case.partition(",")[0], PLANTED[case]
    pytest.importorskip({"drake": "pydrake", "dart": "dartpy"}.get(engine, engine))
    file = written(tmp_path, ("robot.urdf" if text.startswith("<robot") else "box.xml"), text)
    table = plant_in([file], seed=2, only=only, engine=engine, each=2, floating=engine != "dart")
    assert sum(counts["detected"] > 0 for counts in table.values()) == count
    verdicts = {verdict for counts in table.values() for verdict in counts}
    assert verdicts <= {"detected", "no effect", "listed"}


def test_repeated_contacts_are_counted(tmp_path: Path) -> None:
    """Catch four equal contacts of MJX at one corner, where MuJoCo finds one."""
    pytest.importorskip("mujoco.mjx")
    text = SCENES["slab"].partition('<body pos=".3')[0] + "</body></worldbody></mujoco>"
    text = text.replace('.11"', '.13" euler="3 5 0"')
    counts = check(tmp_path, text, _no_change, "mjx").record.contact_counts
    assert any("4 contacts, 1 in MuJoCo" in one for one in counts)


def test_excluded_contact_is_named(tmp_path: Path) -> None:
    """Catch a contact that the file excludes."""
    text = SCENES["plane"].replace('type="ellipsoid"', 'type="ellipsoid" contype="0"')
    text = text.replace('type="plane"', 'type="plane" contype="0"')

    def plant(whole: Any) -> None:
        whole._model.geom_contype[:] = whole._model.body_contype[:] = 1

    assert any(
        "although the file excludes it" in fault
        for fault in check(tmp_path, text, plant).record.contact_faults
    )


def test_distances_and_overlaps_are_consistent() -> None:
    """Catch a closed form that a gap along some direction exceeds, or that an overlap denies."""
    rng = np.random.default_rng(3)
    sizes = {"plane": 0, "sphere": 1, "capsule": 2, "cylinder": 2}
    for _ in range(400):
        first, other = (
            Solid(
                kind=kind, size=tuple(rng.uniform(0.05, 0.5, sizes.get(kind, 3))),
                rotation=from_rpy(*rng.normal(size=3)), origin=0.5 * rng.normal(size=3),
            )
            for kind in (str(rng.choice(KINDS)), str(rng.choice(KINDS[1:])))
        )  # fmt: skip
        exact, way = distance(first, other), rng.normal(size=3)
        if exact is None:
            continue
        assert gap(first, other, way / np.linalg.norm(way)) <= exact[0] + 1e-12
        if exact[1] is not None:
            assert gap(first, other, exact[1]) == pytest.approx(exact[0], abs=1e-12)
        if abs(exact[0]) > 1e-3:
            assert overlap(first, other) == (exact[0] < 0)
