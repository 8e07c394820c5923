"""Extra friction, damping or armature in a joint, which the equations do not have."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute
from physics_crosscheck.harness.mutation.mistakes.context import Subject, rounded
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake, literal_causes
from physics_crosscheck.harness.records.cause import CauseKind

SHARE = 0.05
"""Share of the value whose effect would equal the forces or inertias of the motion."""

MJCF: tuple[tuple[str, str, CauseKind], ...] = (
    ("friction left in", "frictionloss", "friction"),
    ("damping left in", "damping", "damping"),
    ("armature left in", "armature", "inertia"),
)
URDF: tuple[tuple[str, str, CauseKind], ...] = (
    ("friction left in", "friction", "friction"),
    ("damping left in", "damping", "damping"),
)


def left_in(subject: Subject) -> Iterator[Mistake]:
    """Yield each of these effects at each moving joint without it."""
    for name, joint in subject.joints():
        owner, attributes = (joint, MJCF) if subject.suffix == ".xml" else (None, URDF)
        if owner is None:
            owner = next((c for c in joint.children if c.tag == "dynamics"), None)
            if owner is None:
                continue
        for what, attribute, kind in attributes:
            if f"{owner.tag}@{attribute}" in subject.engine.ignores:
                continue
            if float(owner.attributes.get(attribute, "0").split()[0]):
                continue  # already present; planted as a fault if it is bound to a constant
            value = rounded(SHARE * subject.size(name, kind))
            edit = Edit(attributes=(Attribute(owner.start, attribute, repr(value)),))
            address = f"{owner.spelled(1 if owner is joint else 2)}@{attribute}"
            yield Mistake(what, name, edit, subject.about(name, kind) | literal_causes(address))
