"""Engine defaults left switched on."""

from __future__ import annotations

from collections.abc import Iterator

from physics_crosscheck.harness.engines.protocol import DefaultLeftOn
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake
from physics_crosscheck.harness.records.cause import CauseId


def defaults(subject: Subject) -> Iterator[Mistake]:
    """Yield each default that the model's settings do not already request."""
    stated = subject.task.declared.spec(subject.task.engine).settings
    for usual in subject.engine.usual_mistakes:
        if isinstance(usual, DefaultLeftOn) and stated.get(usual.setting) != usual.value:
            yield Mistake(
                usual.name,
                f"settings.{usual.setting}",
                Edit(settings={usual.setting: usual.value}),
                frozenset({CauseId(kind="default", subject=(usual.cause,))}),
            )
