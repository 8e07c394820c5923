"""Links that joints connect: a parent for each, and joints that follow others.

A structure that is not a tree is noted in the document.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from physics_crosscheck.reference.mechanism.bodies import RigidBody
from .document import Document
from .elements import XmlElement
from .errors import quote

GRAVITY = (0.0, 0.0, -9.81)
"""Gravity of a file that states none, m/s^2."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: joint = multiplier * leader + offset."""

    joint: str
    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FileLink:
    """A link of a file: its element, and its body, which has no parent yet."""

    element: XmlElement
    body: RigidBody


def free_name(root: str, joints: Iterable[str]) -> str:
    """Return the name of a floating root's free joint: the root's, unless a joint has it."""
    names = set(joints)
    while root in names:
        root += "_free"
    return root


def named_elements(
    document: Document, elements: Iterable[XmlElement], kind: str, reserved: Iterable[str] = ()
) -> dict[str, XmlElement]:
    """Return elements by name; missing and repeated names are noted.

    Args:
        document: the file.
        elements: some elements of it.
        kind: of elements that may not share a name, for messages.
        reserved: names that no element may have.
    """
    by_name: dict[str, XmlElement] = {}
    for element in elements:
        name = element.get("name")
        if not name:
            document.add_problem(element, f"a <{element.tag}> has no name", "give it a unique name")
        elif name in by_name or name in reserved:
            document.add_problem(
                element, f"a second {kind} is called {quote(name)}", "give it a unique name"
            )
        else:
            by_name[name] = element
    return by_name


def attach_child(
    document: Document, above: dict[str, str], joint: XmlElement, ends: tuple[str, str]
) -> None:
    """Record a joint's parent and child in `above`, unless the child has a parent already.

    Args:
        document: the file.
        above: parents by their children.
        joint: its element.
        ends: names of its parent and child; an empty child is ignored.
    """
    parent, child = ends
    if child in above:
        document.add_problem(
            joint,
            f"link {quote(child)} has a second parent, by joint {quote(joint.get('name'))}",
            "closed loops are not supported: remove the joint",
        )
    elif child:
        above[child] = parent


def add_loop_problems(
    document: Document, above: Mapping[str, str], links: Mapping[str, XmlElement]
) -> None:
    """Note each loop of links, at one of them."""
    for name in _looped(links, above):
        document.add_problem(
            links[name],
            f"link {quote(name)} is its own ancestor through its joints",
            "closed loops are not supported: remove a joint",
        )


def _looped(names: Iterable[str], above: Mapping[str, str]) -> Iterator[str]:
    """Yield one link of every loop."""
    passed: set[str] = set()
    for name in names:
        way: set[str] = set()
        while name in above and name not in passed:
            passed.add(name)
            way.add(name)
            name = above[name]
        if name in way:
            yield name
