"""Known mistakes, by family, in their order in reports."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import combinations

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.mjcf_source import ORIENTATIONS
from physics_crosscheck.harness.engines.protocol import DefaultLeftOn, LeftOut
from physics_crosscheck.harness.modelfiles.bindings import SIDECAR, at_constants, bindings
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.reference.mechanism.declaration import DeclarationError
from .context import (
    Edit,
    Mistake,
    Subject,
    default_mistake,
    defaults_left_on,
    literal_causes,
    rounded,
)
from .rests import moved_rest, radian, rests


def axes(subject: Subject) -> Iterator[Mistake]:
    """Yield a mistake for each moving joint whose axis the file states: the axis reversed.

    A mirrored mechanism moves alike, so that reversing one axis may be equivalent to reversing all
    others. A diagnosis may name any axis that corrects it.
    """
    causes = frozenset(CauseId(kind="axis", subject=(z,)) for z in subject.model.coordinates)
    for name, joint in subject.joints():
        if subject.suffix == ".urdf":
            written = subject.numbers("axis@xyz")
            mine = {a: v for a, v in written.items() if a.startswith(f"joint[{name}]/axis@")}
        elif subject.suffix == ".sdf":
            written = subject.numbers("xyz")
            mine = {a: v for a, v in written.items() if a.startswith(f"joint[{name}]/axis/xyz[")}
        else:
            written = subject.numbers("joint@axis")
            mine = {a: v for a, v in written.items() if a.split("@")[0].endswith(f"joint[{name}]")}
        if len(mine) == 3 and any(mine.values()) and joint.identity == name:
            edit = Edit({address: -value for address, value in mine.items() if value})
            yield Mistake("axis flipped", name, edit, causes, audit_words="an axis is flipped")


UP = 1.0
"""Height by which a base is raised, metres; gravity is the same at any height."""

_QUARTER = "1.5707963267948966"


def bases(subject: Subject) -> Iterator[Mistake]:
    """Yield the first body attached to the ground, raised, and rotated by 90 degrees."""
    hung = _hung(subject)
    if hung is None:
        return
    element, where = hung
    key, turned = "pos", ("quat", "0.7071067811865476 0 0 0.7071067811865476")
    if subject.suffix == ".urdf":
        key, turned = "xyz", ("rpy", f"0 0 {_QUARTER}")
    with suppress(ValueError):
        x, y, z = map(float, element.attributes.get(key, "0 0 0").split())
        raised = (element.start, key, f"{x!r} {y!r} {z + UP!r}")
        yield Mistake("base moved", where, Edit(attributes=(raised,)), audit_words="moved by")
    if not any(map(float, element.attributes.get("rpy", "0").split())) and not any(
        one in element.attributes for one in ORIENTATIONS
    ):
        edit = Edit(attributes=((element.start, *turned),))
        yield Mistake("plane of motion turned", where, edit, audit_words="turned")


def _hung(subject: Subject) -> tuple[XmlElement, str] | None:
    """Return the element that places the first moving body on the ground, and the joint's name."""
    for name, joint in subject.joints():
        body = joint.parent
        if subject.suffix == ".xml":
            if body is not None and body.parent is not None and body.parent.tag == "worldbody":
                return body, name
        else:
            origin = next((c for c in joint.children if c.tag == "origin"), None)
            if origin is not None:
                return origin, name
    return None


SIZES = (9.8, 9.80665)
"""Common approximations of gravity, used if the model has another value."""

ACCELERATION = ("m/s^2", "m/s**2", "m*s^-2", "N/kg")


def gravity(subject: Subject) -> Iterator[Mistake]:
    """Yield changes of a model's gravity; changes of its size only if the equations have gravity
    too.
    """
    present = subject.model.gravity
    if not any(present):
        return
    vector = [*map(float, present), 0.0][:3]
    size = float(np.linalg.norm(vector))
    constants = {c.name for c in subject.task.target.system.constants if c.unit in ACCELERATION}
    if constants:
        for other in SIZES:
            if abs(other - size) > 1e-9 * size:
                turned = [g / size * other for g in vector]
                yield _changed(subject, f"gravity {other:g}", vector, turned, constants)
        yield _changed(subject, "gravity off", vector, [0.0, 0.0, 0.0], constants)
    down = int(np.argmax(np.abs(vector)))
    for axis in range(len(present)):
        if axis != down and not vector[axis]:
            turned = [0.0, 0.0, 0.0]
            turned[axis] = vector[down]
            yield _changed(subject, f"gravity along {'xyz'[axis]}", vector, turned, constants)


def _changed(
    subject: Subject, name: str, old: Sequence[float], new: Sequence[float], constants: set[str]
) -> Mistake:
    """Change gravity where the file states it as a vector or as one number, otherwise set it."""
    addresses = _written(subject, old)
    moved = [i for i in range(3) if new[i] != old[i]]
    causes = {CauseId(kind="gravity", subject=("xyz"[i],)) for i in moved}
    causes |= {CauseId(kind="constant", subject=(name,)) for name in constants}
    # On a coordinate along gravity, its effect is a constant force.
    pulled = [c.name for c in subject.task.target.system.coordinates]
    causes |= {CauseId(kind="offset force", subject=(name,)) for name in pulled}
    if all(i in addresses for i in moved):
        present, signs = (
            [addresses[i] for i in moved],
            [_sign(subject, addresses[i], old[i]) for i in moved],
        )
        literals = {a: s * new[i] for a, s, i in zip(present, signs, moved, strict=True)}
        return Mistake(name, ", ".join(present), Edit(literals), literal_causes(*present) | causes)
    edit = Edit(settings={"gravity": list(new)})
    return Mistake(name, "gravity", edit, literal_causes(*addresses.values()) | causes)


def _written(subject: Subject, old: Sequence[float]) -> dict[int, str]:
    """Return the addresses of components in the file, its sidecar or a bound number."""
    sidecar, engine = subject.task.declared, subject.task.engine
    for key, settings in (
        (f"settings.{engine}.gravity", sidecar.engine_settings.get(engine, {})),
        ("settings.gravity", sidecar.settings),
    ):
        if "gravity" in settings:
            return {i: f"{SIDECAR}{key}[{i}]" for i in range(3)}
    if subject.suffix == ".xml":
        stated = subject.numbers("option@gravity")
        return dict(enumerate(stated)) if len(stated) == 3 else {}
    addresses: dict[int, str] = {}
    for b in subject.bindings:
        names = {c.name for c in subject.task.target.system.constants if c.unit in ACCELERATION}
        if b.expression.strip(" -") in names:
            addresses |= {i: b.address for i in range(3) if abs(old[i]) == abs(b.value)}
    return addresses


def _sign(subject: Subject, address: str, component: float) -> float:
    """Return -1 if a number is the size of a component in the negative direction."""
    values = {b.address: b.value for b in subject.bindings}
    return -1.0 if values.get(address, component) == -component != 0 else 1.0


def exchanges(subject: Subject) -> Iterator[Mistake]:
    """Yield each pair of such constants in the model, exchanged in all of their literals."""
    system, sidecar = subject.task.target.system, subject.task.declared
    for first, second in combinations(system.constants, 2):
        if first.unit != second.unit or first.value == second.value:
            continue
        try:
            swapped = at_constants(system, {first.name: second.value, second.name: first.value})
        except DeclarationError:
            continue  # only one of them is positive
        changed = {b.address: b.expected for b in bindings(swapped, sidecar) if not b.exact}
        if not all(_stated(subject, c.name) for c in (first, second)):
            continue
        names = f"{first.name}, {second.name}"
        causes = literal_causes(*changed) | {
            CauseId(kind="exchange", subject=(first.name, second.name)),
            *(CauseId(kind="constant", subject=(c.name,)) for c in (first, second)),
        }
        yield Mistake("two constants exchanged", names, Edit(changed), causes)


def _stated(subject: Subject, name: str) -> bool:
    """Return whether a literal depends on a constant."""
    system, sidecar = subject.task.target.system, subject.task.declared
    value = next(c.value for c in system.constants if c.name == name)
    moved = at_constants(system, {name: 1.01 * value})
    return any(not b.exact for b in bindings(moved, sidecar))


ANGLES = r"(body|frame|joint)@(euler|axisangle|ref|springref)"


def degrees(subject: Subject) -> Iterator[Mistake]:
    """Yield a missing or a wrong `angle` of MJCF; a URDF's angles in degrees."""
    turns = {name: joint for name, joint in subject.joints() if _turns(joint.attributes)}
    causes = frozenset[CauseId]().union(*(moved_rest(subject, name) for name in turns))
    if subject.suffix == ".xml":
        sliding = {name for name, _ in subject.joints()} - set(turns)
        stated = {
            address: value
            for address, value in subject.numbers(ANGLES).items()
            if value and not any(f"joint[{name}]@" in address for name in sliding)
        }
        compiler = next((e for e in subject.elements if e.tag == "compiler"), None)
        if stated and compiler is not None:
            stated_unit = None if radian(subject) else "radian"
            name = "degrees for radians" if stated_unit is None else "radians for degrees"
            edit = Edit(attributes=((compiler.start, "angle", stated_unit),))
            yield Mistake(name, "compiler@angle", edit, causes | literal_causes(*stated))
    elif subject.suffix == ".urdf":
        kinds = r"springReference|origin@rpy"
        for address, value in subject.numbers(kinds).items():
            drawn = any(word in address for word in ("visual", "collision"))
            spring = any(address == f"gazebo[{name}]/springReference" for name in turns)
            if value and not drawn and (spring or "@rpy" in address):
                edit = Edit({address: math.degrees(value)})
                yield Mistake(
                    "degrees for radians", address, edit, causes | literal_causes(address)
                )


def _turns(attributes: Mapping[str, str]) -> bool:
    return attributes.get("type", "hinge") in ("hinge", "revolute", "continuous")


SHARE = 0.05
"""Share of the value whose effect would equal the forces or inertias of the motion."""

MJCF: tuple[tuple[str, str, CauseKind], ...] = (
    ("friction left in", "frictionloss", "friction"),
    ("damping left in", "damping", "damping"),
    ("armature left in", "armature", "inertia"),
)
URDF: tuple[tuple[str, str, CauseKind], ...] = (
    ("friction left in", "friction", "friction"),
    ("damping left in", "damping", "damping"),
)


def left_in(subject: Subject) -> Iterator[Mistake]:
    """Yield each of these effects at each moving joint without it."""
    for name, joint in subject.joints():
        owner, attributes = (joint, MJCF) if subject.suffix == ".xml" else (None, URDF)
        if owner is None:
            owner = next((c for c in joint.children if c.tag == "dynamics"), None)
            if owner is None:
                continue
        for what, attribute, kind in attributes:
            if f"{owner.tag}@{attribute}" in subject.engine.ignores:
                continue
            if float(owner.attributes.get(attribute, "0").split()[0]):
                continue  # already present; planted as a fault if it is bound to a constant
            value = rounded(SHARE * subject.size(name, kind))
            edit = Edit(attributes=((owner.start, attribute, repr(value)),))
            address = f"{owner.spelled(1 if owner is joint else 2)}@{attribute}"
            yield Mistake(what, name, edit, subject.about(name, kind) | literal_causes(address))


def left_out(subject: Subject) -> Iterator[Mistake]:
    """Yield the omission of each such statement in the file or in the settings."""
    for usual in subject.engine.usual_mistakes:
        if isinstance(usual, LeftOut):
            yield from _left_out(subject, usual)


def _left_out(subject: Subject, usual: LeftOut) -> Iterator[Mistake]:
    causes = frozenset({CauseId(kind="default", subject=(usual.cause,))})
    for element in subject.elements:
        stated = [key for key in usual.defaults if key in element.attributes]
        if stated and element.parent is not None and element.parent.tag == usual.within:
            edit = Edit(attributes=tuple((element.start, key, None) for key in stated))
            yield Mistake(usual.name, element.spelled(2), edit, causes)
    settings = subject.task.declared.spec(subject.task.engine).settings
    stated_settings = {key: value for key, value in usual.defaults.items() if key in settings}
    if stated_settings:
        yield Mistake(
            usual.name,
            f"settings.{next(iter(stated_settings))}",
            Edit(settings=stated_settings),
            causes,
        )


def defaults(subject: Subject) -> Iterator[Mistake]:
    """Yield each default that the model's settings do not already request."""
    yield from defaults_left_on(subject.task, whole=False)


def contact_defaults(subject: Subject) -> Iterator[Mistake]:
    """Yield each default that only whole steps depend on, if contacts or limits can act."""
    whole = subject.engine.load_planar(subject.task.spec)
    if whole is None or not whole.acts or whole.uncovered:
        return
    for usual in subject.engine.usual_mistakes:
        if (
            isinstance(usual, DefaultLeftOn)
            and whole.numbers.get(usual.cause, usual.value) != usual.value
        ):
            yield default_mistake(usual)


def steps(subject: Subject) -> Iterator[Mistake]:
    """Yield twice the time step, and every other integrator that suits the model."""
    step = 2 * subject.model.step
    edit = Edit(settings={"step": step})
    yield Mistake("another time step", f"step {step:g} s", edit, sound=True)
    for name, settings in subject.model.integrators.items():
        yield Mistake("another integrator", name, Edit(settings=settings), sound=True)


FAMILIES: tuple[Callable[[Subject], Iterator[Mistake]], ...] = (
    axes, bases, gravity, exchanges, rests, degrees, left_in, left_out, defaults,
    contact_defaults, steps,
)  # fmt: skip


def known_mistakes(subject: Subject) -> tuple[Mistake, ...]:
    """Return every known mistake that fits a model."""
    return tuple(mistake for family in FAMILIES for mistake in family(subject))
