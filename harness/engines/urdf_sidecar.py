"""A URDF with its sidecar's additions, for engines that read the whole file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineError,
    ModelSpec,
    Spring,
    held_joints,
)
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.source import XmlSource
from physics_crosscheck.harness.engines.urdf import (
    Mimic,
    UrdfReader,
    base_name,
    joint_springs,
    mimics,
    read_urdf_source,
    root_link,
    urdf_remarks,
)
from physics_crosscheck.harness.engines.urdf_copy import (
    Change,
    followers_of,
    mimics_of,
    with_changes,
    with_held,
    without_shapes,
)

REQUIRED = ("step", "gravity")
"""Settings that a sidecar must state, since no URDF does."""

ROBOTS: Mapping[str, bool] = MappingProxyType({"smooth": False, "floating": False})
"""Defaults: contacts and limits are kept, and the root link is fixed."""

HELD = "held"
"""The setting that names fixed joints."""


@dataclass(frozen=True, kw_only=True)
class DeclaredUrdf:
    """Declarations of a file and its sidecar.

    Attributes:
        path, robot: the file.
        source: its elements with their lines.
        springs: of joints, in Gazebo's convention, and of the sidecar; without those of held
            joints.
        mimics: joints that follow others, limited by the setting `couplings`.
        changes: the changes that settings make to the file before an engine loads it.
    """

    path: Path
    robot: XmlElement
    source: XmlSource
    springs: tuple[Spring, ...]
    mimics: tuple[Mimic, ...]
    changes: tuple[Change, ...]

    @property
    def root(self) -> str:
        """The root link."""
        return root_link(self.robot)

    @property
    def base(self) -> str:
        """The name of a floating root's free joint."""
        return base_name(self.robot)

    @property
    def links(self) -> tuple[str, ...]:
        """Names of links, in the file's order."""
        return tuple(link.get("name", "") for link in self._links)

    @property
    def moments(self) -> Mapping[str, float]:
        """The stated ixx of links, kg m^2; zero by default."""
        inertias = {link.get("name", ""): link.find("inertial/inertia") for link in self._links}
        return {n: 0.0 if i is None else float(i.get("ixx", "0")) for n, i in inertias.items()}

    @property
    def _links(self) -> list[XmlElement]:
        return self.robot.findall("link")

    @property
    def text(self) -> str:
        """The text that an engine loads."""
        return with_changes(self.robot, self.changes).written().decode()

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Position limits of the file, if lower is below upper."""
        result = {}
        for joint in self.robot.findall("joint"):
            limit = joint.find("limit")
            if limit is not None and joint.get("type") != "continuous":
                lower, upper = (float(limit.get(key, "nan")) for key in ("lower", "upper"))
                if lower < upper:
                    result[joint.get("name", "")] = (lower, upper)
        return result

    def remarks(
        self, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
    ) -> Iterator[Remark]:
        """Return remarks about the file along the states (z, w)."""
        return urdf_remarks(reader, self.path, joints, z, w)


def declared_urdf(spec: ModelSpec, further: Sequence[Change] = ()) -> DeclaredUrdf:
    """Read a URDF and its sidecar; `further` changes are the engine's own.

    Raises:
        EngineError: naming file, line and setting.
    """
    source = read_urdf_source(spec.path)
    robot, held = source.root, held_joints(spec)
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    springs = [
        Spring({joint: 1.0}, stiffness, 0.0, rest)
        for joint, (stiffness, rest) in joint_springs(robot, spec.path).items()
        if joint not in held
    ]
    changes = [*further]
    if spec.settings.get("smooth", False):
        changes.append(without_shapes)
    if followers is not None:
        changes.append(mimics_of(followers))
    if held:
        changes.append(with_held(held))
    return DeclaredUrdf(
        path=spec.path,
        robot=robot,
        source=source,
        springs=(*springs, *spec.springs),
        mimics=tuple(
            one for one in mimics(robot, spec.path) if followers is None or one.joint in followers
        ),
        changes=tuple(changes),
    )


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
