"""Refusal, by line, of URDFs that engines read differently or crash on.

PyBullet ends its process with a segmentation fault on two root links, on a link with two parents,
on a cycle and on a duplicate joint name. It reads "abc" as 0, "1,5" as 1, and the first of two
elements, which MuJoCo refuses even if they are equal. MuJoCo accepts two root links, and treats a
duplicate joint name as no name.
"""

from __future__ import annotations

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.source import XmlSource, finite_numbers

_COUNTS = {
    **dict.fromkeys((("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")), 3),
    **{("inertia", key): 1 for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")},
    **{("limit", key): 1 for key in ("lower", "upper", "velocity", "effort")},
    **{("dynamics", key): 1 for key in ("damping", "friction")},
    **{("mimic", key): 1 for key in ("multiplier", "offset")},
    ("mass", "value"): 1,
}
"""How many numbers an attribute has."""

_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
}
"""Elements that may occur once."""


def check_urdf(source: XmlSource) -> None:
    """Refuse a file that is not an unambiguous URDF.

    Raises:
        EngineError: naming file and line.
    """
    root = source.root
    if root.tag != "robot":
        raise source.refused(root, f"the root is <{root.tag}>, not <robot>: not a URDF")
    for element in (*root.findall("link"), *root.findall("joint")):
        for part in element.iter():
            _check_numbers(source, part)
            _check_once(source, part)
    for robot in root.findall("robot"):
        raise source.refused(robot, "every engine ignores a <robot> inside the <robot>")
    links = _named(source, "link")
    joints = _named(source, "joint")
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        ends = [_end(source, joint, name, tag, links) for tag in ("parent", "child")]
        if ends[1] in parents:
            raise source.refused(joint, f"link {ends[1]!r} has a second parent, by joint {name!r}")
        parents[ends[1]] = ends[0]
        _check_joint(source, joint, name)
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        names = ", ".join(map(repr, roots))
        raise source.refused(
            links[roots[1]],
            f"it has {len(roots)} root links, {names}: every root except one needs a joint",
        )
    for name in links:
        if not _reaches_root(name, parents):
            raise source.refused(
                links[name], f"link {name!r} is its own ancestor through its joints"
            )


def _check_numbers(source: XmlSource, element: XmlElement) -> None:
    for key, words in element.attributes.items():
        count = _COUNTS.get((element.tag, key))
        if count is None:
            continue
        numbers = finite_numbers(words)
        if numbers is None or len(numbers) != count:
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise source.refused(element, f"<{element.tag} {key}> is {words!r}; expected {wanted}")


def _check_once(source: XmlSource, element: XmlElement) -> None:
    for tag in _ONCE.get(element.tag, ()):
        elements = element.findall(tag)
        for other in elements[1:]:
            if _content(other) != _content(elements[0]):
                raise source.refused(other, f"a second <{tag}> in one <{element.tag}>")


def _content(element: XmlElement) -> object:
    """Return the content of an element, without blanks."""
    attributes = sorted((key, value.split()) for key, value in element.attributes.items())
    return element.tag, attributes, element.text.split(), [_content(one) for one in element]


def _named(source: XmlSource, tag: str) -> dict[str, XmlElement]:
    """Return elements by name; names must exist and be unique."""
    by_name: dict[str, XmlElement] = {}
    for element in source.root.findall(tag):
        name = element.get("name", "")
        if not name:
            raise source.refused(element, f"a <{tag}> has no name")
        if name in by_name:
            raise source.refused(element, f"a second {tag} is called {name!r}")
        by_name[name] = element
    return by_name


def _end(
    source: XmlSource, joint: XmlElement, name: str, tag: str, links: dict[str, XmlElement]
) -> str:
    end = joint.find(tag)
    link = "" if end is None else end.get("link", "")
    if link not in links:
        raise source.refused(joint, f"the {tag} of joint {name!r} is {link!r}, which is not a link")
    return link


def _check_joint(source: XmlSource, joint: XmlElement, name: str) -> None:
    axis, mimic = joint.find("axis"), joint.find("mimic")
    moves = joint.get("type") in ("revolute", "continuous", "prismatic")
    if moves and axis is not None and not any(finite_numbers(axis.get("xyz", "1 0 0")) or ()):
        raise source.refused(axis, f"the axis of joint {name!r} has no length")
    if mimic is not None and mimic.get("joint") == name:
        raise source.refused(mimic, f"joint {name!r} mimics itself")


def _reaches_root(name: str, parents: dict[str, str]) -> bool:
    """Return whether the chain of parents from a link ends."""
    for _ in range(len(parents) + 1):
        if name not in parents:
            return True
        name = parents[name]
    return False
