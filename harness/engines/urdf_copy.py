"""Copies of a URDF that engines load; the user's file does not change.

PyBullet and DART give each link without `<inertial>` 1 kg and 1 kg m^2, even if welded.
PyBullet's `UrdfParser::parseLink` warns about it on stderr only. In DART it is an option
(`DartLoader::Options::mDefaultInertia`). The default does not affect a root that is fixed to the
world.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.expanded import locate_file
from .protocol import EngineError
from .source import shortened, temporary_file

BARE: Mapping[str, object] = {"bare_links": False}
"""The adapter's setting that gives links without `<inertial>` no mass."""

NO_INERTIAL = "without <inertial>"
"""Words of a cause that is an engine's own mass for such links."""

DEEP = 100.0
"""Depth at which every shape of a robot is below a floor, m."""

SMALLEST_MASS = "1e-300"
"""A mass in kg that is too small to be visible in a motion."""


def bare_links(robot: XmlElement, *, floats: bool = False) -> list[XmlElement]:
    """Return the links without `<inertial>` that have a parent, and a floating root."""
    carried = {child.get("link") for child in robot.findall("joint/child")}
    links = {link.get("name", ""): link for link in robot.findall("link")}
    return [
        link
        for name, link in links.items()
        if (floats or name in carried) and link.find("inertial") is None
    ]


def zero_missing_inertials(robot: XmlElement) -> None:
    """Give links without `<inertial>` no mass and no moments of inertia.

    A root gets the smallest mass, since PyBullet fixes a floating root without mass
    (`ConvertURDF2BulletInternal`: `bool isFixedBase = (mass == 0)`).
    """
    carried = [link.get("name") for link in bare_links(robot)]
    for link in bare_links(robot, floats=True):
        inertial = link.add("inertial")
        inertial.add("mass", {"value": "0" if link.get("name") in carried else SMALLEST_MASS})
        moments = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0")
        inertial.add("inertia", moments)


def bare_cause(links: Sequence[XmlElement], given: str, lacking: str = NO_INERTIAL) -> str:
    """Return the cause that a diagnosis reports; `given` is what an engine gives the links."""
    names = [f"{link.get('name', '')}, line {link.place[1]}" for link in links]
    shown = shortened(names, separator="; ")
    count = "a link" if len(names) == 1 else f"{len(names)} links"
    return f"{given} of {count} {lacking} ({shown})"


Change = Callable[[XmlElement], None]
"""A change of a `<robot>`, in place."""


@contextmanager
def temporary_urdf(
    robot: XmlElement | None,
    path: Path,
    changes: Sequence[Change],
    kept: dict[tuple[Change, ...], bytes] | None = None,
) -> Iterator[Path]:
    """Yield a temporary copy of a URDF with changes, or the file itself without changes.

    File names become absolute, those of packages too; shapes whose files are missing are left out.
    The copy's bytes are kept for the next call with the same changes, if `kept` is given.
    """
    if robot is None or not changes:
        yield path
        return
    kept, key = {} if kept is None else kept, tuple(changes)
    if key not in kept:
        kept[key] = urdf_with_files(with_changes(robot, changes), path).written()
    with temporary_file(kept[key], path) as file:
        yield file


def urdf_with_files(robot: XmlElement, path: Path) -> XmlElement:
    """Name the files of meshes by their whole paths, and remove shapes whose files are missing."""
    for link in robot.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is None or not (name := mesh.get("filename", "")):
                continue
            if (file := locate_file(path, name)) is not None:
                mesh.set("filename", str(file.resolve()))
            else:
                link.remove(shape)
    return robot


def with_changes(robot: XmlElement, changes: Sequence[Change]) -> XmlElement:
    """Return a copy of a `<robot>` with changes."""
    robot = robot.copy()
    for change in changes:
        change(robot)
    return robot


def without_shapes(robot: XmlElement) -> None:
    """Remove visual and collision shapes, so that no meshes are loaded."""
    without_visuals(robot)
    _without(robot, "collision")


def with_forms(forms: Collection[str]) -> Change:
    """Return a change that removes collision shapes of other forms than these."""

    def change(robot: XmlElement) -> None:
        for link in robot.findall("link"):
            for shape in link.findall("collision"):
                if not has_form(shape, forms):
                    link.remove(shape)

    return change


def collision_shapes(link: XmlElement) -> Iterator[tuple[str, XmlElement]]:
    """Yield the collision shapes of a link with their names, as in `Model.shapes`.

    The index counts all shapes of the link, visual ones first.
    """
    first = len(link.findall("visual"))
    for index, shape in enumerate(link.findall("collision"), start=first):
        yield f"collision:{link.get('name', '')}#{index}", shape


def has_form(shape: XmlElement, forms: Collection[str]) -> bool:
    """Return whether a collision shape has one of these forms."""
    form = shape.find("geometry/*")
    return form is not None and form.tag in forms


def without_law(robot: XmlElement, forms: Collection[str]) -> Iterator[str]:
    """Yield the parts of a URDF that act in an engine and have no law here.

    Args:
        robot: the file.
        forms: of the shapes whose contacts are compared.
    """
    joints = robot.findall("joint")
    if any(one.tag not in forms for one in robot.findall("link/collision/geometry/*")):
        yield "contacts of meshes"
    if any(joint.find("mimic") is not None for joint in joints):
        yield "couplings"


def without_visuals(robot: XmlElement) -> None:
    """Remove visual shapes."""
    _without(robot, "visual")
    for material in robot.findall("material"):
        robot.remove(material)


def _without(robot: XmlElement, tag: str) -> None:
    for link in robot.findall("link"):
        for shape in link.findall(tag):
            link.remove(shape)


def with_masses(robot: XmlElement) -> None:
    """Give links with zero mass the smallest mass."""
    for inertial in robot.findall("link/inertial"):
        mass = inertial.find("mass")
        if mass is not None and float(mass.get("value", "0")) == 0:
            mass.set("value", SMALLEST_MASS)


def without_limits(robot: XmlElement) -> None:
    """Give joints limits that PyBullet ignores: the lower above the upper."""
    for joint in robot.findall("joint"):
        if joint.get("type") in ("revolute", "prismatic", "spherical"):
            limit = joint.find("limit")
            if limit is None:
                limit = joint.add("limit", {"effort": "0", "velocity": "0"})
            limit.set("lower", "1")
            limit.set("upper", "-1")


def without_bounds(robot: XmlElement) -> None:
    """Remove all position limits."""
    for limit in robot.findall("joint/limit"):
        for key in ("lower", "upper"):
            limit.attributes.pop(key, None)


def without_friction(robot: XmlElement) -> None:
    """Remove the dry friction of joints."""
    for dynamics in robot.findall("joint/dynamics"):
        dynamics.set("friction", "0")


def without_crossed_bounds(robot: XmlElement) -> None:
    """Remove limits with lower above upper, which most engines ignore."""
    for limit in robot.findall("joint/limit"):
        if float(limit.get("lower", "-inf")) > float(limit.get("upper", "inf")):
            del limit.attributes["lower"], limit.attributes["upper"]


def with_held(names: Sequence[str]) -> Change:
    """Return a change that fixes joints at zero and removes their springs."""

    def hold(robot: XmlElement) -> None:
        for joint in robot.findall("joint"):
            if joint.get("name") in names:
                joint.set("type", "fixed")
        for element in robot.findall("gazebo"):
            if element.get("reference") in names:
                robot.remove(element)

    return hold


def mimics_of(followers: Collection[str]) -> Change:
    """Return a change that releases all mimic joints except these."""

    def change(robot: XmlElement) -> None:
        for joint in robot.findall("joint"):
            for mimic in joint.findall("mimic") if joint.get("name") not in followers else ():
                joint.remove(mimic)

    return change


def followers_of(settings: Mapping[str, object], place: str) -> Collection[str] | None:
    """Return the joints that the setting `couplings` keeps following others; None for all.

    Raises:
        EngineError: if it is neither true, nor false, nor a list of names.
    """
    given = settings.get("couplings", True)
    if isinstance(given, bool):
        return None if given else ()
    if isinstance(given, list) and all(isinstance(one, str) for one in given):
        return given
    raise EngineError(
        f"{place}: [settings] couplings is {given!r}; expected true, false or a "
        "list of the joints that follow others"
    )


SCALARS: Mapping[str, tuple[str, ...]] = MappingProxyType({
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "dynamics": ("damping", "friction"),
    "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("multiplier", "offset"),
    "calibration": ("rising", "falling"),
    "safety_controller": ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"),
})  # fmt: skip
"""Attributes with one number: urdfdom rejects the number if a blank follows it."""

TRIMMED: Mapping[str, object] = MappingProxyType({"trimmed_numbers": True})
"""The setting that removes these blanks for engines that use urdfdom."""


def trim_numbers(robot: XmlElement) -> None:
    """Remove blanks around single numbers."""
    for element in robot.iter():
        for key in SCALARS.get(element.tag, ()):
            if key in element.attributes:
                element.set(key, element.attributes[key].strip())


def _blanks(parts: Iterable[XmlElement]) -> Iterator[str]:
    """Yield the numbers that a blank follows, each with its line."""
    for part in parts:
        for key in SCALARS.get(part.tag, ()):
            words = part.get(key, "")
            if words != words.rstrip():
                file, line = part.place
                yield f'{file}:{line}: <{part.tag} {key}="{words}">'


def refuse_blanks(document: Document, title: str) -> None:
    """Refuse joints with a number that a blank follows: urdfdom then rejects the file.

    Args:
        document: of a URDF.
        title: of the engine.

    Raises:
        EngineError: naming file and line.
    """
    parts = (part for joint in document.root.findall("joint") for part in joint)
    for place in _blanks(parts):
        raise EngineError(
            f"{place} has a space after the number, and {title}'s parser (urdfdom) "
            "rejects such numbers; remove the space, or set trimmed_numbers = true"
        )


def dropped_cause(document: Document, title: str) -> str:
    """Return the cause for inertials that urdfdom drops; empty without any.

    It drops the whole `<inertial>` if a blank follows its mass or one of its moments.
    """
    places = [
        place
        for inertial in document.root.findall("link/inertial")
        for place in list(_blanks(inertial))[:1]
    ]
    cause = f"{title}'s dropping of <inertial>s in which a blank follows a number"
    return f"{cause} ({shortened(places, 3)})" if places else ""
