"""Inertias that an MJCF leaves to its compiler, such as those of meshes, and what lifts bodies."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.engines.compiled import CompiledBody, Numbers
from physics_crosscheck.harness.engines.mjcf_defaults import (
    Attributes,
    Defaults,
    bodies_of,
    number_of,
    numbers_of,
    shaped,
)
from physics_crosscheck.harness.engines.mjcf_joints import FREE, MjcfJoint
from physics_crosscheck.harness.engines.mjcf_source import MjcfSource
from physics_crosscheck.harness.engines.protocol import Engine

SHAPES = ("sphere", "capsule", "cylinder", "box", "ellipsoid")
"""Of which a mass follows from numbers of the file alone."""

WEIGHTLESS = ("plane", "hfield")

GEOMS_ALONE = ("frame", "replicate")
"""Elements that may stand for geoms alone."""

CHANGING = {"settotalmass": -1.0, "boundmass": 0.0, "boundinertia": 0.0}
"""Attributes of `<compiler>` that change all masses where they are positive, and their defaults."""

Reason = tuple[ET.Element, str]


@dataclass(frozen=True, kw_only=True)
class Lift:
    """Gravity compensation of a body.

    Attributes:
        body: of the file.
        centre: where it acts, m in the body's frame.
        mass: of which the weight is taken from the body, kg.
    """

    body: ET.Element
    centre: Numbers
    mass: float


def left_to_compiler(
    source: MjcfSource, defaults: Defaults, joints: Sequence[MjcfJoint], no_fromto: Collection[str]
) -> dict[ET.Element, Reason]:
    """Return the bodies whose inertia a parser can't work out, each with the reason.

    Args:
        source: the file.
        defaults: its classes.
        joints: of it.
        no_fromto: shapes that the parser ignores between two points.
    """
    everywhere = list(_changing(source))
    aligned = {joint.body: joint.element for joint in joints if is_aligned(source, joint)}
    found = {}
    for body, inherited in bodies_of(source):
        reasons = [*everywhere, *_of_body(source, defaults, (body, inherited), no_fromto)]
        if body in aligned:
            reasons.append((aligned[body], "a free body that is aligned with its inertia"))
        if reasons:
            found[body] = reasons[0]
    return found


def compiled_bodies(
    source: MjcfSource, needed: Mapping[ET.Element, Reason], compiler: Engine | None, title: str
) -> dict[ET.Element, CompiledBody]:
    """Return these bodies as an engine compiles them.

    Args:
        source: the file.
        needed: bodies, each with the reason.
        compiler: the engine; None for none.
        title: of the engine that reads the copy.

    Raises:
        EngineError: where no engine compiles the file, or makes other bodies of it.
    """
    if not needed:
        return {}
    element, sentence = next(iter(needed.values()))
    if compiler is None or compiler.version() is None:
        lacking = "an installed engine that compiles MJCFs"
        raise source.unsupported(element, f"{sentence}: {title}'s adapter needs {lacking} for it")
    bodies = [body for body, _ in bodies_of(source)]
    found = compiler.compiled(source.path).bodies
    names = [body.get("name", "") for body in bodies]
    if names != [one.name for one in found]:
        raise source.unsupported(element, f"{sentence}, and {compiler.title} makes other bodies")
    return {body: one for body, one in zip(bodies, found, strict=True) if body in needed}


def is_aligned(source: MjcfSource, joint: MjcfJoint) -> bool:
    """Return whether MuJoCo moves the frame of a free body to its centre and principal axes.

    It does so where the body has no other joint and no bodies of its own.
    """
    if joint.kind != FREE or joint.body.find("body") is not None:
        return False
    asked = joint.element.get("align", "auto")
    if asked == "auto":
        asked = source.stated("compiler", "alignfree", "false")
    return asked == "true"


def lifts_of(source: MjcfSource, compiled: Mapping[ET.Element, CompiledBody]) -> Iterator[Lift]:
    """Return what gravity compensation takes from each body.

    Raises:
        EngineError: for what is no number.
    """
    # MuJoCo counts it among passive forces, which it skips where both of these are off.
    if source.disabled("spring") and source.disabled("damper"):
        return
    for body, _ in bodies_of(source):
        share, own = number_of(source, body, body.attrib, "gravcomp"), body.find("inertial")
        if not share:
            continue
        if body in compiled:
            yield Lift(body=body, centre=compiled[body].centre, mass=share * compiled[body].mass)
        elif own is not None:
            mass = number_of(source, own, own.attrib, "mass")
            centre = numbers_of(source, own, own.attrib, "pos", "0 0 0")
            yield Lift(body=body, centre=tuple(centre), mass=share * mass)


def _changing(source: MjcfSource) -> Iterator[Reason]:
    """Yield what changes all masses."""
    for key, off in CHANGING.items():
        one = source.stating("compiler", key)
        if one is not None and number_of(source, one, one.attrib, key, str(off)) > 0:
            yield one, f"{key} that changes masses"
    one = source.stating("compiler", "balanceinertia")
    if one is not None and one.get("balanceinertia") == "true":
        yield one, "balanceinertia"
    one = source.stating("compiler", "inertiagrouprange")
    if one is not None and one.get("inertiagrouprange", "").split() != ["0", "5"]:
        yield one, "an inertiagrouprange"


def _of_body(
    source: MjcfSource, defaults: Defaults, row: tuple[ET.Element, str], no_fromto: Collection[str]
) -> Iterator[Reason]:
    body, inherited = row
    if not shaped(source, body):
        return
    for one in body:
        if one.tag in GEOMS_ALONE and one.find(".//geom") is not None:
            yield one, f"<{one.tag}> with content that has mass"
    for geom in body.findall("geom"):
        said = defaults.of(geom, inherited)
        if what := _unlike_a_shape(source, geom, said, no_fromto):
            yield geom, f"a mass of {what}"
    if number_of(source, body, body.attrib, "gravcomp"):
        yield body, "gravity compensation of the mass of geoms"


def _unlike_a_shape(
    source: MjcfSource, geom: ET.Element, said: Attributes, no_fromto: Collection[str]
) -> str:
    """Return what a geom is that weighs something and no parser works out; empty for a shape."""
    # A mesh beside a shape's type is what the shape is fitted to.
    kind = "mesh" if "mesh" in said else said.get("type", "sphere")
    weighs = any(numbers_of(source, geom, said, "mass", said.get("density", "1000")))
    if not weighs or kind in WEIGHTLESS:
        return ""
    if said.get("shellinertia", "false") == "true":
        return "a shell"
    if kind in no_fromto and "fromto" in said:
        return f"a {kind} between two points"
    return "" if kind in SHAPES else f"a {kind}"
