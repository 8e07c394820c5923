"""Links of a URDF without `<inertial>`: PyBullet and DART give each 1 kg and 1 kg m^2, even if
welded.

`BulletURDFImporter::getMassAndInertia2` warns about it on stderr only. In DART it is an option
(`DartLoader::Options::mDefaultInertia`). The default does not affect a root that is fixed to the
world, and a floating root needs a mass, so the root is left unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from physics_crosscheck.harness.documents.elements import XmlElement

BARE: Mapping[str, object] = {"bare_links": False}
"""The adapter's setting that gives links without `<inertial>` no mass."""

_NAMED = 6
"""The most links that a sentence names."""


def bare_links(robot: XmlElement) -> list[str]:
    """Return the names of links that have a parent and no `<inertial>`."""
    carried = {child.get("link") for child in robot.findall("joint/child")}
    links = {link.get("name", ""): link for link in robot.findall("link")}
    return [
        name for name, link in links.items() if name in carried and link.find("inertial") is None
    ]


def zero_missing_inertials(robot: XmlElement) -> None:
    """Give these links an explicit mass and moments of inertia of zero."""
    bare = set(bare_links(robot))
    for link in robot.findall("link"):
        if link.get("name", "") in bare:
            inertial = link.add("inertial")
            inertial.add("mass", {"value": "0"})
            moments = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0")
            inertial.add("inertia", moments)


def bare_cause(names: Sequence[str], title: str) -> str:
    """Return the cause that a diagnosis reports."""
    shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    count = "a link" if len(names) == 1 else f"{len(names)} links"
    return f"{title}'s own 1 kg and 1 kg m^2 of {count} without <inertial> ({shown})"
