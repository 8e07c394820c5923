"""What an engine does on its own, left on."""

from __future__ import annotations

from collections.abc import Iterator

from harness.mutation.mistakes.context import Subject
from harness.mutation.mistakes.mistake import Edit, Mistake
from harness.records.cause import CauseId

_DEFAULTS: dict[str, tuple[tuple[str, str, object, str], ...]] = {
    "pybullet": (
        ("PyBullet's damping left on", "link_damping", 0.04, "PyBullet's own damping of links"),
        ("PyBullet's motors left on", "motors", True, "PyBullet's own motors"),
        ("PyBullet's inertia flag forgotten", "inertia_from_file", False,
         "PyBullet's own inertias of collision shapes"),
    ),
    "pymunk": (("Space.damping left in", "damping", 0.9, "Space.damping"),),
}  # fmt: skip
"""By engine: what the user did, the setting that does it, its value, and the cause."""


def defaults(subject: Subject) -> Iterator[Mistake]:
    """Each that the model's settings don't ask for already."""
    stated = subject.task.sidecar.spec(subject.task.engine).settings
    for name, setting, value, cause in _DEFAULTS.get(subject.task.engine, ()):
        if stated.get(setting) != value:
            yield Mistake(
                name,
                f"settings.{setting}",
                Edit(settings={setting: value}),
                frozenset({CauseId(kind="default", subject=(cause,))}),
            )
