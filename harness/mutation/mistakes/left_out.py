"""Omitted statements that prevent an engine default."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.engines.protocol import LeftOut
from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake
from physics_crosscheck.harness.records.cause import CauseId


def left_out(subject: Subject) -> Iterator[Mistake]:
    """Yield the omission of each such statement in the file or in the settings."""
    for usual in subject.engine.usual_mistakes:
        if isinstance(usual, LeftOut):
            yield from _left_out(subject, usual)


def _left_out(subject: Subject, usual: LeftOut) -> Iterator[Mistake]:
    causes = frozenset({CauseId(kind="default", subject=(usual.cause,))})
    for element in subject.elements:
        stated = [key for key in usual.defaults if key in element.attributes]
        if stated and element.parent is not None and element.parent.tag == usual.within:
            edit = Edit(attributes=tuple(Attribute(element.start, key, None) for key in stated))
            yield Mistake(usual.name, element.spelled(2), edit, causes)
    settings = subject.task.declared.spec(subject.task.engine).settings
    stated_settings = {key: value for key, value in usual.defaults.items() if key in settings}
    if stated_settings:
        yield Mistake(
            usual.name,
            f"settings.{next(iter(stated_settings))}",
            Edit(settings=stated_settings),
            causes,
        )
