"""Links of a URDF without `<inertial>`: PyBullet and DART give each 1 kg and 1 kg m^2, welded too.

`BulletURDFImporter::getMassAndInertia2` says so on stderr, and no more; in DART it is an option
(`DartLoader::Options::mDefaultInertia`). A root that is fixed to the world does not feel it, and
one that floats has to have a mass: the root is left as it is.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

BARE: Mapping[str, object] = {"bare_links": False}
"""The adapter's setting that loads the file with links without `<inertial>` of no mass."""

_NAMED = 6
"""Links named in a sentence."""


def bare_links(robot: ET.Element) -> list[str]:
    """Names of links that something carries and that have no `<inertial>`."""
    carried = {child.get("link") for child in robot.findall("joint/child")}
    links = {link.get("name", ""): link for link in robot.findall("link")}
    return [
        name for name, link in links.items() if name in carried and link.find("inertial") is None
    ]


def weightless(robot: ET.Element) -> None:
    """Give them no mass and no moments, in so many words."""
    bare = set(bare_links(robot))
    for link in robot.findall("link"):
        if link.get("name", "") in bare:
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value="0")
            moments = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0")
            ET.SubElement(inertial, "inertia", moments)


def bare_cause(names: Sequence[str], title: str) -> str:
    """What a diagnosis calls it."""
    told = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    count = "a link" if len(names) == 1 else f"{len(names)} links"
    return f"{title}'s own 1 kg and 1 kg m^2 of {count} without <inertial> ({told})"
