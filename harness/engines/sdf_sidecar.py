"""An SDFormat model with its sidecar's additions, and copies of it that engines load.

The user's file does not change.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.frames import has_automatic
from physics_crosscheck.harness.documents.sdf.read import AXES, SdfFile
from .protocol import Array, EngineError, ModelSpec, held_joints
from .remark import Remark
from .sdf import load_sdf, sdf_remarks
from .urdf import UrdfReader
from .urdf_copy import Change, followers_of, with_changes
from .urdf_sidecar import Declarations, kept_mimics

OPAQUE = ("plugin", "sensor", "gripper", "visual", "light", "projector")
"""Elements that are removed for engines: visuals, sensors, and content that a simulator would
load.
"""

VERSION = "1.6"
"""The last version without frames, which older parsers read."""


def sdf_text(file: SdfFile, changes: Sequence[Change]) -> str:
    """Return the model as text, without its world, after changes of the `<model>`."""
    root = XmlElement("sdf", {"version": VERSION} | file.document.root.attributes)
    root.append(with_changes(file.model, changes))
    return root.written().decode()


def sdf_without_shapes(model: XmlElement) -> None:
    """Remove visuals, contacts, sensors, lights and plugins, so that no mesh or code is loaded.

    Shapes that define an automatic inertia stay.
    """
    for holder in (model, *model.findall("link"), *model.findall("joint")):
        for part in list(holder):
            if part.tag in OPAQUE or (part.tag == "collision" and not has_automatic(holder)):
                holder.remove(part)


def sdf_without_bounds(model: XmlElement) -> None:
    """Remove all position limits."""
    for joint in model.findall("joint"):
        sdf_without_bounds_of(joint)


def sdf_without_bounds_of(joint: XmlElement) -> None:
    """Remove the position limits of one joint."""
    for limit in (one for tag in AXES for one in joint.findall(f"{tag}/limit")):
        for part in list(limit):
            if part.tag in ("lower", "upper"):
                limit.remove(part)


def sdf_without_friction(model: XmlElement) -> None:
    """Remove the dry friction of joints."""
    for dynamics in (one for tag in AXES for one in model.findall(f"joint/{tag}/dynamics")):
        for part in dynamics.findall("friction"):
            dynamics.remove(part)


def sdf_with_held(names: Sequence[str]) -> Change:
    """Return a change that fixes joints at their drawn positions."""

    def hold(model: XmlElement) -> None:
        for joint in model.findall("joint"):
            if joint.get("name") in names:
                joint.set("type", "fixed")
                for axis in (one for tag in AXES for one in joint.findall(tag)):
                    joint.remove(axis)

    return hold


def sdf_mimics_of(followers: Collection[str]) -> Change:
    """Return a change that releases all mimic joints except these."""

    def change(model: XmlElement) -> None:
        for joint in model.findall("joint"):
            for axis in joint.findall("axis") if joint.get("name") not in followers else ():
                for mimic in axis.findall("mimic"):
                    axis.remove(mimic)

    return change


MODEL = "model"
"""The setting that selects one of several models of an SDFormat file."""


@dataclass(frozen=True, kw_only=True)
class DeclaredSdf(Declarations):
    """Declarations of an SDFormat file.

    The springs are the sidecar's; engines read those of the file themselves.
    """

    file: SdfFile

    @property
    def robot(self) -> XmlElement:
        """The element that changes copy."""
        return self.file.model

    @property
    def moments(self) -> Mapping[str, float]:
        """The stated ixx of links, kg m^2, except those computed from shapes."""
        links = {n: one for n, one in self.file.links.items() if not has_automatic(one.element)}
        return {name: link.body.inertia[0] for name, link in links.items()}

    @property
    def text(self) -> str:
        """The model as an engine loads it."""
        return sdf_text(self.file, self.changes)

    def remarks(
        self, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
    ) -> Iterator[Remark]:
        """Return remarks about the file along the states (z, w)."""
        return sdf_remarks(self.file, reader, joints, z, w)


def stated(spec: ModelSpec) -> ModelSpec:
    """Return an SDFormat file with the settings that it states; the sidecar overrides them.

    Raises:
        EngineError: naming file, line and setting.
    """
    file = load_sdf(spec.path, spec.settings.get(MODEL, ""))
    if spec.settings.get("floating", file.floats) != file.floats:
        fact = "no joint holds the model" if file.floats else "a joint to world holds the model"
        raise EngineError(
            f"{spec.path}.toml: [settings] floating contradicts the file, where "
            f"{fact}; remove it, or change the joints to world"
        )
    return replace(spec, settings={"floating": file.floats, **file.stated, **spec.settings})


def declared_sdf(spec: ModelSpec, further: Sequence[Change] = ()) -> DeclaredSdf:
    """Read an SDFormat file and its sidecar; `further` changes are the engine's.

    Shapes and content for simulators are left out.

    Raises:
        EngineError: naming file, line and setting.
    """
    file, held = load_sdf(spec.path, spec.settings.get(MODEL, "")), held_joints(spec)
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    changes = [sdf_without_shapes, *further]
    if followers is not None:
        changes.append(sdf_mimics_of(followers))
    if held:
        changes.append(sdf_with_held(held))
    return DeclaredSdf(
        file=file,
        springs=spec.springs,
        mimics=kept_mimics(file.mimics, followers),
        changes=tuple(changes),
    )
