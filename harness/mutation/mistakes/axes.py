"""Reversed joint axes."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake
from physics_crosscheck.harness.records.cause import CauseId


def axes(subject: Subject) -> Iterator[Mistake]:
    """Yield a mistake for each moving joint whose axis the file states: the axis reversed.

    A mirrored mechanism moves alike, so that reversing one axis may be equivalent to reversing all
    others. A diagnosis may name any axis that corrects it.
    """
    causes = frozenset(CauseId(kind="axis", subject=(z,)) for z in subject.model.coordinates)
    for name, joint in subject.joints():
        if subject.suffix == ".urdf":
            written = subject.numbers("axis@xyz")
            mine = {a: v for a, v in written.items() if a.startswith(f"joint[{name}]/axis@")}
        elif subject.suffix == ".sdf":
            written = subject.numbers("xyz")
            mine = {a: v for a, v in written.items() if a.startswith(f"joint[{name}]/axis/xyz[")}
        else:
            written = subject.numbers("joint@axis")
            mine = {a: v for a, v in written.items() if a.split("@")[0].endswith(f"joint[{name}]")}
        if len(mine) == 3 and any(mine.values()) and joint.identity == name:
            edit = Edit({address: -value for address, value in mine.items() if value})
            yield Mistake("axis flipped", name, edit, causes, audit_words="an axis is flipped")
