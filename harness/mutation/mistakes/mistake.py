"""A mistake as data: what is edited, and which causes are right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from physics_crosscheck.harness.diagnosis.hypotheses.trial import with_engine_settings
from physics_crosscheck.harness.modelfiles.bindings import rewrite, with_literals
from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute, with_attributes
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.records.cause import CauseId, CauseKind


@dataclass(frozen=True)
class Edit:
    """What changes in a copy of a model; picklable.

    Attributes:
        literals: new values, by address.
        attributes: of elements of an XML file, set, added or taken out.
        settings: of the sidecar, for the engine at hand.
    """

    literals: Mapping[str, float] = field(default_factory=dict)
    attributes: tuple[Attribute, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)

    def made(self, sidecar: Sidecar, engine: str, into: Path) -> Sidecar:
        """The sidecar of a copy in the folder `into` with the edits made.

        Raises:
            LocationError: naming file, line and remedy.
        """
        copy = with_literals(sidecar, {}, into)
        if self.attributes:
            data = with_attributes(copy.model.read_bytes(), copy.model, self.attributes)
            copy.model.write_bytes(data)
        if self.literals:
            rewrite(copy, self.literals)
            # Numbers of the sidecar itself may be among them.
            copy = read_sidecar(Path(f"{copy.model}.toml"))
        return with_engine_settings(copy, engine, **self.settings) if self.settings else copy


def literal_causes(*addresses: str) -> frozenset[CauseId]:
    """What a diagnosis may call each of some literals: whether it is bound or not."""
    kinds: tuple[CauseKind, ...] = ("literal", "unbound literal")
    return frozenset(CauseId(kind=kind, subject=(a,)) for a in addresses for kind in kinds)


@dataclass(frozen=True)
class Mistake:
    """One mistake in one model.

    Attributes:
        name: what the user did.
        location: a joint, a literal or a setting.
        edit: what makes it.
        causes: those that a diagnosis may name for it, any of which is right.
        told: words that the audit must find of its frames, where no motion shows it.
        sound: whether it is none: it changes the error of a step, and not the mechanism.
    """

    name: str
    location: str
    edit: Edit
    causes: frozenset[CauseId] = frozenset()
    sound: bool = False
    told: str = ""
