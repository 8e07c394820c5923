"""Mistakes as data: the edits, and the causes that are right."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from physics_crosscheck.harness.checks.prepare import PreparedSystem
from physics_crosscheck.harness.checks.task import ModelTask, P
from physics_crosscheck.harness.modelfiles.bindings import rewrite, with_literals
from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute, with_attributes
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.records.cause import CauseId, CauseKind


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
