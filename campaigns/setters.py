"""Faults by the setters of engines: PyBullet's `changeDynamics`, and those of Drake and DART.

A fault changes a number of each model that an engine loads for a case, as a wrong loader would.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.registry import engines

Plant = Callable[[Any], None]
"""Changes a loaded model."""

Place = tuple[Path, int]
"""A file, and the first byte of an element."""

SHARES = 1e-4, 0.1

BY_WORD = re.compile(r"sol\w+|\w*range|friction|gear|\w+prm|polycoef|anchor|size|gravity|wind")
"""Attributes whose numbers are the entries of a row, in order."""


HOLDERS = "body", "link", "joint", "transmission"
"""Elements whose names owners of numbers have; of a transmission, its joint's."""


class LoadedFault(NamedTuple):
    """A change of a loaded model.

    Attributes:
        name: of the array, or of the setter.
        plant: changes the model.
        path: pattern of the paths of the file's numbers that the value comes from.
        owner: name of the element, or of its body or link; empty if it has none.
        word: index in the row of an array.
        places: of the element, then of the defaults that it takes; empty if unknown.
    """

    name: str
    plant: Plant
    path: str
    owner: str = ""
    word: int = 0
    places: tuple[Place, ...] = ()

    def stated(self, numbers: Iterable[tuple[Number, bool]]) -> list[bool]:
        """Return whether the numbers that the value comes from are tested: its own, or defaults."""
        mine = [(number, tested) for number, tested in numbers if self.concerns(number)]
        for file, start in self.places:
            here = [
                tested for one, tested in mine if (one.file, one.element.start) == (file, start)
            ]
            if here:
                return here
        return [tested for _, tested in mine if not self.places]

    def concerns(self, number: Number) -> bool:
        """Return whether the value comes from a number of the file."""
        if not re.fullmatch(self.path, number.path):
            return False
        if BY_WORD.fullmatch(number.key) and number.word != self.word:
            return False
        if self.places:
            return True
        above, names = number.element, {number.element.attributes.get("name", "")}
        while above.parent is not None and above.tag not in HOLDERS:
            above = above.parent
        driven = above.findall("joint") if above.tag == "transmission" else []
        names |= {one.attributes.get("name", "") for one in (above, *driven)}
        return not self.owner or "/default" in number.path or self.owner in names


@contextmanager
def planting(engine: str, plant: Plant | None) -> Iterator[None]:
    """Change each model that an engine loads."""
    with ExitStack() as stack:
        for kind, name in _loaders(engine) if plant is not None else ():
            assert plant is not None
            stack.enter_context(patch.object(kind, name, _then(getattr(kind, name), plant)))
        yield


def _loaders(engine: str) -> list[tuple[type, str]]:
    """Return the functions after which a fault is planted."""
    if engine == "pybullet":
        from physics_crosscheck.harness.engines.pybullet.adapter import PybulletModel
        from physics_crosscheck.harness.engines.pybullet.whole import PybulletWhole

        return [(PybulletModel, "_load"), (PybulletWhole, "_add_floor")]
    if engine == "drake":
        from physics_crosscheck.harness.engines.drake.adapter import DrakeUrdf
        from physics_crosscheck.harness.engines.drake.plant import Plant as DrakePlant
        from physics_crosscheck.harness.engines.drake.whole import DrakeWhole

        return [(DrakeUrdf, "complete"), (DrakeWhole, "_prepare"), (DrakePlant, "__init__")]
    if engine == "dart":
        from physics_crosscheck.harness.engines.dart.adapter import DartModel

        return [(DartModel, "__init__")]
    return [(type(engines()[engine]), name) for name in ("load", "load_whole")]


def _then(load: Callable[..., Any], plant: Plant) -> Callable[..., Any]:
    """Return a function that also changes what it loads: its result, or a plant to finalize."""

    def planted(self: Any, *rest: Any, **more: Any) -> Any:
        result = load(self, *rest, **more)
        building = load.__name__ in ("complete", "_prepare")
        loads = load.__name__ in ("load", "load_whole")
        changed = rest[0] if building else result if loads else self
        if changed is not None:
            plant(changed)
        return result

    return planted


Change = Callable[[Any, Any, float], Any]
"""Changes a number of a model's link or joint by a share."""


Places = Callable[[Any], list[tuple[str, Any]]]
"""Returns names and handles of links or joints of a model."""


def setter_faults(
    engine: str, spec: ModelSpec, rng: np.random.Generator, each: int
) -> Iterator[LoadedFault]:
    """Yield faults by an engine's setters in links and joints of a file."""
    seen = list[Any]()
    with planting(engine, seen.append):
        _ = engines()[engine].load_whole(spec) or engines()[engine].load(spec)
    setters, *places = SETTERS[engine]
    targets = [find(seen[-1]) for find in places]
    for name, (path, change) in setters.items():
        there = targets[_JOINT in path]
        for k in rng.choice(len(there), min(each, len(there)), replace=False):
            owner, place = there[k]
            for share in SHARES:
                yield LoadedFault(name, partial(_call, change, place, share), path, owner)


def _call(change: Change, place: Any, share: float, model: Any) -> None:
    has_floor = type(model).__name__ == "PybulletWhole"
    if (change is _pair) is has_floor:  # PyBullet forgets pairs of bodies that it has not loaded
        change(model, place, share)


_LINK, _JOINT = "robot/link/", "robot/joint/"


def _bullet_rows(model: Any, index: int, first: int = 0) -> list[tuple[str, int]]:
    import pybullet as p

    rows = [p.getJointInfo(model._body, i) for i in range(p.getNumJoints(model._body))]
    base = [(p.getBodyInfo(model._body)[0].decode(), -1)] if first < 0 else []
    moving = [row for row in rows if first < 0 or row[2] != p.JOINT_FIXED]
    return [*base, *((row[index].decode(), row[0]) for row in moving)]


def _dynamics(model: Any, link: int, share: float, *, word: str, index: int) -> None:
    import pybullet as p

    value = np.asarray(p.getDynamicsInfo(model._body, link)[index], dtype=float)
    changed = np.where(value > 0, value * (1 + share), share).tolist()
    words: dict[str, Any] = {word: changed}
    if word == "contactStiffness":
        words = {word: max(1e4, changed), "contactDamping": 10.0}
    p.changeDynamics(model._body, link, **words)


def _set_dynamics(model: Any, link: int, share: float, *, word: str, to: float) -> None:
    """Set a number that has no getter to a value, which a large fault quarters."""
    import pybullet as p

    p.changeDynamics(model._body, link, **{word: to * (1 if share < SHARES[1] else 0.25)})


def _bullet_joint(model: Any, link: int, share: float, *, word: str) -> None:
    import pybullet as p

    info = p.getJointInfo(model._body, link)
    damping, lower, upper = info[6], info[8], info[9]
    words: dict[str, Any] = {
        "damping": {"jointDamping": damping + share * (damping or 1)},
        "lower": {"jointLowerLimit": lower - share * (abs(lower) or 1), "jointUpperLimit": upper},
        "upper": {"jointLowerLimit": lower, "jointUpperLimit": upper + share * (abs(upper) or 1)},
    }
    p.changeDynamics(model._body, link, **words[word])


def _mask(model: Any, link: int, _: float) -> None:
    import pybullet as p

    p.setCollisionFilterGroupMask(model._body, link, 0, 0)


def _pair(model: Any, link: int, _: float) -> None:
    """Filter the contacts of a link with the floor."""
    import pybullet as p

    p.setCollisionFilterPair(model._body, model._floor, link, -1, 0)


_BULLET: dict[str, tuple[str, Change]] = {
    **{
        word: (_LINK + path, partial(_dynamics, word=word, index=index))
        for word, index, path in (
            ("mass", 0, "inertial/mass@value"), ("localInertiaDiagonal", 2, "inertial/inertia@.*"),
            ("lateralFriction", 1, "contact/lateral_friction@value"),
            ("restitution", 5, "contact/restitution@value"),
            ("rollingFriction", 6, "contact/rolling_friction@value"),
            ("spinningFriction", 7, "contact/spinning_friction@value"),
            ("contactStiffness", 9, "contact/(stiffness|damping)@value"),
            ("linearDamping", 5, "-"), ("angularDamping", 5, "-"),
        )
    },
    **{
        word: (path, partial(_set_dynamics, word=word, to=to))
        for word, path, to in (
            ("jointLimitForce", f"{_JOINT}limit@(lower|upper)", 0.4),
            ("maxJointVelocity", f"{_JOINT}limit@velocity", 0.4),
            ("collisionMargin", f"{_LINK}collision/.*", 0.01),
            ("frictionAnchor", f"{_LINK}contact/friction_anchor.*", 1.0),
            ("contactProcessingThreshold", "-", 0.0),
            ("contactDamping", f"{_LINK}contact/damping@value", 40.0),
        )
    },
    "setCollisionFilterGroupMask": (f"{_LINK}collision/.*", _mask),
    "setCollisionFilterPair": (f"{_LINK}collision/.*", _pair),
    "jointLowerLimit": (f"{_JOINT}limit@lower", partial(_bullet_joint, word="lower")),
    "jointUpperLimit": (f"{_JOINT}limit@upper", partial(_bullet_joint, word="upper")),
    "jointDamping": (f"{_JOINT}dynamics@damping", partial(_bullet_joint, word="damping")),
}  # fmt: skip


def _drake_links(plant: Any) -> list[tuple[str, str]]:
    from pydrake.multibody.tree import BodyIndex

    count = plant._plant.num_bodies()
    bodies = [plant._plant.get_body(BodyIndex(i)) for i in range(1, count)]
    return [(body.name(), body.name()) for body in bodies if body.default_mass() > 0]


def _drake_joints(plant: Any) -> list[tuple[str, str]]:
    joints = (plant._plant.get_joint(i) for i in plant._plant.GetJointIndices())
    return [(one.name(), one.name()) for one in joints if one.num_velocities() == 1]


def _drake_body(model: Any, name: str, share: float, *, word: str) -> None:
    """Change a body in the context of a finalized plant."""
    from pydrake.multibody.tree import SpatialInertia, UnitInertia

    if not hasattr(model, "context"):
        return
    body = model._plant.GetBodyByName(name)
    mass, center = body.default_mass(), body.default_com()
    unit = body.default_spatial_inertia().get_unit_inertia()
    moments, products = ((1 + share) * row for row in (unit.get_moments(), unit.get_products()))
    value: Any = {
        "SetMass": mass * (1 + share),
        "SetCenterOfMassInBodyFrame": center * (1 + share) + 1e-3 * share,
        "SetSpatialInertiaInBodyFrame": SpatialInertia(
            mass, center, UnitInertia(*moments, *products), True
        ),
    }[word]
    getattr(body, word)(model.context, value)


def _drake_joint(model: Any, name: str, share: float, *, word: str) -> Any:
    """Change a joint, or the whole plant, before the plant is finalized."""
    from pydrake.multibody.plant import ContactModel

    if hasattr(model, "context") or model.is_finalized():
        return None
    if word == "set_contact_model":
        return model.set_contact_model(ContactModel.kHydroelastic)
    joint = model.GetJointByName(name)
    if word == "set_gravity_enabled":
        return model.set_gravity_enabled(joint.model_instance(), False)
    if word == "set_default_positions":
        return joint.set_default_positions(joint.default_positions() + share)
    if word.startswith("set_default_") and "damping" not in word:
        return _drake_actuator(model, joint, share, word)
    old = joint.position_lower_limits() if "limits" in word else joint.default_damping_vector()
    new = old + share * np.where(np.isfinite(old) & (old != 0), -abs(old), -1) * (
        1 if "limits" in word else -1
    )
    more = [joint.position_upper_limits()] if "limits" in word else []
    return getattr(joint, word)(new, *more)


def _drake_actuator(plant: Any, joint: Any, share: float, word: str) -> None:
    """Change the actuator of a joint; without one, add one, which has no rotor by the file."""
    every = (plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices())
    actuator = next((one for one in every if one.joint().name() == joint.name()), None)
    actuator = actuator or plant.AddJointActuator(f"fault of {joint.name()}", joint)
    old = getattr(actuator, word.removeprefix("set_"))()
    getattr(actuator, word)(old + share * (old or 1.0))


_DRAKE: dict[str, tuple[str, Change]] = {
    **{
        word: (_LINK + path, partial(_drake_body, word=word))
        for word, path in (
            ("SetMass", "inertial/mass@value"),
            ("SetSpatialInertiaInBodyFrame", "inertial/inertia@.*"),
            ("SetCenterOfMassInBodyFrame", "inertial/origin@xyz"),
        )
    },
    **{
        word: (_JOINT + path, partial(_drake_joint, word=word))
        for word, path in (
            ("set_default_damping_vector", "dynamics@damping"), ("set_gravity_enabled", "-"),
            ("set_position_limits", "limit@(lower|upper)"), ("set_contact_model", "-"),
            ("set_default_positions", "-"),
        )
    },
    **{
        f"set_default_{word}": (
            f".*({_JOINT}|transmission/actuator/)drake:{word}@value",
            partial(_drake_joint, word=f"set_default_{word}"),
        )
        for word in ("rotor_inertia", "gear_ratio")
    },
}  # fmt: skip


def _dart_links(model: Any) -> list[tuple[str, str]]:
    nodes = map(model._body.getBodyNode, range(model._body.getNumBodyNodes()))
    return [(name, name) for name in (node.getName() for node in nodes)]


def _dart_joints(model: Any) -> list[tuple[str, str]]:
    joints = map(model._body.getJoint, range(model._body.getNumJoints()))
    return [(one.getName(), one.getName()) for one in joints if one.getNumDofs() == 1]


def _dart(model: Any, name: str, share: float, *, word: str) -> Any:
    if word == "setGravity":
        return model._world.setGravity((1 + share) * model._world.getGravity())
    if word in ("setGravityMode", "setCollidable"):
        return getattr(model._body.getBodyNode(name), word)(False)
    if word in ("setMass", "setLocalCOM", "setMomentOfInertia"):
        node = model._body.getBodyNode(name)
        (xx, xy, xz), (_, yy, yz), (*_, zz) = (1 + share) * node.getInertia().getMoment()
        return {
            "setMass": lambda: node.setMass(node.getMass() * (1 + share)),
            "setLocalCOM": lambda: node.setLocalCOM((1 + share) * node.getLocalCOM() + share),
            "setMomentOfInertia": lambda: node.setMomentOfInertia(xx, yy, zz, xy, xz, yz),
        }[word]()
    joint = model._body.getJoint(name)
    value = getattr(joint, word.replace("set", "get"))(0)
    return getattr(joint, word)(0, value + share * (abs(value) or 1.0))


_DART: dict[str, tuple[str, Change]] = {
    word: (path, partial(_dart, word=word))
    for word, path in (
        ("setMass", f"{_LINK}inertial/mass@value"), ("setGravity", f"{_LINK}-"),
        ("setMomentOfInertia", f"{_LINK}inertial/inertia@.*"),
        ("setLocalCOM", f"{_LINK}inertial/origin@xyz"),
        ("setDampingCoefficient", f"{_JOINT}dynamics@damping"),
        ("setCoulombFriction", f"{_JOINT}dynamics@friction"),
        ("setSpringStiffness", f"{_JOINT}-"), ("setRestPosition", f"{_JOINT}-"),
        ("setPositionLowerLimit", f"{_JOINT}limit@lower"),
        ("setPositionUpperLimit", f"{_JOINT}limit@upper"),
        ("setVelocityUpperLimit", f"{_JOINT}limit@velocity"),
        ("setVelocityLowerLimit", f"{_JOINT}limit@velocity"),
        ("setForceUpperLimit", f"{_JOINT}limit@effort"), ("setInitialPosition", f"{_JOINT}-"),
        ("setGravityMode", f"{_LINK}-"), ("setCollidable", f"{_LINK}collision/.*"),
    )
}  # fmt: skip

SETTERS: Mapping[str, tuple[Mapping[str, tuple[str, Change]], Places, Places]] = {
    "pybullet": (
        _BULLET, partial(_bullet_rows, index=12, first=-1), partial(_bullet_rows, index=1)
    ),
    "drake": (_DRAKE, _drake_links, _drake_joints),
    "dart": (_DART, _dart_links, _dart_joints),
}  # fmt: skip
"""Setters of each engine by name, with the paths of their numbers, and its links and joints."""
