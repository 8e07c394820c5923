"""An SDFormat model with its sidecar's additions, like `urdf_sidecar` for a URDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from physics_crosscheck.harness.engines.protocol import Array, EngineError, ModelSpec, held_joints
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.sdf import Bounds, SdfFile, number, read_sdf, sdf_remarks
from physics_crosscheck.harness.engines.sdf_check import has_automatic
from physics_crosscheck.harness.engines.sdf_copy import (
    sdf_mimics_of,
    sdf_text,
    sdf_with_held,
    sdf_without_shapes,
)
from physics_crosscheck.harness.engines.urdf import UrdfReader
from physics_crosscheck.harness.engines.urdf_copy import Change, followers_of
from physics_crosscheck.harness.engines.urdf_sidecar import DeclaredUrdf

MODEL = "model"
"""The setting that selects one of several models of an SDFormat file."""


@dataclass(frozen=True, kw_only=True)
class DeclaredSdf(DeclaredUrdf):
    """Declarations of an SDFormat file, whose `<model>` is the `robot`.

    The springs are the sidecar's; engines read those of the file themselves.

    Attributes:
        file: the whole file.
    """

    file: SdfFile

    @property
    def root(self) -> str:
        """The root link, or `world`."""
        return self.file.root

    @property
    def base(self) -> str:
        """The name of a floating root's free joint."""
        name = self.file.root
        while name in self.file.joints:
            name += "_free"
        return name

    @property
    def moments(self) -> Mapping[str, float]:
        """The stated ixx of links, kg m^2, except those computed from shapes."""
        links = [link for link in self._links if not has_automatic(link)]
        inertias = {link.get("name", ""): link.find("inertial/inertia") for link in links}
        return {n: 1.0 if i is None else number(i, "ixx", 1.0) for n, i in inertias.items()}

    @property
    def text(self) -> str:
        """The model as an engine loads it."""
        return sdf_text(self.file, self.changes)

    @property
    def bounds(self) -> Bounds:
        """Position limits of the file."""
        return self.file.bounds

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
    file_settings = read_sdf(spec.path, spec.settings.get(MODEL, "")).settings
    if spec.settings.get("floating", file_settings["floating"]) != file_settings["floating"]:
        fact = (
            "no joint holds the model"
            if file_settings["floating"]
            else "a joint to world holds the model"
        )
        raise EngineError(
            f"{spec.path}.toml: [settings] floating contradicts the file, where "
            f"{fact}; remove it, or change the joints to world"
        )
    return replace(spec, settings={**file_settings, **spec.settings})


def declared_sdf(spec: ModelSpec, further: Sequence[Change] = ()) -> DeclaredSdf:
    """Read an SDFormat file and its sidecar; `further` changes are the engine's.

    Shapes and content for simulators are left out.

    Raises:
        EngineError: naming file, line and setting.
    """
    file, held = read_sdf(spec.path, spec.settings.get(MODEL, "")), held_joints(spec)
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    changes = [sdf_without_shapes, *further]
    if followers is not None:
        changes.append(sdf_mimics_of(followers))
    if held:
        changes.append(sdf_with_held(held))
    mimics = [m for m in file.mimics if followers is None or m.joint in followers]
    return DeclaredSdf(
        path=spec.path,
        robot=file.model,
        source=file.source,
        file=file,
        springs=spec.springs,
        mimics=tuple(mimics),
        changes=tuple(changes),
    )
