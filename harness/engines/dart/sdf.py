"""SDFormat for DART, whose parser reads versions 1.4 to 1.6 and ignores parts of a file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.frames import SIZES, WATER, has_automatic, solid
from physics_crosscheck.harness.documents.sdf.read import AXES, SdfFile, SdfJoint
from physics_crosscheck.reference.mechanism.rotations import from_rpy
from ..protocol import Array, EngineError
from ..sdf import number
from ..sdf_sidecar import VERSION, sdf_without_bounds_of
from ..source import refused, shortened, temporary_file

_PARSED_VERSIONS = ("1.4", "1.5", "1.6")
_IN_MODEL = ("1.0", "1.1", "1.2", "1.3", "1.4")
UNIT_WITHIN = 1e-10
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def sdf_skeleton(text: str, path: Path, floats: bool) -> Any:
    """Return DART's skeleton, or None with an explanation on stderr if it can't load the text."""
    import dartpy as dart

    parser = dart.utils.SdfParser
    options, roots = parser.Options(), parser.RootJointType
    options.mDefaultRootJointType = roots.FLOATING if floats else roots.FIXED
    root = Document(path, text.encode()).root.copy()
    if root.get("version") in _IN_MODEL:
        _axes_in_model(root)
    if root.get("version") not in _PARSED_VERSIONS:
        root.set("version", VERSION)
    with temporary_file(root.written(), path) as file:
        skeleton = parser.readSkeleton(dart.common.Uri(file.as_uri()), options)
    if skeleton is not None:
        _restore_root_and_masses(skeleton, root, floats)
    return skeleton


def _axes_in_model(root: XmlElement) -> None:
    """Mark axes as given in the model's frame, the default of old versions that DART ignores."""
    for axis in (one for tag in AXES for one in root.findall(f"model/joint/{tag}")):
        if axis.find("use_parent_model_frame") is None:
            axis.add("use_parent_model_frame", text="true")


def _restore_root_and_masses(skeleton: Any, root: XmlElement, floats: bool) -> None:
    """Count a floating root from the world instead of its drawn pose, and restore masses of
    zero.
    """
    import dartpy as dart

    if floats:
        skeleton.getJoint(0).setTransformFromParentBodyNode(dart.math.Isometry3.Identity())
    for link in root.findall("model/link"):
        mass = link.find("inertial/mass")
        if mass is not None and mass.text.strip() and float(mass.text) == 0.0:
            skeleton.getBodyNode(link.get("name", "")).setMass(0.0)  # DART itself sets 1e-9 kg


def turned_links(model: XmlElement) -> list[str]:
    """Return the names of links with rotated inertials whose moments the rotation changes."""
    names = []
    for link in model.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None and np.any(_pose(inertial)[3:]):
            moments = _tensor(inertial)
            turn = from_rpy(*_pose(inertial)[3:])
            if np.abs(turn @ moments @ turn.T - moments).max() > 1e-15 * np.abs(moments).max():
                names.append(link.get("name", ""))
    return names


def turned_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    return f"DART's taking of <inertial>s that are turned as if they were not ({shortened(names)})"


def with_turned(model: XmlElement) -> None:
    """Rewrite rotated inertials along the axes of their links."""
    for link in model.findall("link"):
        inertial = link.find("inertial")
        if inertial is None or not np.any(_pose(inertial)[3:]):
            continue
        pose, moments = _pose(inertial), _tensor(inertial)
        turn = from_rpy(*pose[3:])
        mass = number(inertial, "mass", 1.0)
        _write_inertial(link, mass, pose[:3], turn @ moments @ turn.T)


def _write_inertial(link: XmlElement, mass: float, center: Array, moments: Array) -> None:
    for part in link.findall("inertial"):
        link.remove(part)
    inertial = link.add("inertial")
    inertial.add("mass", text=repr(float(mass)))
    inertial.add("pose", text=" ".join(map(repr, [*center.tolist(), 0, 0, 0])))
    inertia = inertial.add("inertia")
    for key in TENSOR:
        i, j = ("xyz".index(axis) for axis in key[1:])
        inertia.add(key, text=repr(float(moments[i, j])))


def automatic_links(model: XmlElement) -> list[str]:
    """Return the names of links whose inertia follows from their shapes, which DART ignores."""
    return [link.get("name", "") for link in model.findall("link") if has_automatic(link)]


def automatic_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    return f'DART\'s own 1 kg and 1 kg m^2 for <inertial auto="true"> ({shortened(names)})'


def momentless_links(model: XmlElement) -> list[str]:
    """Return the names of links that state a mass and no `<inertia>`: DART takes mass times 1 m^2.

    The format, and Drake, take 1 kg m^2.
    """
    return [
        link.get("name", "")
        for link in model.findall("link")
        if link.find("inertial/inertia") is None
        and not has_automatic(link)
        and number(link, "inertial/mass", 1.0) != 1.0
    ]


def momentless_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    return f"DART's own moments, mass times 1 m^2, without <inertia> ({shortened(names)})"


def ball_dampers(model: XmlElement) -> dict[str, float]:
    """Return the damping of ball joints, N m s/rad, by name, which DART ignores."""
    balls = [joint for joint in model.findall("joint") if joint.get("type") == "ball"]
    dampers = {one.get("name"): number(one, "axis/dynamics/damping", 0.0) for one in balls}
    return {name: damping for name, damping in dampers.items() if damping}


def undamped_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    return f"DART's ignoring of <damping> of ball joints ({shortened(names)})"


def misread_screws(model: XmlElement) -> dict[XmlElement, float]:
    """Return the pitches of screws that DART misreads, m per turn.

    DART takes `<thread_pitch>` as m per turn, with 0.1 by default, and ignores
    `<screw_thread_pitch>` (SdfParser.cpp, readScrewJoint).
    """
    pitches = dict[XmlElement, float]()
    for joint in (one for one in model.findall("joint") if one.get("type") == "screw"):
        pitch = number(joint, "screw_thread_pitch", 1.0)
        if joint.find("screw_thread_pitch") is None:
            pitch = -2 * np.pi / number(joint, "thread_pitch", -2 * np.pi)
        if pitch != number(joint, "thread_pitch", 0.1):
            pitches[joint] = pitch
    return pitches


def screw_cause(names: Sequence[str]) -> str:
    """Return the cause that a diagnosis reports."""
    return f"DART's own pitch of screws, <thread_pitch> in m per turn or 0.1 ({shortened(names)})"


def with_pitches(model: XmlElement) -> None:
    """Write the pitch of screws as DART reads it."""
    for joint, pitch in misread_screws(model).items():
        for part in joint.findall("thread_pitch"):
            joint.remove(part)
        joint.add("thread_pitch", text=repr(float(pitch)))


def with_moments(model: XmlElement) -> None:
    """Write 1 kg m^2 for links that state a mass and no `<inertia>`."""
    names = momentless_links(model)
    for link in model.findall("link"):
        if link.get("name", "") in names:
            inertial = link.find("inertial")
            assert inertial is not None  # it states a mass
            inertia = inertial.add("inertia")
            for key in TENSOR:
                inertia.add(key, text="1" if key[1] == key[2] else "0")


def with_automatic(model: XmlElement) -> None:
    """Write the inertia that follows from the shapes of links in numbers."""
    for link in model.findall("link"):
        if has_automatic(link):
            _write_inertial(link, *_automatic(link))


def without_collisions(model: XmlElement) -> None:
    """Remove all collision shapes."""
    for link in model.findall("link"):
        for part in link.findall("collision"):
            link.remove(part)


def _automatic(link: XmlElement) -> tuple[float, Array, Array]:
    """Return mass, center (3,) and moments about it (3, 3), along the link's axes."""
    parts = [_collision(link, one) for one in link.findall("collision")]
    mass = sum(one for one, _, _ in parts)
    center = sum(one * offset for one, offset, _ in parts) / mass
    moments = np.zeros((3, 3))
    for mass_of_shape, offset, about in parts:
        apart = offset - center
        moments += about + mass_of_shape * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    inertial = link.find("inertial")
    ratio = 1.0 if inertial is None else number(inertial, "mass", mass) / mass
    return mass * ratio, np.asarray(center), moments * ratio


def _collision(link: XmlElement, collision: XmlElement) -> tuple[float, Array, Array]:
    shape = collision.find("geometry/*")
    inertial = link.find("inertial")
    if shape is None or shape.tag not in SIZES or inertial is None:
        raise EngineError(f"link {link.get('name')!r} has a shape of which no inertia is made")
    sizes: list[float] = []
    for tag, default in SIZES[shape.tag].items():
        words = shape.findtext(tag).split()
        sizes += map(float, words) if words else default
    volume, height, moments = solid(shape.tag, sizes)
    mass = volume * number(collision, "density", number(inertial, "density", WATER))
    pose = _pose(collision)
    turn = from_rpy(*pose[3:])
    center = pose[:3] + turn @ np.array([0.0, 0.0, height])
    return mass, center, mass * turn @ np.diag(moments) @ turn.T


def refuse_newer(file: SdfFile) -> None:
    """Refuse frames that differ from the defaults, which version 1.6 can't express.

    Raises:
        EngineError: naming file and line.
    """
    for pose in file.model.iter("pose"):
        for key in ("rotation_format", "degrees"):
            if pose.get(key) not in ("", "euler_rpy", "false", "0"):
                raise _newer(pose, f"a pose with {key}=")
    for element in (file.model, *file.model.findall("link"), *file.model.findall("joint")):
        _refuse_moved(file, element)
    if file.model.get("placement_frame"):
        raise _newer(file.model, "placement_frame=")


def _refuse_moved(file: SdfFile, element: XmlElement) -> None:
    joint = file.joints.get(element.get("name", "")) if element.tag == "joint" else None
    defaults = {"joint": (element.findtext("child").strip(),), "model": ("world",)}
    for pose in element.findall("pose"):
        if pose.get("relative_to", "") not in ("", *defaults.get(element.tag, ("__model__",))):
            raise _newer(pose, f"relative_to={pose.get('relative_to')!r}")
    for tag in ("inertial", "collision") if has_automatic(element) else ("inertial",):
        for pose in element.findall(f"{tag}/pose"):
            if pose.get("relative_to"):
                raise _newer(pose, f"relative_to= of <{tag}>")
    if joint is not None:
        _refuse_frames(file, joint)


def _refuse_frames(file: SdfFile, joint: SdfJoint) -> None:
    element = joint.element
    for tag, link in (("parent", joint.parent), ("child", joint.child)):
        if element.findtext(tag).strip() != link:
            raise _newer(element, f"a frame for the {tag} of joint {joint.name!r}")
    for xyz in (one for tag in AXES for one in element.findall(f"{tag}/xyz")):
        if xyz.get("expressed_in", "") not in ("", "__model__", joint.name):
            raise _newer(xyz, f"expressed_in={xyz.get('expressed_in')!r}")
        size = float(np.linalg.norm(np.array(xyz.text.split(), dtype=float)))
        if joint.second and abs(size - 1) > UNIT_WITHIN:
            what = f"joint {joint.name!r} has an axis of length {size:.7g}, which DART uses as is"
            raise refused(xyz, f"{what}; write a unit vector")


def _newer(element: XmlElement, what: str) -> EngineError:
    return refused(
        element, f"DART reads SDFormat to version 1.6, which has no {what}; write poses without it"
    )


def as_older(model: XmlElement) -> None:
    """Rewrite the model as version 1.6, with the elements that DART requires written out."""
    for inertia in model.findall("link/inertial/inertia"):
        for key in TENSOR:
            if inertia.find(key) is None:
                inertia.add(key, text="1" if key[1] == key[2] else "0")
    for element in model.iter():
        element.attributes.pop("relative_to", None)
    for frame in model.findall("frame"):
        model.remove(frame)
    for axis in (one for tag in AXES for one in model.findall(f"joint/{tag}")):
        if axis.find("xyz") is None:
            axis.add("xyz", text="0 0 1")
    _axes_as_older(model)


def _axes_as_older(model: XmlElement) -> None:
    for joint in model.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            sdf_without_bounds_of(joint)
        for axis in (one for tag in AXES for one in joint.findall(tag)):
            xyz = axis.find("xyz")
            expressed = "" if xyz is None else xyz.attributes.pop("expressed_in", "")
            if expressed == "__model__":
                axis.add("use_parent_model_frame", text="true")


def _pose(element: XmlElement) -> Array:
    words = element.findtext("pose").split()
    return np.array(words, dtype=float) if words else np.zeros(6)


def _tensor(inertial: XmlElement) -> Array:
    """Return the tensor as stated, (3, 3), with the format's defaults of 1 and 0 kg m^2."""
    inertia = inertial.find("inertia")
    tensor = np.eye(3)
    for key in TENSOR:
        i, j = ("xyz".index(axis) for axis in key[1:])
        value = float(i == j) if inertia is None else number(inertia, key, float(i == j))
        tensor[i, j] = tensor[j, i] = value
    return tensor
