"""The root link of a URDF, or the reason for its absence."""

from __future__ import annotations

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.modelfiles.attach import add_loop_problems, attach_child
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.urdf.parts import UrdfJoint, UrdfLink

IMPLICIT = "world"
"""The parent of root joints, which no file needs to declare."""


def root_of(
    document: Document, links: dict[str, UrdfLink], joints: dict[str, UrdfJoint]
) -> str | None:
    """Return the root link; without a unique one, note the problems and return None."""
    above: dict[str, str] = {}
    for joint in joints.values():
        for tag, end in (("parent", joint.parent), ("child", joint.child)):
            if end and end not in links and (tag, end) != ("parent", IMPLICIT):
                document.add_problem(
                    joint.element,
                    f"the {tag} of joint {quote(joint.name)} is {quote(end)}, which is not a link",
                    "declare the link, or correct its name",
                )
        attach_child(document, above, joint.element, joint.name, (joint.parent, joint.child))
    return _top(document, links, above)


def _top(document: Document, links: dict[str, UrdfLink], above: dict[str, str]) -> str | None:
    names = dict.fromkeys([*links, *(one for one in above.values() if one == IMPLICIT)])
    roots = [name for name in names if name not in above]
    if not links:
        document.add_problem(document.root, "it has no <link>", "add at least one")
    # A misspelled name is reported instead of the link that it leaves without a joint.
    named = {_child_of(one) for one in document.root.children if one.tag == "joint"}
    roots = [name for name in roots if name not in named]
    if len(roots) > 1 and named <= set(links):
        element = next(links[name].element for name in reversed(roots) if name in links)
        document.add_problem(
            element,
            f"it has {len(roots)} root links, {', '.join(map(quote, roots))}",
            "give every root except one a joint",
        )
    add_loop_problems(document, names, above, {name: one.element for name, one in links.items()})
    return roots[0] if roots else None


def _child_of(joint: XmlElement) -> str:
    return next(
        (one.attributes.get("link", "") for one in joint.children if one.tag == "child"), ""
    )
