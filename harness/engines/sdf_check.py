"""Refusal, by line, of SDFormat elements that are not supported or ambiguous."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf import WORLD, attached, has_automatic
from physics_crosscheck.harness.engines.source import XmlSource, finite_numbers

OPAQUE = ("plugin", "sensor", "gripper", "visual", "light", "projector")
"""Elements that are removed for engines: visuals, sensors, and content that a simulator would
load.
"""

KINDS = ("revolute", "continuous", "prismatic", "fixed")

_SCALARS = (
    "mass", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "damping", "friction", "spring_stiffness",
    "spring_reference", "lower", "upper", "effort", "velocity", "multiplier", "offset",
    "reference", "density", "radius", "length",
)  # fmt: skip
_COUNTS = {**dict.fromkeys(_SCALARS, 1), **dict.fromkeys(("xyz", "size", "radii"), 3)}
"""How many numbers an element has."""

_ONCE = {
    "link": ("inertial", "pose"),
    "inertial": ("pose", "mass", "inertia"),
    "joint": ("parent", "child", "axis", "pose"),
    "axis": ("xyz", "dynamics", "limit", "mimic"),
    "world": ("gravity",),
    "model": ("pose", "static"),
}
"""Elements that may occur once."""

_NOT_COVERED = {
    "include": "write the model that it includes into the file (gz sdf -p FILE)",
    "model": "models within models are not covered; write their links into one",
    "axis2": "joints of two axes are not covered; write two joints",
    "gearbox_ratio": "gearboxes are not covered",
    "thread_pitch": "screws are not covered",
}


@dataclass(frozen=True, kw_only=True)
class CheckedJoint:
    """A joint: its type, and its parent and child links; the parent may be `world`."""

    name: str
    element: XmlElement
    kind: str
    parent: str
    child: str

    @property
    def moves(self) -> bool:
        """True unless it is fixed."""
        return self.kind != "fixed"


def check_sdf(
    source: XmlSource, chosen: str = ""
) -> tuple[XmlElement, XmlElement | None, dict[str, CheckedJoint]]:
    """Return the model, its world, and its joints.

    Args:
        source: the file.
        chosen: name of one of several moving models; empty for a single one.

    Raises:
        EngineError: naming file and line.
    """
    root = source.root
    if root.tag != "sdf":
        raise source.refused(root, f"the root is <{root.tag}>, not <sdf>: not an SDFormat file")
    worlds = root.findall("world")
    for other in worlds[1:]:
        raise source.refused(other, "a second <world>: keep one per file")
    for joint in root.findall("world/joint"):
        raise source.refused(joint, "a <joint> between models is not covered: write both into one")
    model = _only_model(source, chosen, (root, *worlds))
    world = worlds[0] if worlds else None
    _check_parts(source, model, world)
    return model, world, _joints(source, model)


def _only_model(source: XmlSource, chosen: str, holders: Sequence[XmlElement]) -> XmlElement:
    """Return the single moving model, or the one with the chosen name."""
    models = [one for holder in holders for one in holder.findall("model")]
    moving = [one for one in models if not _is_static(one)]
    candidates = [one for one in moving if not chosen or one.get("name") == chosen]
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        raise source.refused(
            candidates[1],
            f"it has {len(candidates)} models that move: choose one, by the setting model"
            if not chosen
            else f"it has {len(candidates)} models {chosen!r}",
        )
    if moving:
        raise source.refused(source.root, f"it has no model {chosen!r} that moves")
    for element in (one for holder in holders for one in holder.findall("include")):
        raise source.refused(element, f"<include> is not covered: {_NOT_COVERED['include']}")
    for static in models:
        raise source.refused(static, "the model is static, so nothing moves")
    raise source.refused(source.root, "it has no <model>")


def _is_static(model: XmlElement) -> bool:
    return model.findtext("static").strip().lower() in ("1", "true")


def _within(element: XmlElement) -> Iterator[XmlElement]:
    """Yield an element and its descendants, without those that are removed for engines."""
    yield element
    for child in element:
        if child.tag not in OPAQUE and not (
            child.tag == "collision" and not has_automatic(element)
        ):
            yield from _within(child)


def _check_parts(source: XmlSource, model: XmlElement, world: XmlElement | None) -> None:
    for element in _within(model):
        if element is not model and element.tag in _NOT_COVERED:
            raise source.refused(element, f"<{element.tag}>: {_NOT_COVERED[element.tag]}")
    for holder in (world, *world.findall("physics")) if world is not None else ():
        _check_once(source, holder)
        for part in holder:
            _check_number(source, part, {"gravity": 3, "max_step_size": 1})
    for element in (model, *model.findall("link"), *model.findall("joint")):
        for part in _within(element) if element is not model else (model, *model.findall("pose")):
            _check_number(source, part)
            _check_once(source, part)


def _check_number(
    source: XmlSource, element: XmlElement, counts: Mapping[str, int] = _COUNTS
) -> None:
    count = counts.get(element.tag)
    words = element.text
    if element.tag == "pose":
        count = 7 if element.get("rotation_format") == "quat_xyzw" else 6
    if count is None or element.children or not words.strip():
        return
    numbers = finite_numbers(words.replace("inf", "1e16"))
    if numbers is None or len(numbers) != count:
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise source.refused(element, f"<{element.tag}> is {words.strip()!r}; expected {wanted}")


def _check_once(source: XmlSource, element: XmlElement) -> None:
    for tag in _ONCE.get(element.tag, ()):
        for other in element.findall(tag)[1:]:
            raise source.refused(other, f"a second <{tag}> in one <{element.tag}>")


def _joints(source: XmlSource, model: XmlElement) -> dict[str, CheckedJoint]:
    parts = (one for one in model if one.tag in ("link", "joint", "frame"))
    named = source.named(parts, "link, joint or frame")
    joints: dict[str, CheckedJoint] = {}
    above: dict[str, str] = {}
    for name, element in named.items():
        if element.tag != "joint":
            continue
        kind = element.get("type", "")
        if kind not in KINDS:
            raise source.refused(
                element, f"joint {name!r} is of type {kind!r}; types are {', '.join(KINDS)}"
            )
        parent, child = (_end(source, element, tag, named, model) for tag in ("parent", "child"))
        if child in above:
            raise source.refused(element, f"link {child!r} has a second parent, by joint {name!r}")
        above[child] = parent
        _check_axis(source, element, name)
        joints[name] = CheckedJoint(
            name=name, element=element, kind=kind, parent=parent, child=child
        )
    _check_tree(source, named, above)
    return joints


def _check_axis(source: XmlSource, joint: XmlElement, name: str) -> None:
    axis = joint.find("axis")
    if joint.get("type") != "fixed" and axis is None:
        raise source.refused(joint, f"joint {name!r} has no <axis>")
    xyz = None if axis is None else axis.find("xyz")
    if xyz is not None and not any(finite_numbers(xyz.text or "0 0 1") or ()):
        raise source.refused(xyz, f"the axis of joint {name!r} has no length")


def _end(
    source: XmlSource,
    joint: XmlElement,
    tag: str,
    named: Mapping[str, XmlElement],
    model: XmlElement,
) -> str:
    """Return the link of a joint's parent or child, directly or through a frame."""
    stated = joint.findtext(tag).strip()
    link = attached(stated, named, model)
    if not link or (link == WORLD and tag == "child"):
        name = joint.get("name", "")
        raise source.refused(
            joint, f"the {tag} of joint {name!r} is {stated!r}, which is not a link"
        )
    return link


def _check_tree(
    source: XmlSource, named: Mapping[str, XmlElement], above: Mapping[str, str]
) -> None:
    links = [name for name, element in named.items() if element.tag == "link"]
    roots = [name for name in links if name not in above]
    grounded = [name for name, parent in above.items() if parent == WORLD]
    if len(roots) > 1 or (roots and grounded):
        names = ", ".join(map(repr, roots))
        raise source.refused(
            named[roots[-1]], f"no joint holds {names}: every link except one needs a joint"
        )
    for name in links:
        up, steps = name, 0
        while up in above and steps <= len(links):
            up, steps = above[up], steps + 1
        if up in above:
            raise source.refused(
                named[name], f"link {name!r} is its own ancestor through its joints"
            )
