"""A URDF with its sidecar's additions, for engines that read the whole file."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from physics_crosscheck.harness.documents.document import Mimic
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.read import SdfFile
from physics_crosscheck.harness.documents.urdf import UrdfFile
from .protocol import Array, EngineError, ModelSpec, Spring, held_joints
from .remark import Remark
from .urdf import UrdfReader, load_urdf, urdf_remarks
from .urdf_copy import Change, followers_of, mimics_of, with_changes, with_held, without_shapes

REQUIRED = ("step", "gravity")
"""Settings that a sidecar must state, since no URDF does."""

ROBOTS: Mapping[str, bool] = MappingProxyType({"smooth": False, "floating": False})
"""Defaults: contacts and limits are kept, and the root link is fixed."""

HELD = "held"
"""The setting that names fixed joints."""


@dataclass(frozen=True, kw_only=True)
class Declarations(ABC):
    """Declarations of a file and its sidecar.

    Attributes:
        file: the content of the file.
        springs: of joints, in Gazebo's convention, and of the sidecar; without those of held
            joints.
        mimics: joints that follow others, limited by the setting `couplings`.
        changes: the changes that settings make to the file before an engine loads it.
    """

    file: UrdfFile | SdfFile
    springs: tuple[Spring, ...]
    mimics: tuple[Mimic, ...]
    changes: tuple[Change, ...]

    @property
    @abstractmethod
    def robot(self) -> XmlElement:
        """The element that changes copy."""

    @property
    @abstractmethod
    def text(self) -> str:
        """The text that an engine loads."""

    @property
    @abstractmethod
    def moments(self) -> Mapping[str, float]:
        """The stated ixx of links, kg m^2."""

    @abstractmethod
    def remarks(
        self, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
    ) -> Iterator[Remark]:
        """Return remarks about the file along the states (z, w)."""

    @property
    def root(self) -> str:
        """The root link, or `world`."""
        return self.file.root

    @property
    def base(self) -> str:
        """The name of a floating root's free joint."""
        return self.file.base

    @property
    def links(self) -> tuple[str, ...]:
        """Names of links, in the file's order."""
        return tuple(self.file.links)

    def bounds(self, *, turns: bool) -> Mapping[str, tuple[float, float]]:
        """Return position limits of the file, if lower is below upper.

        Args:
            turns: whether those of continuous joints count.
        """
        file = self.file
        if isinstance(file, UrdfFile):
            bounds = {name: file.stated_bounds(name) if turns else joint.bounds
                      for name, joint in file.joints.items()}  # fmt: skip
        else:
            joints = [one for joint in file.joints.values() for one in joint.joints]
            bounds = {one.name: one.limits for one in joints if one.limits}
        return {name: (lower, upper) for name, (lower, upper) in bounds.items() if lower < upper}


@dataclass(frozen=True, kw_only=True)
class DeclaredUrdf(Declarations):
    """Declarations of a URDF and its sidecar."""

    file: UrdfFile

    @property
    def robot(self) -> XmlElement:
        """The element that changes copy."""
        return self.file.document.root

    @property
    def text(self) -> str:
        """The text that an engine loads."""
        return with_changes(self.robot, self.changes).written().decode()

    @property
    def moments(self) -> Mapping[str, float]:
        """The stated ixx of links, kg m^2; zero by default."""
        return {name: link.body.inertia[0] for name, link in self.file.links.items()}

    def remarks(
        self, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
    ) -> Iterator[Remark]:
        """Return remarks about the file along the states (z, w)."""
        return urdf_remarks(reader, self.file, joints, z, w)


def declared_urdf(spec: ModelSpec, further: Sequence[Change] = ()) -> DeclaredUrdf:
    """Read a URDF and its sidecar; `further` changes are the engine's own.

    Raises:
        EngineError: naming file, line and setting.
    """
    file, held = load_urdf(spec.path), held_joints(spec)
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    changes = [*further]
    if spec.settings.get("smooth", False):
        changes.append(without_shapes)
    if followers is not None:
        changes.append(mimics_of(followers))
    if held:
        changes.append(with_held(held))
    return DeclaredUrdf(
        file=file,
        springs=(*joint_springs(file, held), *spec.springs),
        mimics=kept_mimics(file.mimics, followers),
        changes=tuple(changes),
    )


def joint_springs(file: UrdfFile, held: Collection[str]) -> tuple[Spring, ...]:
    """Return the springs of a file's joints that are not held."""
    return tuple(
        Spring({joint: 1.0}, stiffness, 0.0, rest)
        for joint, (stiffness, rest) in file.springs.items()
        if joint not in held
    )


def kept_mimics(
    mimics: Mapping[str, Mimic], followers: Collection[str] | None
) -> tuple[Mimic, ...]:
    """Return the mimics that the setting `couplings` keeps; None keeps all."""
    return tuple(one for name, one in mimics.items() if followers is None or name in followers)


def check_settings(
    spec: ModelSpec,
    title: str,
    default_settings_note: str,
    defaults: Mapping[str, float | bool | str],
    choices: Mapping[str, Sequence[str]] = MappingProxyType({}),
    besides: Collection[str] = (),
) -> None:
    """Refuse settings that are unknown, of a wrong type, or missing.

    Args:
        spec: the file with its settings.
        title: of the engine.
        default_settings_note: its default step and gravity.
        defaults: of its own settings; their types are required.
        choices: the accepted words of text settings.
        besides: settings that are checked elsewhere.

    Raises:
        EngineError: naming the sidecar and the setting.
    """
    held_joints(spec)
    followers_of(spec.settings, f"{spec.path}.toml")
    unknown = set(spec.settings) - {*REQUIRED, *defaults, *besides, "couplings", HELD}
    if unknown:
        raise EngineError(f"{spec.path}.toml: {title} has no setting {', '.join(sorted(unknown))}")
    for key, default in defaults.items():
        value = spec.settings.get(key, default)
        if not _fits(value, default, choices.get(key, ())):
            wanted = _wanted(default, choices.get(key, ()))
            raise EngineError(f"{spec.path}.toml: [settings] {key} is {value!r}; expected {wanted}")
    for key in REQUIRED:
        if key not in spec.settings:
            raise EngineError(
                f"{spec.path}.toml: [settings] must set {key}: the file does not, "
                f"and {title}'s defaults are {default_settings_note}"
            )


def _fits(value: object, default: float | bool | str, choices: Sequence[str]) -> bool:
    if isinstance(default, str):
        return value in choices
    if isinstance(default, bool) or isinstance(value, bool):
        return isinstance(value, bool) and isinstance(default, bool)
    return isinstance(value, (int, float))


def _wanted(default: float | bool | str, choices: Sequence[str]) -> str:
    if isinstance(default, str):
        return f"one of {', '.join(choices)}"
    return "true or false" if isinstance(default, bool) else "a number"
