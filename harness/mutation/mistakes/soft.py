"""Equalities as soft as MuJoCo makes them unless told."""

from __future__ import annotations

from collections.abc import Iterator

from harness.files.locations.attributes import Attribute
from harness.mutation.mistakes.context import Subject
from harness.mutation.mistakes.mistake import Edit, Mistake
from harness.records.cause import CauseId

DEFAULTS: dict[str, list[float]] = {"solref": [0.02, 1.0], "solimp": [0.9, 0.95, 0.001, 0.5, 2.0]}


def soft(subject: Subject) -> Iterator[Mistake]:
    """Stated stiffness of equalities left out, in the file or in the settings."""
    if subject.task.engine != "mujoco":
        return
    causes = frozenset({CauseId(kind="default", subject=("soft equality (solref, solimp)",))})
    for element in subject.elements:
        stated = [key for key in DEFAULTS if key in element.attributes]
        if stated and element.parent is not None and element.parent.tag == "equality":
            edit = Edit(attributes=tuple(Attribute(element.start, key, None) for key in stated))
            yield Mistake("soft equality, solref left out", element.spelled(2), edit, causes)
    set_here = set(subject.task.sidecar.spec("mujoco").settings) & set(DEFAULTS)
    if set_here:
        edit = Edit(settings={key: DEFAULTS[key] for key in set_here})
        yield Mistake("soft equality, solref left out", "settings.solref", edit, causes)
