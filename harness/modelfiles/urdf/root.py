"""What the links of a URDF hang from: one of them, or why there is none such."""

from __future__ import annotations

from physics_crosscheck.harness.modelfiles.attach import hang, hinder_loops
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.urdf.parts import UrdfJoint, UrdfLink

IMPLICIT = "world"
"""A link that joints may hang from and no file needs to declare."""


def root_of(
    document: Document, links: dict[str, UrdfLink], joints: dict[str, UrdfJoint]
) -> str | None:
    """The link that carries all others; None, with its obstacles, where none does."""
    above: dict[str, str] = {}
    for joint in joints.values():
        for tag, end in (("parent", joint.parent), ("child", joint.child)):
            if end and end not in links and (tag, end) != ("parent", IMPLICIT):
                document.hinder(
                    joint.element,
                    f"the {tag} of joint {brief(joint.name)} is {brief(end)}, which is not a link",
                    "declare the link, or correct its name",
                )
        hang(document, above, joint.element, joint.name, (joint.parent, joint.child))
    return _top(document, links, above)


def _top(document: Document, links: dict[str, UrdfLink], above: dict[str, str]) -> str | None:
    known = dict.fromkeys([*links, *(one for one in above.values() if one == IMPLICIT)])
    roots = [name for name in known if name not in above]
    if not links:
        document.hinder(document.root, "it has no <link>", "add at least one")
    # What a misspelled name leaves alone is told by that name.
    named = {_child_of(one) for one in document.root.children if one.tag == "joint"}
    roots = [name for name in roots if name not in named]
    if len(roots) > 1 and named <= set(links):
        element = next(links[name].element for name in reversed(roots) if name in links)
        document.hinder(
            element,
            f"it has {len(roots)} root links, {', '.join(map(brief, roots))}",
            "give every root except one a joint",
        )
    hinder_loops(document, known, above, {name: one.element for name, one in links.items()})
    return roots[0] if roots else None


def _child_of(joint: RawElement) -> str:
    return next(
        (one.attributes.get("link", "") for one in joint.children if one.tag == "child"), ""
    )
