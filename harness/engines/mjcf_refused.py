"""Parts of an MJCF with forces or mass that engines with a subset parser can't represent."""

from collections.abc import Iterator, Mapping, Sequence

from physics_crosscheck.harness.documents.elements import XmlElement
from .mjcf_defaults import bodies_of, has_shape_inertia, number_of, numbers_of
from .mjcf_inertias import GEOMS_ALONE, Reason
from .mjcf_joints import BALL, FREE, HINGE, SLIDE, MjcfJoint
from .mjcf_source import ORIENTATIONS, MjcfSource

FLUID_OPTIONS = ("density", "viscosity", "wind")

MOMENTS = ("diaginertia", "fullinertia")

PARTS = ("body", "joint", "freejoint", "inertial")
"""Elements that move or have mass."""

MACROS = ("frame", "replicate", "composite", "flexcomp", "attach")

TURNS = {key: len(identity) for key, identity in ORIENTATIONS.items()}
"""Attributes for orientations, and how many numbers each takes."""

COUNTS: Mapping[str, Mapping[str, int]] = {
    "body": {"pos": 3, **TURNS},
    "joint": {"pos": 3, "axis": 3},
    "inertial": {"pos": 3, "mass": 1, "diaginertia": 3, "fullinertia": 6, **TURNS},
    "geom": {"pos": 3, "mass": 1, "density": 1, "fromto": 6, **TURNS},
}
"""How many numbers attributes take."""

POSITIVE: Mapping[str, tuple[str, ...]] = {
    "joint": ("armature",),
    "inertial": ("mass",),
    "geom": ("mass", "density", "size"),
}
"""Attributes that must not be negative; negative values end the process in some parsers."""

WORDS: Mapping[str, tuple[str, ...]] = {
    "angle": ("degree", "radian"),
    "autolimits": ("true", "false"),
    "alignfree": ("true", "false"),
}
"""Attributes of `<compiler>` with the words that they accept."""

SECTIONS = frozenset({
    "actuator", "asset", "compiler", "contact", "custom", "default", "deformable", "equality",
    "extension", "keyframe", "option", "sensor", "size", "statistic", "tendon", "visual",
    "worldbody",
})  # fmt: skip
IN_BODIES = frozenset((*PARTS, *MACROS, "geom", "site", "camera", "light", "plugin"))
ATTRIBUTES: Mapping[str, frozenset[str]] = {
    "body": frozenset({"name", "childclass", "mocap", "gravcomp", "sleep", "user", "pos", *TURNS}),
    "inertial": frozenset({"mass", "diaginertia", "fullinertia", "pos", *TURNS}),
    "freejoint": frozenset({"name", "group", "align"}),
    "joint": frozenset({
        "name", "class", "type", "group", "pos", "axis", "springdamper", "stiffness", "range",
        "limited", "margin", "ref", "springref", "armature", "damping", "frictionloss", "user",
        "actuatorfrclimited", "actuatorfrcrange", "actuatorgravcomp", "solreflimit", "solimplimit",
        "solreffriction", "solimpfriction",
    }),
}  # fmt: skip
"""Attributes that MuJoCo's format defines for elements that move or have mass."""


def refuse(source: MjcfSource, joints: Sequence[MjcfJoint], title: str) -> None:
    """Refuse a file, by line.

    Raises:
        UnsupportedError: for the first element that the adapter does not support.
        EngineError: for the first mistake in numbers and words that parsers read.
    """
    for element, sentence in _invalid_values(source):
        raise source.refused(element, sentence)
    for element, sentence in (
        *_unsupported_forces(source),
        *_unsupported_frames(source),
        *_unsupported_joints(source, joints),
        *_unsupported_bodies(source),
    ):
        raise source.unsupported(element, f"{sentence}, which {title}'s adapter does not support")


def unread(source: MjcfSource) -> Iterator[Reason]:
    """Yield elements and attributes that MuJoCo's format does not define: no parser reads them."""
    for element in source.root:
        if element.tag not in SECTIONS:
            yield element, f"<{element.tag}>"
    for body, _ in bodies_of(source):
        yield from (
            (element, f"<{element.tag}>") for element in body if element.tag not in IN_BODIES
        )
        for element in (body, *body):
            for key in sorted(
                set(element.attributes) - ATTRIBUTES.get(element.tag, frozenset(element.attributes))
            ):
                yield element, f"<{element.tag} {key}>"


def _invalid_values(source: MjcfSource) -> Iterator[Reason]:
    """Yield numbers and words that engines' parsers misread or crash on."""
    for key, words in WORDS.items():
        compiler = source.stating("compiler", key)
        if compiler is not None and compiler.get(key) not in words:
            yield compiler, f"<compiler {key}> is {compiler.get(key)!r}, not {' or '.join(words)}"
    for default in source.root.iter("default"):
        for element in default:
            yield from _wrong_numbers(source, element)
    for body, _ in bodies_of(source):
        for element in (body, *body):
            yield from _wrong_numbers(source, element)
        for second in body.findall("inertial")[1:]:
            yield second, "a second <inertial> in one body"


def _wrong_numbers(source: MjcfSource, element: XmlElement) -> Iterator[Reason]:
    for key, count in COUNTS.get(element.tag, {}).items():
        numbers = numbers_of(source, element, element.attributes, key, "0")
        if key in element.attributes and len(numbers) != count:
            belongs = "1 number" if count == 1 else f"{count} numbers"
            yield element, f"<{element.tag} {key}> is {element.get(key)!r}; expected {belongs}"
    turns = [key for key in TURNS if key in element.attributes and element.tag in COUNTS]
    if len(turns) > 1:
        yield element, f"<{element.tag}> is turned twice, by {' and '.join(turns)}"
    if "quat" in turns and not any(numbers_of(source, element, element.attributes, "quat", "1")):
        yield element, f"<{element.tag} quat> is zero"
    ends = numbers_of(source, element, element.attributes, "fromto", "0 1")
    if ends[: len(ends) // 2] == ends[len(ends) // 2 :]:
        yield element, f"<{element.tag} fromto> is {element.get('fromto')!r}, which has no length"
    for key in POSITIVE.get(element.tag, ()):
        if min(numbers_of(source, element, element.attributes, key, "0")) < 0:
            yield element, f"<{element.tag} {key}> is {element.get(key)!r}, which is less than 0"


def _unsupported_forces(source: MjcfSource) -> Iterator[Reason]:
    for key in FLUID_OPTIONS:
        option = source.stating("option", key)
        if option is not None and any(numbers_of(source, option, option.attributes, key, "0")):
            yield option, "a medium"
    option = source.stating("option", "actuatorgroupdisable")
    if option is not None and option.get("actuatorgroupdisable"):
        yield option, "groups of actuators that are off"
    flag = source.stating("option/flag", "passive")
    if flag is not None and flag.get("passive") == "disable":
        yield flag, "<flag passive> off"
    for tag in ("deformable", "extension"):
        yield from ((one, f"<{tag}>") for one in source.root.findall(f"{tag}/*"))


def _unsupported_frames(source: MjcfSource) -> Iterator[Reason]:
    compiler = source.stating("compiler", "coordinate")
    if compiler is not None and compiler.get("coordinate") != "local":
        yield compiler, "coordinates that are not local"
    compiler = source.stating("compiler", "eulerseq")
    if compiler is not None and not compiler.get("eulerseq", "").islower():
        yield compiler, "angles about fixed axes (eulerseq)"


def _unsupported_joints(source: MjcfSource, joints: Sequence[MjcfJoint]) -> Iterator[Reason]:
    free = [joint for joint in joints if joint.kind == FREE]
    for joint in joints:
        if joint.kind == BALL:
            yield joint.element, "a ball joint"
        elif joint.kind not in (FREE, SLIDE, HINGE):
            yield joint.element, f"a joint of type {joint.kind!r}"
    for joint in free:
        if sum(other.body is joint.body for other in joints) > 1:
            yield joint.element, "a free joint beside others"
        if all(joint.body not in world for world in source.root.findall("worldbody")):
            yield joint.element, "a free joint of a body within another"


def _unsupported_bodies(source: MjcfSource) -> Iterator[Reason]:
    """Yield bodies with generated content or an impossible inertia."""
    for world in source.root.findall("worldbody"):
        yield from _macros(world)
    for body, _ in bodies_of(source):
        yield from _macros(body)
        for inertial in () if has_shape_inertia(source, body) else body.findall("inertial"):
            mass = number_of(source, inertial, inertial.attributes, "mass", "nan")
            moments = (
                numbers_of(source, inertial, inertial.attributes, key, "0") for key in MOMENTS
            )
            if mass < 0 or (not mass and any(map(any, moments))):
                yield inertial, "an inertia without mass"


def _macros(parent: XmlElement) -> Iterator[Reason]:
    """Yield macro elements that generate content with motion or mass."""
    for element in parent:
        inner = {part.tag for part in element.iter()}
        if element.tag in MACROS and (element.tag not in GEOMS_ALONE or inner & set(PARTS)):
            yield element, f"<{element.tag}> with content that moves or has mass"
