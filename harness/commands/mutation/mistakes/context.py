"""Mistakes as data: their edits and right causes, and the model in which they are planted."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.prepare import PreparedSystem
from physics_crosscheck.harness.checks.task import ModelTask, P, SystemTask
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import DefaultLeftOn, Engine, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import Binding, rewrite, with_literals
from physics_crosscheck.harness.modelfiles.locations import find, numbers
from physics_crosscheck.harness.modelfiles.locations.attributes import (
    Attribute,
    elements,
    with_attributes,
)
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
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


@dataclass(frozen=True)
class Edit:
    """The changes in a copy of a model; picklable.

    Attributes:
        literals: new values, by address.
        attributes: attributes of XML elements to set, add or remove.
        settings: settings of the engine.
        numbers: new values of numbers of a robot file, or of a model of bodies, by index.
        law: the mistake in the laws by which an engine with a known answer steps; with settings,
            their cause.
    """

    literals: Mapping[str, float] = field(default_factory=dict)
    attributes: tuple[Attribute, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)
    numbers: Mapping[int, float] = field(default_factory=dict)
    law: str = ""

    def plant(self, task: ModelTask[P], into: Path) -> ModelTask[P]:
        """Write an edited copy of a task's model into the folder `into`, and return its task.

        Raises:
            LocationError: naming file, line and remedy.
        """
        if isinstance(task.target, PreparedSystem):
            return task.with_sidecar(self._applied(task.declared, task.engine, into))
        texts = robot_numbers(task.file, task.spec.settings).texts(self.numbers)
        copy = task.with_file(copy_with_texts(task.file, texts, into))
        return copy.with_settings(**self.settings)

    def _applied(self, sidecar: Sidecar, engine: str, into: Path) -> Sidecar:
        copy = with_literals(sidecar, {}, into)
        if self.attributes:
            data = with_attributes(copy.model.read_bytes(), copy.model, self.attributes)
            copy.model.write_bytes(data)
        if self.literals:
            rewrite(copy, self.literals)
            # The edits may include numbers of the sidecar itself.
            copy = read_sidecar(Path(f"{copy.model}.toml"))
        if not self.settings:
            return copy
        settings = {**copy.engine_settings.get(engine, {}), **self.settings}
        return replace(copy, engine_settings={**copy.engine_settings, engine: settings})


def literal_causes(*addresses: str) -> frozenset[CauseId]:
    """Return the names that a diagnosis may give to some literals, bound or not."""
    kinds: tuple[CauseKind, ...] = ("literal", "unbound literal")
    return frozenset(CauseId(kind=kind, subject=(a,)) for a in addresses for kind in kinds)


@dataclass(frozen=True)
class Mistake:
    """One mistake in one model.

    Attributes:
        name: action of the user.
        location: a joint, a literal or a setting.
        edit: the edit that plants it.
        causes: the right causes; a diagnosis may name any of them.
        audit_words: words that the audit must report on the frames if no motion shows the mistake.
        sound: whether it only changes the error of a time step and not the mechanism.
    """

    name: str
    location: str
    edit: Edit
    causes: frozenset[CauseId] = frozenset()
    sound: bool = False
    audit_words: str = ""


def default_mistake(usual: DefaultLeftOn, law: str = "") -> Mistake:
    """Return the mistake that a default of an engine is left on, which may be one in a law."""
    return Mistake(
        usual.name,
        f"settings.{usual.setting}",
        Edit(settings={usual.setting: usual.value}, law=law),
        frozenset({CauseId(kind="default", subject=(usual.cause,))}),
    )


def defaults_left_on(task: ModelTask[P], *, whole: bool) -> Iterator[Mistake]:
    """Yield each default that the settings do not already request; `whole`: of whole steps."""
    for usual in engines()[task.engine].usual_mistakes:
        if not isinstance(usual, DefaultLeftOn) or usual.whole != whole:
            continue
        if task.spec.settings.get(usual.setting) != usual.value:
            yield default_mistake(usual, usual.cause if whole else "")
