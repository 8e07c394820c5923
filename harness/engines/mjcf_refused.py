"""What of an MJCF acts or weighs something and can't be given to engines that read a part of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence

from harness.engines.mjcf_defaults import Defaults, bodies_of, number_of, numbers_of, shaped
from harness.engines.mjcf_joints import BALL, FREE, HINGE, SLIDE, MjcfJoint
from harness.engines.mjcf_source import MjcfSource

MEDIUM = ("density", "viscosity", "wind")

FLAGS = ("spring", "damper", "passive", "actuation")
"""What these switch off is told by numbers elsewhere."""

SHAPES = ("sphere", "capsule", "cylinder", "box", "ellipsoid")
"""Of which a mass follows from numbers of the file alone."""

WEIGHTLESS = ("plane", "hfield")

MACROS = ("frame", "replicate", "composite", "flexcomp", "attach")


def refuse(source: MjcfSource, defaults: Defaults, joints: Sequence[MjcfJoint], title: str) -> None:
    """Refuse a file, by line.

    Raises:
        EngineError: for the first such thing.
    """
    for element, sentence in (
        *_acting(source),
        *_weighing(source),
        *_moving(source, joints),
        *_built(source, defaults),
    ):
        raise source.refused(element, f"{sentence}, which {title}'s adapter can't give it")


Reason = tuple[ET.Element, str]


def _acting(source: MjcfSource) -> Iterator[Reason]:
    for option in source.root.findall("option"):
        yield from _options(source, option)
    for body, _ in bodies_of(source):
        if number_of(source, body, body.attrib, "gravcomp"):
            yield body, "gravity compensation"
    for tag in ("deformable", "extension"):
        yield from ((one, f"<{tag}>") for one in source.root.findall(f"{tag}/*"))


def _options(source: MjcfSource, option: ET.Element) -> Iterator[Reason]:
    for key in MEDIUM:
        if any(numbers_of(source, option, option.attrib, key, "0")):
            yield option, "a medium"
    if option.get("actuatorgroupdisable"):
        yield option, "groups of actuators that are off"
    for flag in option.findall("flag"):
        off = [key for key in FLAGS if flag.get(key) == "disable"]
        yield from ((flag, f"<flag {key}> off") for key in off)


def _weighing(source: MjcfSource) -> Iterator[Reason]:
    """What changes all masses."""
    for compiler in source.root.findall("compiler"):
        for key, off in (("settotalmass", -1.0), ("boundmass", 0.0), ("boundinertia", 0.0)):
            number = number_of(source, compiler, compiler.attrib, key, str(off))
            if number > 0:
                yield compiler, f"{key} that changes masses"
        if compiler.get("balanceinertia") == "true":
            yield compiler, "balanceinertia"
        if compiler.get("inertiagrouprange", "0 5").split() != ["0", "5"]:
            yield compiler, "an inertiagrouprange"
        if not compiler.get("eulerseq", "xyz").islower():
            yield compiler, "angles about fixed axes (eulerseq)"


def _moving(source: MjcfSource, joints: Sequence[MjcfJoint]) -> Iterator[Reason]:
    free = [one for one in joints if one.kind == FREE]
    for one in joints:
        if one.kind == BALL:
            yield one.element, "a ball joint"
        elif one.kind not in (FREE, SLIDE, HINGE):
            yield one.element, f"a joint of type {one.kind!r}"
    for one in free[1:]:
        yield one.element, "a second body that floats"
    for one in free:
        if one.armature:
            yield one.element, "armature of a free joint"
        if sum(other.body is one.body for other in joints) > 1:
            yield one.element, "a free joint beside others"


def _built(source: MjcfSource, defaults: Defaults) -> Iterator[Reason]:
    """Bodies, or parts of them, that are made of something else."""
    for world in source.root.findall("worldbody"):
        yield from _macros(world, False)
    for body, inherited in bodies_of(source):
        inertials = body.findall("inertial")
        of_geoms = shaped(source, body)
        yield from _macros(body, of_geoms)
        if not of_geoms:
            for one in inertials:
                if number_of(source, one, one.attrib, "mass", "nan") <= 0:
                    yield one, "an inertia without mass"
        for geom in body.findall("geom") if of_geoms else ():
            said = defaults.of(geom, inherited)
            kind = said.get("type", "mesh" if "mesh" in said else "sphere")
            hollow = said.get("shellinertia", "false") == "true"
            weighs = any(numbers_of(source, geom, said, "mass", said.get("density", "1000")))
            if weighs and kind not in WEIGHTLESS and (hollow or kind not in SHAPES):
                yield geom, f"a mass of {'a shell' if hollow else f'a {kind}'}"


def _macros(parent: ET.Element, of_geoms: bool) -> Iterator[Reason]:
    """Elements that stand for others, which move or weigh something."""
    for one in parent:
        inner = {part.tag for part in one.iter()}
        weighs = {"body", "joint", "freejoint", "inertial"} | ({"geom"} if of_geoms else set())
        if one.tag in MACROS and (one.tag not in ("frame", "replicate") or inner & weighs):
            yield one, f"<{one.tag}> with what moves or weighs something"
