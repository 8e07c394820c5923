"""The parent of each link, by its joints; a structure that is not a tree is noted in the
document.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.modelfiles.document import Document


def attach_child(
    document: Document, above: dict[str, str], joint: XmlElement, name: str, ends: tuple[str, str]
) -> None:
    """Record a joint's parent and child in `above`, unless the child has a parent already.

    Args:
        document: the file.
        above: parents by their children.
        joint: its element.
        name: of the joint.
        ends: names of its parent and child; an empty child is ignored.
    """
    parent, child = ends
    if child in above:
        document.add_problem(
            joint,
            f"link {quote(child)} has a second parent, by joint {quote(name)}",
            "closed loops are not supported: remove the joint",
        )
    elif child:
        above[child] = parent


def add_loop_problems(
    document: Document,
    names: Iterable[str],
    above: Mapping[str, str],
    links: Mapping[str, XmlElement],
) -> None:
    """Note each loop of links, at one of them."""
    for name in _looped(names, above):
        document.add_problem(
            links.get(name, document.root),
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
