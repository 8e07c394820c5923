"""What was left in a joint: friction, damping or an armature that the equations don't have."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute
from physics_crosscheck.harness.mutation.mistakes.context import Subject, rounded
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake, literal_causes
from physics_crosscheck.harness.records.cause import CauseKind

SHARE = 0.05
"""Of what would matter as much as the forces or inertias that the motion has."""

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
    """Each of them at each moving joint that has none."""
    for name, joint in subject.joints():
        owner, terms = (joint, MJCF) if subject.suffix == ".xml" else (None, URDF)
        if owner is None:
            owner = next((c for c in joint.children if c.tag == "dynamics"), None)
            if owner is None:
                continue
        for what, attribute, kind in terms:
            if f"{owner.tag}@{attribute}" in subject.engine.ignores:
                continue
            if float(owner.attributes.get(attribute, "0").split()[0]):
                continue  # it is there, and is mutated if it stands for a constant
            value = rounded(SHARE * subject.size(name, kind))
            edit = Edit(attributes=(Attribute(owner.start, attribute, repr(value)),))
            address = f"{owner.spelled(1 if owner is joint else 2)}@{attribute}"
            yield Mistake(what, name, edit, subject.about(name, kind) | literal_causes(address))
