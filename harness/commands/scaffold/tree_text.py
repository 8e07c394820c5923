"""Write system.py and the sidecar of a robot: declared bodies, each number with its line."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any

from physics_crosscheck.harness.commands.scaffold.places import Key
from physics_crosscheck.harness.commands.scaffold.text import comment, literal, plain, quoted
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.modelfiles.robot import BodyModel
from physics_crosscheck.reference.mechanism.bodies import Coupling, ForceElement, Joint, RigidBody
from physics_crosscheck.reference.mechanism.force_paths import JointForce

_BODY: Mapping[str, tuple[str, tuple[str, ...]]] = MappingProxyType({
    "position": ("m", ()),
    "rpy": ("rad", ()),
    "quaternion": ("w, x, y, z", ()),
    "mass": ("kg", ("inertial/mass", "inertial")),
    "center": ("m", ("inertial/origin", "inertial")),
    "inertia": ("kg m^2", ("inertial/inertia", "inertial")),
    "inertia_rpy": ("rad", ("inertial/origin",)),
    "inertia_quaternion": ("w, x, y, z", ("inertial",)),
    "lift": ("share of its weight", ()),
    "dragged": ("by the medium", ()),
})  # fmt: skip
"""Fields of a body: unit, and the elements that state them."""

_PLACING = ("position", "rpy", "quaternion")

_JOINT_IN = MappingProxyType({
    "axis": ("axis",), "damping": ("dynamics",), "limits": ("limit",),
    "stiffness": ("springStiffness",), "rest": ("springReference",),
})  # fmt: skip

_TURNING = MappingProxyType({
    "at": "m", "zero": "rad", "damping": "N m s/rad", "stiffness": "N m/rad", "rest": "rad",
    "armature": "kg m^2", "limits": "rad",
})  # fmt: skip
_SLIDING = MappingProxyType({
    "at": "m", "zero": "m", "damping": "N s/m", "stiffness": "N/m", "rest": "m",
    "armature": "kg", "limits": "m",
})  # fmt: skip
_FREE = MappingProxyType({"damping": "N m s/rad and N s/m", "armature": "kg m^2 and kg"})


def tree_text(
    name: str, title: str, file: str, bodies: BodyModel, where: Mapping[Key, str], compiled: str
) -> str:
    """Return the text of system.py; text of the model file appears in literals only.

    Args:
        name: name of the system.
        title: description of the system.
        file: name of the model file.
        bodies: bodies of the robot.
        where: places of the bodies in the file.
        compiled: engine that compiled the numbers; empty if the file states them.
    """
    shown = plain(file)
    number = "Every number is as the file has it"
    if compiled:
        number = (
            f"Every number is as {compiled} compiles the file: in SI units, with defaults, frames"
            " and shapes put in"
        )
    more = {"Coupling": bodies.couplings, "Fluid": bodies.fluid, "ForceElement": bodies.pulls}
    named = [name for name, there in more.items() if there]
    ways = [pull.along for pull in bodies.pulls if pull.along is not None]
    named += {type(one).__name__ for one in ways}
    named += ["Site"] if any(not isinstance(one, JointForce) for one in ways) else []
    used = sorted(["Joint", "MultibodySystem", "RigidBody", *named])
    lines = [
        f'""{quoted(f"The physics of {name}, read from {shown} by `crosscheck new`.")}""',
        "",
        f"from physics_crosscheck import {', '.join(used)}",
        "",
        *comment(f"""{number}, with its line beside it. It was all read from {shown} itself, so it
        checks the engines, and every later edit of {shown}: but not yet {shown} against what you
        mean. For that, put in your own numbers, from drawings and data sheets."""),
        "",
        "system = MultibodySystem(",
        f"    name={quoted(name)},",
        f"    title={quoted(title)},",
        f"    source={quoted(f'{shown}, read by crosscheck new')},",
        f"    gravity={_number(bodies.gravity)},  # m/s^2",
        "    # Each body after the one that carries it; one without joints is welded to that. Its",
        "    # inertia is ixx, iyy, izz, ixy, ixz and iyz about its center of mass.",
        "    bodies=(",
        *(line for body in bodies.bodies for line in _body(body, where)),
        "    ),",
    ]  # fmt: skip
    if bodies.pulls:
        lines += [
            "    # Tendons, and actuators with their inputs held at `control`.",
            "    pulls=(",
            *(line for pull in bodies.pulls for line in _force_element(pull, where)),
            "    ),",
        ]
    if bodies.couplings:
        lines += [
            "    # Joints that follow others.",
            "    couplings=(",
            *map(_coupling, bodies.couplings),
            "    ),",
        ]
    if bodies.fluid:
        fluid_fields = (
            f"{key}={_number(value)}" for key, value in _stated_fields(bodies.fluid, ())
        )
        lines += [f"    fluid=Fluid({', '.join(fluid_fields)}),  # kg/m^3, Pa s, m/s"]
    return "\n".join([*lines, ")", ""])


def tree_sidecar(
    file: str,
    engines: Sequence[Engine],
    left_out: Mapping[str, str],
    settings: Sequence[str],
    own_settings: Mapping[str, object],
) -> str:
    """Return the sidecar: engines, settings that the format lacks, and parts that are not compared.

    Args:
        file: name of the model file.
        engines: engines that run it.
        left_out: engines that can't run it, and why.
        settings: lines for a format that states no time step and no gravity, with `[settings]`.
        own_settings: further settings of the comparison with bodies.
    """
    lines = [f"# The sidecar of {plain(file)}: settings that the file itself can't express."]
    lines += [f"# Left out: {plain(f'{name}: {why}')}" for name, why in left_out.items()]
    lines += [f"engines = [{', '.join(quoted(e.name) for e in engines)}]", ""]
    lines += [line for line in settings if line] or ["[settings]"]
    lines += [
        "# Contacts, limits and dry friction have no digits to compare: the bodies move without,",
        "# and joints follow others where `couplings` names them.",
        *(f"{key} = {json.dumps(value)}" for key, value in own_settings.items()),
        "",
    ]
    for engine in engines if settings else ():
        if engine.stated_settings:
            stated = engine.stated_settings.items()
            lines += [f"[settings.{engine.name}]"]
            lines += [f"{key} = {literal(value)}" for key, value in stated] + [""]
    return "\n".join(lines)


def _body(body: RigidBody, where: Mapping[Key, str]) -> Iterator[str]:
    yield _opening(8, "RigidBody(", where.get(("body", body.name), ""))
    yield f"            name={quoted(body.name)},"
    yield f"            parent={None if body.parent is None else quoted(body.parent)},"
    origin = "" if not body.joints else where.get(("joint", body.joints[0].name, "origin"), "")
    body_fields = dict(_stated_fields(body, ("name", "parent", "joints")))
    for key in (one for one in _PLACING if one in body_fields):
        yield _field(12, key, body_fields.pop(key), _BODY[key][0], origin)
    if body.joints:
        yield "            joints=("
        for joint in body.joints:
            yield from _joint(joint, where)
        yield "            ),"
    for key, value in body_fields.items():
        unit, parts = _BODY[key]
        yield _field(12, key, value, unit, _first(where, ("body", body.name), parts))
    yield "        ),"


def _joint(joint: Joint, where: Mapping[Key, str]) -> Iterator[str]:
    yield _opening(16, "Joint(", where.get(("joint", joint.name), ""))
    yield f"                    name={quoted(joint.name)},"
    yield f'                    kind="{joint.kind}",'
    units = {"slide": _SLIDING, "free": _FREE}.get(joint.kind, _TURNING)
    joint_fields = dict(_stated_fields(joint, ("name", "kind")))
    if joint.single:
        joint_fields = {"axis": joint.axis, **joint_fields}
    for key, value in joint_fields.items():
        place = _first(where, ("joint", joint.name), _JOINT_IN.get(key, ()))
        yield _field(20, key, value, units.get(key, ""), place)
    yield "                ),"


def _force_element(element: ForceElement, where: Mapping[Key, str]) -> Iterator[str]:
    yield _opening(8, "ForceElement(", where.get(("pull", element.name), ""))
    yield f"            name={quoted(element.name)},"
    for key, value in _stated_fields(element, ("name",)):
        yield _field(12, key, value, "", "")
    yield "        ),"


def _coupling(coupling: Coupling) -> str:
    leader = None if coupling.leader is None else quoted(coupling.leader)
    more = "".join(
        f", {key}={_number(value)}"
        for key, value in _stated_fields(coupling, ("follower", "leader"))
    )
    return f"        Coupling(follower={quoted(coupling.follower)}, leader={leader}{more}),"


def _stated_fields(record: Any, but: tuple[str, ...]) -> Iterator[tuple[str, object]]:
    """Yield the fields that differ from their defaults."""
    for field in fields(record):
        value = getattr(record, field.name)
        # A signed zero differs from the default zero.
        if field.name not in but and repr(value) != repr(field.default):
            yield field.name, value


def _first(where: Mapping[Key, str], key: Key, parts: tuple[str, ...]) -> str:
    return next((where[*key, part] for part in parts if (*key, part) in where), "")


def _opening(indent: int, text: str, place: str) -> str:
    return " " * indent + text + (f"  # {plain(place)}" if place else "")


def _field(indent: int, key: str, value: object, unit: str, place: str) -> str:
    source = ", ".join(part for part in (unit, plain(place)) if part)
    return " " * indent + f"{key}={_number(value)}," + (f"  # {source}" if source else "")


def _number(value: object) -> str:
    """Format a number, a name, or a container of these as exact Python source."""
    if isinstance(value, str):
        return quoted(value)
    if is_dataclass(value):
        inner = ", ".join(f"{key}={_number(one)}" for key, one in _stated_fields(value, ()))
        return f"{type(value).__name__}({inner})"
    if isinstance(value, tuple):
        inner = ", ".join(map(_number, value))
        return f"({inner}{',' if len(value) == 1 else ''})"
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    return repr(value)
