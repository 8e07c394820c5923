"""SDFormat for DART, whose parser knows versions 1.4 to 1.6 and leaves some of a file out."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harness.engines.attitude import from_rpy
from harness.engines.protocol import Array, EngineError
from harness.engines.sdf import SdfFile, number
from harness.engines.sdf_copy import VERSION, sdf_without_bounds_of
from harness.engines.source import written

_KNOWN = ("1.4", "1.5", "1.6")
_IN_MODEL = ("1.0", "1.1", "1.2", "1.3", "1.4")
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def sdf_skeleton(text: str, path: Path, floats: bool) -> Any:
    """What DART makes of it; None, with words on stderr, where it makes nothing."""
    import dartpy as dart

    parser = dart.utils.SdfParser
    options, roots = parser.Options(), parser.RootJointType
    options.mDefaultRootJointType = roots.FLOATING if floats else roots.FIXED
    root = ET.fromstring(text)  # it is of what was parsed with entities off
    if root.get("version") in _IN_MODEL:
        _axes_in_model(root)
    if root.get("version") not in _KNOWN:
        root.set("version", VERSION)
    with written(root, path) as file:
        found = parser.readSkeleton(dart.common.Uri(file.as_uri()), options)
    if found is not None:
        _mend(found, root, floats)
    return found


def _axes_in_model(root: ET.Element) -> None:
    """Axes are told in the model's frame, which DART's parser does not know."""
    for axis in root.findall("model/joint/axis"):
        if axis.find("use_parent_model_frame") is None:
            ET.SubElement(axis, "use_parent_model_frame").text = "true"


def _mend(skeleton: Any, root: ET.Element, floats: bool) -> None:
    """A root that floats counts from the world, not from where it is drawn; no mass is none."""
    import dartpy as dart

    if floats:
        skeleton.getJoint(0).setTransformFromParentBodyNode(dart.math.Isometry3.Identity())
    for link in root.findall("model/link"):
        mass = link.find("inertial/mass")
        if mass is not None and (mass.text or "").strip() and float(mass.text or "") == 0.0:
            skeleton.getBodyNode(link.get("name", "")).setMass(0.0)  # DART itself takes 1e-9 kg


def turned_links(model: ET.Element) -> list[str]:
    """Names of links whose inertials are turned in them, and have moments that feel it."""
    found = []
    for link in model.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None and np.any(_pose(inertial)[3:]):
            moments = _tensor(inertial)
            turn = from_rpy(_pose(inertial)[3:])
            if np.abs(turn @ moments @ turn.T - moments).max() > 1e-15 * np.abs(moments).max():
                found.append(link.get("name", ""))
    return found


def turned_cause(names: Sequence[str]) -> str:
    """What a diagnosis calls it."""
    told = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    return f"DART's taking of <inertial>s that are turned as if they were not ({told})"


def with_turned(model: ET.Element) -> None:
    """Write inertials that are turned along the axes of their links."""
    for link in model.findall("link"):
        inertial = link.find("inertial")
        if inertial is None or not np.any(_pose(inertial)[3:]):
            continue
        pose, moments = _pose(inertial), _tensor(inertial)
        turn = from_rpy(pose[3:])
        moments = turn @ moments @ turn.T
        for part in (*inertial.findall("pose"), *inertial.findall("inertia")):
            inertial.remove(part)
        ET.SubElement(inertial, "pose").text = " ".join(map(repr, [*pose[:3].tolist(), 0, 0, 0]))
        inertia = ET.SubElement(inertial, "inertia")
        for key in TENSOR:
            i, j = ("xyz".index(axis) for axis in key[1:])
            ET.SubElement(inertia, key).text = repr(float(moments[i, j]))


def refuse_newer(file: SdfFile) -> None:
    """Refuse what version 1.6 can't say: frames that differ from the defaults.

    Raises:
        EngineError: naming file and line.
    """
    for pose in file.model.iter("pose"):
        for key in ("rotation_format", "degrees"):
            if pose.get(key) not in (None, "euler_rpy", "false", "0"):
                raise _newer(file, pose, f"a pose with {key}=")
    for element in (file.model, *file.model.findall("link"), *file.model.findall("joint")):
        _refuse_moved(file, element)
    if file.model.get("placement_frame"):
        raise _newer(file, file.model, "placement_frame=")


def _refuse_moved(file: SdfFile, element: ET.Element) -> None:
    joint = file.joints.get(element.get("name", "")) if element.tag == "joint" else None
    own = {"joint": (element.findtext("child", "").strip(),), "model": ("world",)}
    for pose in element.findall("pose"):
        if pose.get("relative_to", "") not in ("", *own.get(element.tag, ("__model__",))):
            raise _newer(file, pose, f"relative_to={pose.get('relative_to')!r}")
    for pose in element.findall("inertial/pose"):
        if pose.get("relative_to"):
            raise _newer(file, pose, "relative_to= of an inertial")
    if joint is None:
        return
    for tag, link in (("parent", joint.parent), ("child", joint.child)):
        if element.findtext(tag, "").strip() != link:
            raise _newer(file, element, f"a frame for the {tag} of joint {joint.name!r}")
    for xyz in element.findall("axis/xyz"):
        if xyz.get("expressed_in", "") not in ("", "__model__", joint.name):
            raise _newer(file, xyz, f"expressed_in={xyz.get('expressed_in')!r}")


def _newer(file: SdfFile, element: ET.Element, what: str) -> EngineError:
    return file.source.refused(
        element, f"DART reads SDFormat to version 1.6, which has no {what}; write poses without it"
    )


def as_older(model: ET.Element) -> None:
    """Say as version 1.6 does what that can say, and in so many words what DART wants said."""
    for inertia in model.findall("link/inertial/inertia"):
        for key in TENSOR:
            if inertia.find(key) is None:
                ET.SubElement(inertia, key).text = "1" if key[1] == key[2] else "0"
    for element in model.iter():
        element.attrib.pop("relative_to", None)
    for frame in model.findall("frame"):
        model.remove(frame)
    for axis in model.findall("joint/axis"):
        if axis.find("xyz") is None:
            ET.SubElement(axis, "xyz").text = "0 0 1"
    _axes_as_older(model)


def _axes_as_older(model: ET.Element) -> None:
    for joint in model.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            sdf_without_bounds_of(joint)
        axis, xyz = joint.find("axis"), joint.find("axis/xyz")
        expressed = "" if xyz is None else xyz.attrib.pop("expressed_in", "")
        if axis is not None and expressed == "__model__":
            ET.SubElement(axis, "use_parent_model_frame").text = "true"


def _pose(element: ET.Element) -> Array:
    """Place and rpy, (6,)."""
    words = (element.findtext("pose") or "").split()
    return np.array(words, dtype=float) if words else np.zeros(6)


def _tensor(inertial: ET.Element) -> Array:
    """As it stands there, (3, 3); what is not told is the format's: 1 and 0 kg m^2."""
    inertia = inertial.find("inertia")
    found = np.eye(3)
    for key in TENSOR:
        i, j = ("xyz".index(axis) for axis in key[1:])
        value = float(i == j) if inertia is None else number(inertia, key, float(i == j))
        found[i, j] = found[j, i] = value
    return found
