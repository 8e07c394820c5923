"""Create a system folder from a robot's bodies: write it, compare it, run it in every engine.

Write system.py and the sidecar of a robot: declared bodies, each number with its line.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import format_omission, settings_of
from physics_crosscheck.harness.checks.prepare import prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, quote
from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.engines.registry import default_engines
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.parts import PartError, check_parts, parts
from physics_crosscheck.harness.modelfiles.readers import read_robot, summary
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
from physics_crosscheck.reference.mechanism.bodies import (
    BodyModel,
    Coupling,
    ForceElement,
    Joint,
    RigidBody,
)
from physics_crosscheck.reference.mechanism.tree import JointForce
from physics_crosscheck.reference.solving.integrate import ReferenceError
from .folder import NewError, comment, literal, plain, quoted, write_folder

Key = tuple[str, ...]
"""Kind, name and part: `("body", "rod")`, `("body", "rod", "mass")`."""

_BODIES, _JOINTS = ("link", "body"), ("joint", "freejoint")
_PULLS = ("tendon", "actuator")
"""Elements that contain force elements."""


def places(files: Iterable[Path]) -> Mapping[Key, str]:
    """Return `robot.urdf:93` of the first element of each name, and of its parts."""
    lines: dict[Key, str] = {}
    for file in files:
        try:
            document = Document(file)
        except LocationError:
            continue  # not well-formed XML, though an engine may read it
        for key, element in _named(document.root):
            lines.setdefault(key, f"{file.name}:{document.line(element)}")
    return lines


def _named(element: XmlElement) -> Iterator[tuple[Key, XmlElement]]:
    name, kind = element.attributes.get("name", ""), _kind(element)
    if name and kind:
        yield (kind, name), element
        for label, part in _within(element):
            yield (kind, name, label), part
    if element.tag == "gazebo" and "reference" in element.attributes:
        for part in element.children:
            yield ("joint", element.attributes["reference"], part.tag), part
    for child in element.children:
        yield from _named(child)


def _kind(element: XmlElement) -> str:
    if element.tag in _BODIES:
        return "body"
    if element.tag in _JOINTS:
        return "joint"
    return "pull" if element.parent is not None and element.parent.tag in _PULLS else ""


def _within(element: XmlElement) -> Iterator[tuple[str, XmlElement]]:
    """Yield parts with numbers, except visual and collision geometry and other bodies."""
    for child in element.children:
        if child.tag == "inertial":
            yield child.tag, child
            yield from ((f"inertial/{part.tag}", part) for part in child.children)
        elif child.tag in ("origin", "axis", "dynamics", "limit"):
            yield child.tag, child


MEANT = (".py", ".pyc", ".toml")
"""File endings with a meaning in a system folder; a mesh can't have one."""

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


CHECKED = 8
"""Number of states for comparing engines with the folder; most numbers have an effect in each."""

NAMED = 3
"""Maximum number of files to name among those that are not copied."""


class _OtherBodiesError(Exception):
    """The copy of a file gives other bodies than the file, for example without a mesh."""


def from_tree(robot: Robot, data: bytes, target: Path, settings: list[str]) -> tuple[str, ...]:
    """Write the folder of a robot that has a tree, and return remarks to print.

    Args:
        robot: the robot.
        data: the file's content.
        target: the folder to write.
        settings: lines of a sidecar for a format that states no time step and no gravity.

    Raises:
        NewError: naming the problem; nothing is written then.
    """
    model, body_model = robot.file, robot.body_model
    assert body_model is not None  # the caller checks that it has a tree
    parts = included(model)
    where = places([model, *(model.parent / name for name in parts)])
    compiled = next(
        (e.title for e in default_engines(model.suffix) if model.suffix in e.compiles), ""
    )
    text = tree_text(target.name, summary(robot), model.name, body_model, where, compiled)
    sidecar, able = f"{model.name}.toml", default_engines(model.suffix)
    files = {model.name: data, **parts, "system.py": text.encode()}
    files |= {sidecar: _sidecar(robot, able, {}, settings)}
    remarks: list[str] = []

    def check(folder: Path) -> None:
        _check_reading(folder, robot)
        left_out, engine_remarks = _run(folder, robot, target)
        chosen = [one for one in able if one.name not in left_out]
        # If no engine runs it, a run must report each of them.
        (folder / sidecar).write_bytes(_sidecar(robot, chosen or able, left_out, settings))
        remarks.extend(engine_remarks)

    others = besides(model)
    copied = called(others, robot.shapes)
    try:
        write_folder(target, {**contents(model, copied), **files}, check)
    except _OtherBodiesError:  # the engine needs a value that the file does not state
        copied = others
        try:
            write_folder(target, {**contents(model, copied), **files}, check)
        except _OtherBodiesError as error:
            raise NewError(
                f"{model}: its copy in a folder reads as a different robot: {error}"
            ) from None
    if unused := [path.name for path in others if path not in copied]:
        remarks.append(f"not copied, because no inertia depends on it: {_listed(unused)}")
    if robot.left_out:
        remarks.append(f"left out: {', '.join(format_omission(one) for one in robot.left_out)}")
    return tuple(remarks)


def _listed(names: Sequence[str]) -> str:
    """Return a list of names such as: 'a.stl', 'b.stl', 'c.stl' and 5 more."""
    more = len(names) - NAMED
    return ", ".join(map(quote, names[:NAMED])) + (f" and {more} more" if more > 0 else "")


def _sidecar(
    robot: Robot, chosen: Sequence[Engine], left_out: Mapping[str, str], settings: Sequence[str]
) -> bytes:
    own_settings = settings_of(robot)
    return tree_sidecar(robot.file.name, chosen, left_out, settings, own_settings).encode()


def _check_reading(folder: Path, robot: Robot) -> None:
    """Compare the declaration and the copy of the file with the robot that was read."""
    chosen = str(robot.stated.get("model", ""))
    again = read_robot(folder / robot.file.name, floating=robot.floats, model=chosen)
    if again.body_model != robot.body_model:
        raise _OtherBodiesError(
            "; ".join(one.sentence for one in again.obstacles) or "it lacks a part"
        )
    system = load_declaration(folder)
    assert isinstance(system, MultibodySystem)
    written = BodyModel(
        bodies=system.bodies,
        gravity=system.gravity,
        pulls=system.pulls,
        couplings=system.couplings,
        fluid=system.fluid,
    )
    if written != robot.body_model:
        raise NewError(f"{robot.file}: the files written differ from the robot read")


def _run(folder: Path, robot: Robot, target: Path) -> tuple[dict[str, str], list[str]]:
    """Return the engines that can't run the file with reasons, and remarks about engines.

    Raises:
        NewError: if the bodies can't be solved.
    """
    able = [one for one in default_engines(robot.file.suffix) if one.version() is not None]
    if not able:
        return {}, ["no engine that runs it is installed, so the new folder is not checked"]
    sidecar = read_sidecar(folder / f"{robot.file.name}.toml")
    try:
        prepared = prepare(folder, states=CHECKED)
    except ReferenceError as error:
        why = str(error).removeprefix(f"{folder / 'system.py'}: ")
        raise NewError(f"{robot.file}: {why}") from None
    left_out: dict[str, str] = {}
    remarks: list[str] = []
    with Workers(1) as workers:
        for engine in able:
            task = model_task(prepared, engine.name, sidecar)
            case = workers.outcome(workers.submit(run_case, task))
            if isinstance(case, Failure):
                why = left_out[engine.name] = _plain(case.reason, folder, target)
                remarks.append(f"{engine.name} is left out: {why}")
            elif case.outcome is not Outcome.AGREES:
                remarks.append(f"{engine.name} {case.outcome}: {case.reason}")
    return left_out, remarks


def _plain(message: str, folder: Path, target: Path) -> str:
    return " ".join(message.replace(str(folder), str(target)).split())


def included(model: Path) -> dict[str, bytes]:
    """Return relative path -> content of the models that a model file includes, at any depth.

    Raises:
        NewError: if a model is unsafe to copy or not below the model's folder.
    """
    try:
        check_parts(model)
    except PartError as error:
        raise NewError(str(error)) from None
    return dict(_read(model, [path for path, part in parts(model).items() if part], strict=True))


def besides(model: Path) -> list[Path]:
    """Return all other existing files that it names: meshes, height fields, textures."""
    return [path for path, part in parts(model).items() if not part]


def called(paths: Iterable[Path], names: Iterable[str]) -> list[Path]:
    """Return the files that match names, in any folder that engines search."""
    ends = [PurePosixPath(name).parts for name in names]
    # Some engines strip folders from a path (`strippath`), so compare the last parts.
    exact = [path for path in paths if any(path.parts[-len(end) :] == end for end in ends)]
    last = {end[-1] for end in ends} - {path.name for path in exact}
    return [path for path in paths if path in exact or path.name in last]


def contents(model: Path, paths: Iterable[Path]) -> dict[str, bytes]:
    """Return relative path -> content of files that a model file names, within its folder only.

    Raises:
        NewError: if a file can't be read.
    """
    return dict(_read(model, paths, strict=False))


def _read(model: Path, paths: Iterable[Path], *, strict: bool) -> Iterator[tuple[str, bytes]]:
    for path in paths:
        within = _below(path, model.parent)
        if within is None or within.suffix in MEANT:
            if strict:
                why = (
                    (f"a system folder runs or reads files that end with {path.suffix}: rename it")
                    if within is not None
                    else "which is not below its folder; copy it into the folder"
                )
                raise NewError(f"{model}: it needs {path}, {why}")
            continue
        try:
            yield str(within), read_regular(path)
        except OSError as error:
            raise NewError(f"{model}: it needs {path}: {error.strerror}") from None


def _below(path: Path, folder: Path) -> PurePosixPath | None:
    """Return a path relative to a folder; None if it is outside."""
    try:
        within = PurePosixPath(path.relative_to(folder).as_posix())
    except ValueError:
        return None
    return None if ".." in within.parts else within
