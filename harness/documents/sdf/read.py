"""SDFormat models: links, joints, and the rules of a valid file.

The rules are those of the format (http://sdformat.org/spec), without elements that neither the
equations nor the adapters of engines cover.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from physics_crosscheck.reference.mechanism.bodies import Joint, RigidBody, Triple
from physics_crosscheck.reference.mechanism.rotations import Array, to_quaternion
from physics_crosscheck.reference.mechanism.tree import Kind
from ..document import GRAVITY, Document, FileLink, Mimic, add_loop_problems, free_name
from ..elements import XmlElement
from ..errors import quote
from ..schema import remedy_with_hint
from .frames import MODEL, WORLD, SdfFrames, automatic_inertia, inverse, is_automatic, read_pose

_UNCOVERED: Mapping[str, str] = {
    "include": "write what it includes into the file (gz sdf -p FILE)",
    "model": "write the links of both into one model",
    "axis2": "write two joints",
}

_OPAQUE = ("plugin", "sensor", "visual", "collision")
"""Elements of a model without bodies and joints, whatever their content."""

_TRUE, _FALSE = ("1", "true"), ("0", "false")
_INFINITE = re.compile(r"[+-]?inf", re.IGNORECASE)
_NAMED = 8
"""The most models that a sentence names."""

KINDS: Mapping[str, Kind | None] = MappingProxyType(
    {
        "revolute": "hinge",
        "continuous": "hinge",
        "prismatic": "slide",
        "ball": "ball",
        "universal": "hinge",
        "revolute2": "hinge",
        "screw": "hinge",
        "fixed": None,
    }
)
"""The kind of joint in a tree; None for a fixed joint."""

TWO_AXES = ("universal", "revolute2")
"""Types of joints of two hinges in series, named `joint:1` and `joint:2`."""

AXES = ("axis", "axis2")

ENDLESS = 1e16
"""The format's value for a missing bound, rad or m."""

_TENSOR = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_UNIT = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
"""Default inertia, kg m^2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SdfJoint:
    """A joint.

    Attributes:
        kind: None for a fixed joint.
        parent, child: names of links, or `world`.
        joint: in its child's frame; None for a fixed joint.
        second: the one after it, of two axes.
        friction: dry, N or N m.
    """

    name: str
    element: XmlElement
    kind: Kind | None
    parent: str
    child: str
    joint: Joint | None
    friction: float
    second: Joint | None = None

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The moving joints in series."""
        return tuple(one for one in (self.joint, self.second) if one is not None)


@dataclass(frozen=True, kw_only=True, eq=False)
class SdfFile:
    """The content of an SDFormat file: one model; problems are noted in its document.

    Attributes:
        model: its `<model>`.
        world: the `<world>` that contains it, or None.
        frames: of the model.
        links, joints: by name, in the file's order.
        closing: joints to links that a joint above carries already: they close loops.
        mimics: joints that follow others, by the follower's name.
        root: the link without a parent, or `world`.
        gravity: m/s^2.
        stated: settings that the file states: step and gravity.
    """

    document: Document
    model: XmlElement
    world: XmlElement | None
    frames: SdfFrames
    links: Mapping[str, FileLink]
    joints: Mapping[str, SdfJoint]
    closing: tuple[SdfJoint, ...]
    mimics: Mapping[str, Mimic]
    root: str
    gravity: Triple
    stated: Mapping[str, object]

    @property
    def floats(self) -> bool:
        """True if no joint holds the model."""
        return self.root != WORLD

    @property
    def base(self) -> str:
        """The name of a floating root's free joint."""
        return free_name(self.root, self.joints)


def read_sdf(document: Document, chosen: str = "") -> SdfFile | None:
    """Read one model of a parsed file; problems are noted in the document.

    Args:
        document: the file.
        chosen: name of one of several moving models; empty for a single one.

    Returns:
        The content; None without a model.
    """
    model, world = chosen_model(document, chosen)
    if model is None:
        return None
    document.child(model, "static")
    with np.errstate(all="ignore"):  # overflow is reported
        frames = SdfFrames(document, model)
        links, every = read_links(document, frames), read_joints(document, frames)
        carrying = {joint.child: joint for joint in reversed(every.values())}
        joints = {name: one for name, one in every.items() if carrying[one.child] is one}
        gravity, step = _gravity(document, world), _step(document, world)
        file = SdfFile(
            document=document,
            model=model,
            world=world,
            frames=frames,
            links=links,
            joints=joints,
            closing=tuple(one for name, one in every.items() if name not in joints),
            mimics=read_mimics(document, joints),
            root=_root(document, model, links, joints),
            gravity=GRAVITY if gravity is None else gravity,
            stated={**({} if gravity is None else {"gravity": [*gravity]}), **step},
        )
        if not document.obstacles:
            for name in (*links, *every):
                frames.place(name)
            frames.of_model()
    return file


def has_no_weight(link: XmlElement) -> bool:
    """Return whether gravity does not act on a link."""
    return link.findtext("gravity").strip().lower() in _FALSE


def read_links(document: Document, frames: SdfFrames) -> dict[str, FileLink]:
    """Return the links by name; problems are noted in the document."""
    return {
        name: FileLink(element=element, body=_body(document, frames, element, name))
        for name, element in frames.tagged("link").items()
    }


def _body(document: Document, frames: SdfFrames, link: XmlElement, name: str) -> RigidBody:
    """Return the body of a link: 1 kg and 1 kg m^2 by default."""
    inertial = document.child(link, "inertial")
    document.child(link, "gravity")
    lift = float(has_no_weight(link))
    if inertial is not None and is_automatic(inertial):
        spatial_inertia = automatic_inertia(document, frames, link, inertial, name)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = spatial_inertia.inertia.tolist()
        return RigidBody(
            name=name,
            parent=None,
            mass=spatial_inertia.mass,
            center=_triple(spatial_inertia.center),
            inertia=(xx, yy, zz, xy, xz, yz),
            lift=lift,
        )
    return _stated_body(document, inertial, name, lift)


def _stated_body(
    document: Document, inertial: XmlElement | None, name: str, lift: float
) -> RigidBody:
    """Return the body of an `<inertial>` that states its numbers, or of None."""
    what = f"link {quote(name)}"
    mass, inertia = document.child(inertial, "mass"), document.child(inertial, "inertia")
    place = None if inertial is None else read_pose(document, inertial, f"<inertial> of {what}")[0]
    (weight,) = document.text_numbers(mass, (1.0,), what)
    tensor: list[float] = []
    for key, default in zip(_TENSOR, _UNIT, strict=True):
        tensor += document.text_numbers(document.child(inertia, key), (default,), what)
    xx, yy, zz, xy, xz, yz = tensor
    body = RigidBody(
        name=name, parent=None, mass=weight, inertia=(xx, yy, zz, xy, xz, yz), lift=lift
    )
    if place is None:
        return body
    return replace(
        body, center=_triple(place.origin), inertia_quaternion=to_quaternion(place.rotation)
    )


def read_joints(document: Document, frames: SdfFrames) -> dict[str, SdfJoint]:
    """Return the joints by name; problems are noted in the document."""
    return {
        name: _joint(document, frames, element, name)
        for name, element in frames.tagged("joint").items()
    }


def _joint(document: Document, frames: SdfFrames, element: XmlElement, name: str) -> SdfJoint:
    kind, what = element.attributes.get("type", ""), f"joint {quote(name)}"
    if kind not in KINDS:
        document.add_problem(
            element,
            f"{what} is of type {quote(kind)}, which "
            + ("no engine reads" if kind == "gearbox" else "is not covered"),
            remedy_with_hint(kind, KINDS, f"types are {', '.join(KINDS)}"),
            "unsupported",
        )
    stated = {tag: document.child(element, tag) for tag in ("parent", "child")}
    ends = {tag: "" if one is None else one.text.strip() for tag, one in stated.items()}
    links = {tag: frames.link(end) for tag, end in ends.items()}
    for tag, link in links.items():
        if not link or (tag, link) == ("child", WORLD):
            document.add_problem(
                element,
                f"the {tag} of {what} is {quote(ends[tag])}, which is not a link",
                remedy_with_hint(
                    ends[tag], frames.tagged("link"), "declare the link, or correct its name"
                ),
            )
    of_tree = KINDS.get(kind)
    is_valid = of_tree is not None and links["child"] not in ("", WORLD)
    where = document, frames, element, links["child"]
    first, second = None, None
    if is_valid and of_tree is not None:
        first = _moving(*where, f"{name}:1" if kind in TWO_AXES else name, of_tree, "axis")
        second = _moving(*where, f"{name}:2", of_tree, "axis2") if kind in TWO_AXES else None
    return SdfJoint(
        name=name,
        element=element,
        kind=of_tree,
        parent=links["parent"],
        child=links["child"],
        joint=first,
        second=second,
        friction=document.text_numbers(
            document.child(element, "axis/dynamics/friction"), (0.0,), what
        )[0]
        * (of_tree != "ball"),
    )


def _moving(
    document: Document,
    frames: SdfFrames,
    element: XmlElement,
    child: str,
    name: str,
    kind: Kind,
    tag: str,
) -> Joint:
    """Return a joint with anchor and axis in the child link's frame.

    The `<axis>` of a ball joint has no direction: its damping opposes the angular velocity.
    """
    frame = element.get("name")
    what, axis = f"joint {quote(frame)}", document.child(element, tag)
    inward = inverse(frames.place(child))
    anchor = _triple(inward.compose(frames.place(frame)).origin)
    damping = document.text_numbers(document.child(axis, "dynamics/damping"), (0.0,), what)[0]
    if kind == "ball":
        armature = document.armatures.get(name, 0.0)
        return Joint(name=name, kind=kind, at=anchor, damping=damping, armature=armature)
    if axis is None:
        document.add_problem(element, f"{what} has no <{tag}>", f"write one: <{tag}><xyz>...")
    xyz = document.child(axis, "xyz")
    direction = np.array(document.text_numbers(xyz, (0.0, 0.0, 1.0), what))
    frame = _expressed_in(document, axis, xyz) or frame
    direction = inward.rotation @ frames.place(frame).rotation @ direction
    if not direction.any():
        document.add_problem(
            xyz or element, f"the axis of {what} has no length", "give a direction"
        )
        direction = np.array([0.0, 0.0, 1.0])
    dynamics = document.child(axis, "dynamics")
    number = {
        key: document.text_numbers(document.child(dynamics, key), (0.0,), what)[0]
        for key in ("spring_stiffness", "spring_reference")
    }
    return Joint(
        name=name,
        kind=kind,
        axis=_triple(direction),
        at=anchor,
        damping=damping,
        stiffness=number["spring_stiffness"],
        rest=number["spring_reference"],
        limits=_bounds(document, element, axis),
        pitch=_pitch(document, element, what),
        armature=document.armatures.get(name, 0.0),
    )


def _pitch(document: Document, joint: XmlElement, what: str) -> float:
    """Return the distance per angle of a screw, m/rad; 1 m per turn by default.

    `<thread_pitch>` states the angle per distance of a left-handed screw, rad/m; it counts if
    `<screw_thread_pitch>`, m per turn, is missing.
    """
    old, new = (document.child(joint, tag) for tag in ("thread_pitch", "screw_thread_pitch"))
    if joint.get("type") != "screw":
        return 0.0
    if old is None or new is not None:
        return document.text_numbers(new, (1.0,), what)[0] / (2 * math.pi)
    (angle,) = document.text_numbers(old, (-2 * math.pi,), what)
    if not angle:
        document.add_problem(old, f"<thread_pitch> of {what} is 0", "write a <screw_thread_pitch>")
    return -1 / (angle or 1.0)


def _expressed_in(document: Document, axis: XmlElement | None, xyz: XmlElement | None) -> str:
    """Return the frame of an axis: in versions to 1.4 the model's; empty for the joint's own."""
    if xyz is not None and xyz.attributes.get("expressed_in"):
        return xyz.attributes["expressed_in"]
    flag = document.child(axis, "use_parent_model_frame")
    if flag is not None:
        return MODEL if flag.text.strip().lower() in _TRUE else ""
    return MODEL if version(document) <= (1, 4) else ""


def version(document: Document) -> tuple[int, ...]:
    """Return the format's version, such as (1, 7); the newest if it is not stated."""
    words = document.root.attributes.get("version", "").split(".")
    return tuple(map(int, words)) if all(word.isdigit() for word in words) else (2,)


def _bounds(
    document: Document, joint: XmlElement, axis: XmlElement | None
) -> tuple[float, float] | None:
    limit, what = document.child(axis, "limit"), joint.get("name")
    if limit is None:
        return None
    for tag in ("effort", "velocity"):
        _limit(document, limit, tag, what)
    lower = _limit(document, limit, "lower", what, -math.inf)
    upper = _limit(document, limit, "upper", what, math.inf)
    unlimited = lower > upper or (math.isinf(lower) and math.isinf(upper))
    return None if unlimited or joint.get("type") == "continuous" else (lower, upper)


def _limit(
    document: Document, limit: XmlElement, tag: str, joint: str, endless: float = math.inf
) -> float:
    """Return a limit; `endless` without one, or for the format's values of a missing one."""
    element = document.child(limit, tag)
    text = "" if element is None else element.text.strip()
    if not text or _INFINITE.fullmatch(text):
        return endless
    (value,) = document.text_numbers(element, (0.0,), f"joint {quote(joint)}")
    return math.copysign(math.inf, value) if abs(value) >= ENDLESS else value


def read_mimics(document: Document, joints: Mapping[str, SdfJoint]) -> dict[str, Mimic]:
    """Return joints that follow others: multiplier * (leader - reference) + offset."""
    mimics: dict[str, Mimic] = {}
    for name, joint in joints.items():
        mimic = document.child(joint.element, "axis/mimic")
        first = joint.joint
        if mimic is not None and first is not None and first.single and not joint.second:
            mimics[name] = _mimic(document, mimic, joints, name)
    return mimics


def _mimic(
    document: Document, mimic: XmlElement, joints: Mapping[str, SdfJoint], name: str
) -> Mimic:
    leader, what = mimic.get("joint"), f"<mimic> of joint {quote(name)}"
    if leader == name or leader not in joints:
        document.add_problem(
            mimic, f"{what} names {quote(leader)}, which is not another joint", "name another joint"
        )
    ratio, offset, reference = (
        document.text_numbers(document.child(mimic, tag), (default,), what)[0]
        for tag, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
    )
    return Mimic(name, leader, ratio, offset - ratio * reference)


def _triple(vector: Array) -> Triple:
    x, y, z = map(float, vector)
    return x, y, z


def chosen_model(
    document: Document, chosen: str = ""
) -> tuple[XmlElement | None, XmlElement | None]:
    """Return the model, and the world that contains it; problems are noted.

    Args:
        document: the file.
        chosen: the model's name; empty for the single moving one.
    """
    root = document.root
    if root.tag != "sdf":
        document.add_problem(root, f"the root is <{root.tag}>, not <sdf>", "give an SDFormat file")
        return None, None
    worlds = root.findall("world")
    for element in worlds[1:]:
        document.add_problem(element, "a second <world> of one file", "keep one")
    model = _only_model(document, chosen, [root, *worlds])
    for element in root.findall("world/joint"):
        document.add_problem(
            element,
            "a <joint> between models is not covered",
            "write both into one model",
            "unsupported",
        )
    if model is None:
        return None, None
    for element in _within(model):
        joint = element.parent
        if element.tag == "axis2" and joint is not None and joint.get("type") in TWO_AXES:
            continue
        if element.tag in _UNCOVERED:
            document.add_problem(
                element, f"<{element.tag}> is not covered", _UNCOVERED[element.tag], "unsupported"
            )
    return model, worlds[0] if worlds else None


def _only_model(
    document: Document, chosen: str, holders: Sequence[XmlElement]
) -> XmlElement | None:
    """Return the single moving model, or the one with the chosen name; else note the problem.

    Included files are left out: they could act on the model only through a joint of the world,
    which is refused.
    """
    models = [one for holder in holders for one in holder.findall("model")]
    moving = [one for one in models if not is_static(one)]
    candidates = [one for one in moving if not chosen or one.get("name") == chosen]
    names = ", ".join(quote(one.get("name")) for one in moving[:_NAMED])
    names += ", ..." if len(moving) > _NAMED else ""
    includes = [one for holder in holders for one in holder.findall("include")]
    if len(candidates) == 1:
        return candidates[0]
    if chosen and moving:
        what = f"{len(candidates)} models" if candidates else "no moving model"
        document.add_problem(
            candidates[1] if candidates else holders[0],
            f"it has {what} of the name {quote(chosen)}",
            f"choose one of {names}",
        )
    elif candidates:
        document.add_problem(
            candidates[1],
            f"it has {len(candidates)} models that move: {names}",
            "choose one: crosscheck run --model NAME FILE",
        )
    elif includes:
        document.add_problem(
            includes[0],
            "<include> is not covered, and the file itself has no moving model",
            _UNCOVERED["include"],
            "unsupported",
        )
    elif models:
        static = models[0].findall("static")[0]
        what = "the model is" if len(models) == 1 else "all models are"
        document.add_problem(static, f"{what} static, so nothing moves", "give another", "no joint")
    else:
        document.add_problem(holders[0], "it has no <model>", "add one")
    return None


def is_static(model: XmlElement) -> bool:
    """Return whether a model is static."""
    return any(one.text.strip().lower() in _TRUE for one in model.findall("static"))


def _within(element: XmlElement) -> Iterator[XmlElement]:
    for child in element.children:
        if child.tag not in _OPAQUE:
            yield child
            yield from _within(child)


def _root(
    document: Document,
    model: XmlElement,
    links: Mapping[str, FileLink],
    joints: Mapping[str, SdfJoint],
) -> str:
    """Return the floating root link, or `world`."""
    above = {joint.child: joint.parent for joint in joints.values()}
    if not links:
        document.add_problem(model, "it has no <link>", "add at least one")
    add_loop_problems(document, above, {name: link.element for name, link in links.items()})
    loose = [name for name in links if name not in above]
    if len(loose) > 1 or (loose and WORLD in above.values()):
        document.add_problem(
            links[loose[-1]].element,
            f"no joint holds {', '.join(map(quote, loose))}",
            "give every link except one a joint",
        )
    return loose[0] if loose else WORLD


def _gravity(document: Document, world: XmlElement | None) -> Triple | None:
    gravity = document.child(world, "gravity")
    if gravity is None or not gravity.text.strip():
        return None
    x, y, z = document.text_numbers(gravity, GRAVITY, "the world")
    return x, y, z


def _step(document: Document, world: XmlElement | None) -> dict[str, object]:
    """Return the step that a world states, s, as a setting."""
    step = document.child(world, "physics/max_step_size")
    if step is None or not step.text.strip():
        return {}
    return {"step": document.text_numbers(step, (0.001,), "the world")[0]}
