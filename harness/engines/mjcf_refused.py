"""What of an MJCF acts or weighs something and can't be given to engines that read a part of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence

from harness.engines.mjcf_defaults import bodies_of, number_of, numbers_of, shaped
from harness.engines.mjcf_inertias import GEOMS_ALONE, Reason
from harness.engines.mjcf_joints import BALL, FREE, HINGE, SLIDE, MjcfJoint
from harness.engines.mjcf_source import MjcfSource

MEDIUM = ("density", "viscosity", "wind")

MOMENTS = ("diaginertia", "fullinertia")

PARTS = ("body", "joint", "freejoint", "inertial")
"""What moves or weighs something."""

MACROS = ("frame", "replicate", "composite", "flexcomp", "attach")


def refuse(source: MjcfSource, joints: Sequence[MjcfJoint], title: str) -> None:
    """Refuse a file, by line.

    Raises:
        EngineError: for the first such thing.
    """
    for element, sentence in (
        *_acting(source),
        *_turned(source),
        *_moving(source, joints),
        *_built(source),
    ):
        raise source.unsupported(element, f"{sentence}, which {title}'s adapter can't give it")


def _acting(source: MjcfSource) -> Iterator[Reason]:
    for key in MEDIUM:
        option = source.stating("option", key)
        if option is not None and any(numbers_of(source, option, option.attrib, key, "0")):
            yield option, "a medium"
    option = source.stating("option", "actuatorgroupdisable")
    if option is not None and option.get("actuatorgroupdisable"):
        yield option, "groups of actuators that are off"
    flag = source.stating("option/flag", "passive")
    if flag is not None and flag.get("passive") == "disable":
        yield flag, "<flag passive> off"
    for tag in ("deformable", "extension"):
        yield from ((one, f"<{tag}>") for one in source.root.findall(f"{tag}/*"))


def _turned(source: MjcfSource) -> Iterator[Reason]:
    compiler = source.stating("compiler", "eulerseq")
    if compiler is not None and not compiler.get("eulerseq", "").islower():
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


def _built(source: MjcfSource) -> Iterator[Reason]:
    """Bodies, or parts of them, that are made of something else."""
    for world in source.root.findall("worldbody"):
        yield from _macros(world)
    for body, _ in bodies_of(source):
        yield from _macros(body)
        for one in () if shaped(source, body) else body.findall("inertial"):
            mass = number_of(source, one, one.attrib, "mass", "nan")
            moments = (numbers_of(source, one, one.attrib, key, "0") for key in MOMENTS)
            if mass < 0 or (not mass and any(map(any, moments))):
                yield one, "an inertia without mass"


def _macros(parent: ET.Element) -> Iterator[Reason]:
    """Elements that stand for others, which move or weigh something."""
    for one in parent:
        inner = {part.tag for part in one.iter()}
        if one.tag in MACROS and (one.tag not in GEOMS_ALONE or inner & set(PARTS)):
            yield one, f"<{one.tag}> with what moves or weighs something"
