"""The model in which mistakes are planted, with the properties that the families need."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.harness.checks.task import SystemTask
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import Engine, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import Binding
from physics_crosscheck.harness.modelfiles.locations import find, numbers
from physics_crosscheck.harness.modelfiles.locations.attributes import elements
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.variants import Parameter, variants

XML = (".xml", ".urdf", ".sdf")


@dataclass(frozen=True)
class Subject:
    """A sound model, loaded.

    Attributes:
        task: the model and its motions.
        model, coordinates: the loaded model and its coordinate map.
        bindings: bindings of the model.
    """

    task: SystemTask
    model: LoadedModel
    coordinates: CoordinateMap
    bindings: tuple[Binding, ...]

    @property
    def suffix(self) -> str:
        """Suffix of the model file, which gives its format."""
        return self.task.declared.model.suffix

    @cached_property
    def engine(self) -> Engine:
        """The engine that runs the model."""
        return engines()[self.task.engine]

    @cached_property
    def elements(self) -> tuple[XmlElement, ...]:
        """Elements of an XML file; empty for other formats."""
        return elements(self.task.declared.model) if self.suffix in XML else ()

    def numbers(self, kinds: str) -> dict[str, float]:
        """Return the numbers of the model file by address, of the kinds known to
        `files.locations`.
        """
        file = self.task.declared.model
        try:
            places = find(file, numbers(file, kinds))
        except LocationError:
            return {}  # the numbers of this format have no addresses
        return {address: place.value for address, place in places.items()}

    @property
    def bound(self) -> frozenset[str]:
        """Addresses of the literals that are bound to constants."""
        return frozenset(b.address for b in self.bindings)

    def joints(self) -> Iterator[tuple[str, XmlElement]]:
        """Yield the moving joints with their names and elements."""
        for element in self.elements:
            name = element.attributes.get("name")
            inside = element.parent is not None and element.parent.tag in ("body", "robot", "model")
            if element.tag == "joint" and inside and name in self.model.coordinates:
                yield name, element

    @cached_property
    def _slopes(self) -> Array:
        """Largest |dZ/dq| over the motions, engine coordinates by the system's, (nz, n)."""
        n = len(self.task.target.system.q)
        starts = np.concatenate([m.start[:, :n] for m in self.task.target.motions.values()])
        slopes = self.coordinates.forward_slope(starts).reshape(len(starts), -1, n)
        largest: Array = np.max(np.abs(slopes), axis=0)
        return largest

    def follows(self, joint: str) -> tuple[str, ...]:
        """Return the system's coordinates that move a joint, those with the largest effect
        first.
        """
        row = self._slopes[self.model.coordinates.index(joint)]
        names = [c.name for c in self.task.target.system.coordinates]
        return tuple(names[i] for i in np.argsort(-row) if row[i] > 0)

    def about(self, joint: str, kind: CauseKind) -> frozenset[CauseId]:
        """Return causes in the terms of the equations: one on each coordinate that moves
        the joint.
        """
        return frozenset(CauseId(kind=kind, subject=(name,)) for name in self.follows(joint))

    def size(self, joint: str, kind: CauseKind) -> float:
        """Return the size of an added inertia, damping or friction that matters at a joint, in its
        units.
        """
        names = [c.name for c in self.task.target.system.coordinates]
        name = self.follows(joint)[0]
        slope = self._slopes[self.model.coordinates.index(joint), names.index(name)]
        parameters: dict[tuple[CauseKind, str], float]
        parameters = {(p.kind, p.name): p.size for p in self._sizes_of_terms}
        return float(parameters[kind, name] / slope ** (1 if kind == "friction" else 2))

    @cached_property
    def _sizes_of_terms(self) -> tuple[Parameter, ...]:
        """Missing terms of the equations with their sizes; a target with events has no own ones."""
        target = self.task.target
        if not target.system.interactions:
            return target.variants.parameters
        return variants(derive(target.system), target.amplitude).parameters

    def max_travel(self, joint: str) -> float:
        """Return the largest movement of a joint to either side, in its own units."""
        moved = [self.coordinates.to_engine(m.start)[0] for m in self.task.target.motions.values()]
        mine = np.concatenate(moved)[:, self.model.coordinates.index(joint)]
        return float(np.ptp(mine)) / 2


def rounded(value: float) -> float:
    """Round a number to two digits, as a person would write it."""
    return float(f"{value:.2g}")
