"""Inertias that an MJCF leaves to its compiler, such as those of meshes, and gravity
compensation.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from .compiled import Numbers
from .mjcf_defaults import Attributes, Defaults, bodies_of, has_shape_inertia, number_of, numbers_of
from .mjcf_joints import FREE, MjcfJoint
from .mjcf_source import MjcfSource
from .protocol import Engine

SHAPES = ("sphere", "capsule", "cylinder", "box", "ellipsoid")
"""Shapes whose mass follows from numbers of the file."""

WEIGHTLESS = ("plane", "hfield")

GEOMS_ALONE = ("frame", "replicate")
"""Elements that may contain geoms only."""

CHANGING = {"settotalmass": -1.0, "boundmass": 0.0, "boundinertia": 0.0}
"""Attributes of `<compiler>` that change all masses if positive, and their defaults."""

Reason = tuple[XmlElement, str]


@dataclass(frozen=True, kw_only=True)
class GravityCompensation:
    """Gravity compensation of a body.

    Attributes:
        body: of the file.
        centre: point of application, m in the body's frame.
        mass: whose weight is cancelled, kg.
    """

    body: XmlElement
    centre: Numbers
    mass: float


def left_to_compiler(
    source: MjcfSource, defaults: Defaults, joints: Sequence[MjcfJoint], no_fromto: Collection[str]
) -> dict[XmlElement, Reason]:
    """Return the bodies whose inertia a parser can't compute, each with the reason.

    Args:
        source: the file.
        defaults: its classes.
        joints: of the file.
        no_fromto: shapes whose `fromto` the parser ignores.
    """
    everywhere = list(_mass_changing(source))
    aligned = {joint.body: joint.element for joint in joints if is_aligned(source, joint)}
    reasons_by_body = {}
    for body, inherited in bodies_of(source):
        reasons = [*everywhere, *_body_reasons(source, defaults, (body, inherited), no_fromto)]
        if body in aligned:
            reasons.append((aligned[body], "a free body that is aligned with its inertia"))
        if reasons:
            reasons_by_body[body] = reasons[0]
    return reasons_by_body


def compiled_bodies(
    source: MjcfSource, needed: Mapping[XmlElement, Reason], compiler: Engine | None, title: str
) -> dict[XmlElement, RigidBody]:
    """Return these bodies as an engine compiles them.

    Args:
        source: the file.
        needed: bodies, each with the reason.
        compiler: the engine, or None.
        title: of the engine that reads the copy.

    Raises:
        EngineError: if no engine compiles the file, or its bodies differ.
    """
    if not needed:
        return {}
    element, sentence = next(iter(needed.values()))
    if compiler is None or compiler.version() is None:
        lacking = "an installed engine that compiles MJCFs"
        raise source.unsupported(element, f"{sentence}: {title}'s adapter needs {lacking} for it")
    bodies = [body for body, _ in bodies_of(source)]
    compiled = compiler.compiled(source.path).bodies
    pairs = zip(bodies, compiled, strict=len(bodies) == len(compiled))
    if len(bodies) != len(compiled) or any(a.get("name", b.name) != b.name for a, b in pairs):
        raise source.unsupported(element, f"{sentence}, and {compiler.title} makes other bodies")
    return {body: one for body, one in zip(bodies, compiled, strict=True) if body in needed}


def is_aligned(source: MjcfSource, joint: MjcfJoint) -> bool:
    """Return whether MuJoCo moves the frame of a free body to its centre and principal axes.

    It does so if the body has no other joint and no child bodies.
    """
    return joint.kind == FREE and aligns(source, joint.body, joint.element)


def aligns(source: MjcfSource, body: XmlElement, joint: XmlElement) -> bool:
    """Return whether a free joint aligns its body."""
    if body.find("body") is not None:
        return False
    mode = joint.get("align", "auto")
    if mode == "auto":
        mode = source.stated("compiler", "alignfree", "false")
    return mode == "true"


def lifts_of(
    source: MjcfSource, compiled: Mapping[XmlElement, RigidBody]
) -> Iterator[GravityCompensation]:
    """Yield the gravity compensation of each body.

    Raises:
        EngineError: for text that is not a number.
    """
    # MuJoCo counts it among passive forces, which it skips if both flags are off.
    if source.disabled("spring") and source.disabled("damper"):
        return
    for body, _ in bodies_of(source):
        share, inertial = (
            number_of(source, body, body.attributes, "gravcomp"),
            body.find("inertial"),
        )
        if not share:
            continue
        if body in compiled:
            yield GravityCompensation(
                body=body, centre=compiled[body].center, mass=share * compiled[body].mass
            )
        elif inertial is not None:
            mass = number_of(source, inertial, inertial.attributes, "mass")
            centre = numbers_of(source, inertial, inertial.attributes, "pos", "0 0 0")
            yield GravityCompensation(body=body, centre=tuple(centre), mass=share * mass)


def _mass_changing(source: MjcfSource) -> Iterator[Reason]:
    """Yield compiler attributes that change all masses."""
    for key, off in CHANGING.items():
        element = source.stating("compiler", key)
        if (
            element is not None
            and number_of(source, element, element.attributes, key, str(off)) > 0
        ):
            yield element, f"{key} that changes masses"
    element = source.stating("compiler", "balanceinertia")
    if element is not None and element.get("balanceinertia") == "true":
        yield element, "balanceinertia"
    element = source.stating("compiler", "inertiagrouprange")
    if element is not None and element.get("inertiagrouprange", "").split() != ["0", "5"]:
        yield element, "an inertiagrouprange"


def _body_reasons(
    source: MjcfSource, defaults: Defaults, row: tuple[XmlElement, str], no_fromto: Collection[str]
) -> Iterator[Reason]:
    body, inherited = row
    if not has_shape_inertia(source, body):
        return
    for child in body:
        if child.tag in GEOMS_ALONE and any(True for _ in child.iter("geom")):
            yield child, f"<{child.tag}> with content that has mass"
    for geom in body.findall("geom"):
        attributes = defaults.attributes(geom, inherited)
        if what := _why_not_plain_shape(source, geom, attributes, no_fromto):
            yield geom, f"a mass of {what}"
    if number_of(source, body, body.attributes, "gravcomp"):
        yield body, "gravity compensation of the mass of geoms"


def _why_not_plain_shape(
    source: MjcfSource, geom: XmlElement, attributes: Attributes, no_fromto: Collection[str]
) -> str:
    """Return why a parser can't compute a geom's mass; empty for a plain or massless shape."""
    # A shape with a mesh is fitted to that mesh.
    kind = "mesh" if "mesh" in attributes else attributes.get("type", "sphere")
    weighs = any(numbers_of(source, geom, attributes, "mass", attributes.get("density", "1000")))
    if not weighs or kind in WEIGHTLESS:
        return ""
    if attributes.get("shellinertia", "false") == "true":
        return "a shell"
    if kind in no_fromto and "fromto" in attributes:
        return f"a {kind} between two points"
    return "" if kind in SHAPES else f"a {kind}"
