"""The model that mistakes are made in, and what the families ask about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.harness.diagnosis.task import DiagnosisTask
from physics_crosscheck.harness.engines.protocol import Engine, Model
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import Binding
from physics_crosscheck.harness.modelfiles.locations import LocationError, find, numbers
from physics_crosscheck.harness.modelfiles.locations.attributes import elements
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.reference.mechanism.numeric import Array

XML = (".xml", ".urdf", ".sdf")


@dataclass(frozen=True)
class Subject:
    """A sound model, loaded.

    Attributes:
        task: the model and its motions.
        model, coordinates: as the engine has it.
        found: its bindings.
    """

    task: DiagnosisTask
    model: Model
    coordinates: CoordinateMap
    found: tuple[Binding, ...]

    @property
    def suffix(self) -> str:
        """The model file's ending: what its format is."""
        return self.task.sidecar.model.suffix

    @cached_property
    def engine(self) -> Engine:
        """What runs it."""
        return engines()[self.task.engine]

    @cached_property
    def elements(self) -> tuple[RawElement, ...]:
        """Elements of an XML file; none of another."""
        return elements(self.task.sidecar.model) if self.suffix in XML else ()

    def numbers(self, kinds: str) -> dict[str, float]:
        """Numbers of the model file by address, of kinds as `files.locations` takes them."""
        file = self.task.sidecar.model
        try:
            places = find(file, numbers(file, kinds))
        except LocationError:
            return {}  # a format whose numbers have no addresses
        return {address: place.value for address, place in places.items()}

    @property
    def bound(self) -> frozenset[str]:
        """Addresses of the literals that stand for constants."""
        return frozenset(b.address for b in self.found)

    def joints(self) -> Iterator[tuple[str, RawElement]]:
        """The joints that move, by name, with their elements."""
        for element in self.elements:
            name = element.attributes.get("name")
            inside = element.parent is not None and element.parent.tag in ("body", "robot", "model")
            if element.tag == "joint" and inside and name in self.model.coordinates:
                yield name, element

    @cached_property
    def _slopes(self) -> Array:
        """Largest |dZ/dq| over the motions, engine coordinates by the system's, (nz, n)."""
        n = len(self.task.system.q)
        starts = np.concatenate([m.start[:, :n] for m in self.task.motions.values()])
        slopes = self.coordinates.forward_slope(starts).reshape(len(starts), -1, n)
        largest: Array = np.max(np.abs(slopes), axis=0)
        return largest

    def follows(self, joint: str) -> tuple[str, ...]:
        """The system's coordinates that move a joint, the one that moves it most first."""
        row = self._slopes[self.model.coordinates.index(joint)]
        names = [c.name for c in self.task.system.coordinates]
        return tuple(names[i] for i in np.argsort(-row) if row[i] > 0)

    def about(self, joint: str, kind: CauseKind) -> frozenset[CauseId]:
        """Causes in the equations' words: a term on each coordinate that moves the joint."""
        return frozenset(CauseId(kind=kind, subject=(name,)) for name in self.follows(joint))

    def size(self, joint: str, kind: CauseKind) -> float:
        """What matters of an added inertia, damping or friction at a joint, in its own units."""
        names = [c.name for c in self.task.system.coordinates]
        name = self.follows(joint)[0]
        slope = self._slopes[self.model.coordinates.index(joint), names.index(name)]
        parameters: dict[tuple[CauseKind, str], float]
        parameters = {(p.kind, p.name): p.size for p in self.task.variants.parameters}
        return float(parameters[kind, name] / slope ** (1 if kind == "friction" else 2))

    def reach(self, joint: str) -> float:
        """How far a joint moves to either side, in its own units."""
        moved = [self.coordinates.to_engine(m.start)[0] for m in self.task.motions.values()]
        mine = np.concatenate(moved)[:, self.model.coordinates.index(joint)]
        return float(np.ptp(mine)) / 2


def rounded(value: float) -> float:
    """A number as a person would write it: two digits."""
    return float(f"{value:.2g}")
