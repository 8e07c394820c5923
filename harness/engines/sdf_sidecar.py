"""An SDFormat model with what its sidecar adds, as `urdf_sidecar` has it of a URDF."""

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
"""The setting that chooses one of several models of an SDFormat file."""


@dataclass(frozen=True, kw_only=True)
class DeclaredSdf(DeclaredUrdf):
    """The same of an SDFormat file, whose `<model>` is the `robot`.

    Its springs are the sidecar's: those of the file are the engine's own.

    Attributes:
        file: the whole.
    """

    file: SdfFile

    @property
    def root(self) -> str:
        """The link that carries all others, or `world`."""
        return self.file.root

    @property
    def base(self) -> str:
        """What the free joint of a root that floats is called."""
        name = self.file.root
        while name in self.file.joints:
            name += "_free"
        return name

    @property
    def moments(self) -> Mapping[str, float]:
        """What links state for ixx, kg m^2, but those whose inertia follows from their shapes."""
        links = [link for link in self._links if not has_automatic(link)]
        found = {link.get("name", ""): link.find("inertial/inertia") for link in links}
        return {n: 1.0 if i is None else number(i, "ixx", 1.0) for n, i in found.items()}

    @property
    def text(self) -> str:
        """The model alone, as an engine loads it."""
        return sdf_text(self.file, self.changes)

    @property
    def bounds(self) -> Bounds:
        """Between which the file says that positions are."""
        return self.file.bounds

    def remarks(
        self, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
    ) -> Iterator[Remark]:
        """What is to be said of the file along the states (z, w)."""
        return sdf_remarks(self.file, reader, joints, z, w)


def stated(spec: ModelSpec) -> ModelSpec:
    """An SDFormat file with settings that it states itself; those of its sidecar count.

    Raises:
        EngineError: naming file, line and setting.
    """
    own = read_sdf(spec.path, spec.settings.get(MODEL, "")).settings
    if spec.settings.get("floating", own["floating"]) != own["floating"]:
        said = "no joint holds the model" if own["floating"] else "a joint to world holds the model"
        raise EngineError(
            f"{spec.path}.toml: [settings] floating contradicts the file, where "
            f"{said}; remove it, or change the joints to world"
        )
    return replace(spec, settings={**own, **spec.settings})


def declared_sdf(spec: ModelSpec, further: Sequence[Change] = ()) -> DeclaredSdf:
    """Read an SDFormat file and what is declared beside it; `further` changes are the engine's.

    Shapes are left out, and what a simulator would load besides.

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
