"""A URDF with what its sidecar adds, for the engines that take it as a whole."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

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
    changed,
    followers_of,
    mimics_of,
    with_held,
    without_shapes,
)

REQUIRED = ("step", "gravity")
"""What no URDF says, and a sidecar must."""

ROBOTS: Mapping[str, bool] = MappingProxyType({"smooth": False, "floating": False})
"""Whether contacts and limits are left out, and whether the root link moves freely."""

HELD = "held"
"""Names of joints that stand still."""


@dataclass(frozen=True, kw_only=True)
class DeclaredUrdf:
    """What a file and its sidecar declare.

    Attributes:
        path, robot: the file.
        source: its elements with their lines.
        springs: of joints, in Gazebo's convention, and of the sidecar; none of what is held.
        mimics: joints that follow others, of those that the setting `couplings` lets.
        changes: what settings change in the file before an engine loads it.
    """

    path: Path
    robot: ET.Element
    source: XmlSource
    springs: tuple[Spring, ...]
    mimics: tuple[Mimic, ...]
    changes: tuple[Change, ...]

    @property
    def root(self) -> str:
        """The link that carries all others."""
        return root_link(self.robot)

    @property
    def base(self) -> str:
        """What the free joint of a root that floats is called."""
        return base_name(self.robot)

    @property
    def links(self) -> tuple[str, ...]:
        """Names, in the file's order."""
        return tuple(link.get("name", "") for link in self._links)

    @property
    def moments(self) -> Mapping[str, float]:
        """What links state for ixx, kg m^2; zero where they state none."""
        found = {link.get("name", ""): link.find("inertial/inertia") for link in self._links}
        return {n: 0.0 if i is None else float(i.get("ixx", "0")) for n, i in found.items()}

    @property
    def _links(self) -> list[ET.Element]:
        return self.robot.findall("link")

    @property
    def text(self) -> str:
        """What an engine loads."""
        return ET.tostring(changed(self.robot, self.changes), encoding="unicode")

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Between which the file says that positions are, where that leaves something."""
        found = {}
        for joint in self.robot.findall("joint"):
            limit = joint.find("limit")
            if limit is not None and joint.get("type") != "continuous":
                lower, upper = (float(limit.get(key, "nan")) for key in ("lower", "upper"))
                if lower < upper:
                    found[joint.get("name", "")] = (lower, upper)
        return found

    def remarks(
        self, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
    ) -> Iterator[Remark]:
        """What is to be said of the file along the states (z, w)."""
        return urdf_remarks(reader, self.path, joints, z, w)


def declared_urdf(spec: ModelSpec, further: Sequence[Change] = ()) -> DeclaredUrdf:
    """Read a URDF and what is declared beside it; `further` changes are the engine's own.

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
    unstated: str,
    defaults: Mapping[str, float | bool | str],
    choices: Mapping[str, Sequence[str]] = MappingProxyType({}),
    besides: Collection[str] = (),
) -> None:
    """Refuse settings that are unknown, of another type, or missing.

    Args:
        spec: the file with its settings.
        title: of the engine.
        unstated: what it takes for a step and gravity that nothing states.
        defaults: of its own settings, whose types count.
        choices: of those that are words.
        besides: settings that are looked at elsewhere.

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
                f"and {title}'s defaults are {unstated}"
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
