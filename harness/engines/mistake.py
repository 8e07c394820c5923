"""Typical mistakes of an engine's users, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class DefaultLeftOn:
    """An engine's default behaviour, left on.

    Attributes:
        name: of the mistake.
        setting, value: the adapter's setting that reproduces it.
        cause: the name that a diagnosis reports, as in `Model.corrective_settings`.
    """

    name: str
    setting: str
    value: object
    cause: str


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A value that a user must state because the engine's default differs, left out.

    Attributes:
        name: of the mistake.
        within: tag of the elements whose children state the value, as attributes.
        defaults: attribute, and setting of the adapter, -> the engine's default.
        cause: the name that a diagnosis reports, as in `Model.corrective_settings`.
    """

    name: str
    within: str
    defaults: Mapping[str, object]
    cause: str
