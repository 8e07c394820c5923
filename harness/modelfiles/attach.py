"""What links hang from, by their joints: what is no tree is noted in the document."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief


def hang(
    document: Document, above: dict[str, str], joint: RawElement, name: str, ends: tuple[str, str]
) -> None:
    """Hang a joint's child from its parent, in `above`, unless it hangs from another already.

    Args:
        document: the file.
        above: parents by their children.
        joint: where it stands.
        name: of the joint.
        ends: names of its parent and child; of no child nothing hangs.
    """
    parent, child = ends
    if child in above:
        document.hinder(
            joint,
            f"link {brief(child)} has a second parent, by joint {brief(name)}",
            "closed loops are not supported: remove the joint",
        )
    elif child:
        above[child] = parent


def hinder_loops(
    document: Document,
    names: Iterable[str],
    above: Mapping[str, str],
    links: Mapping[str, RawElement],
) -> None:
    """Note each loop of links, at one of them."""
    for name in _looped(names, above):
        document.hinder(
            links.get(name, document.root),
            f"link {brief(name)} is its own ancestor through its joints",
            "closed loops are not supported: remove a joint",
        )


def _looped(names: Iterable[str], above: Mapping[str, str]) -> Iterator[str]:
    """One link of every loop."""
    passed: set[str] = set()
    for name in names:
        way: set[str] = set()
        while name in above and name not in passed:
            passed.add(name)
            way.add(name)
            name = above[name]
        if name in way:
            yield name
