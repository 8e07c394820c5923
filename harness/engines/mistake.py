"""Mistakes that the users of one engine make, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class DefaultLeftOn:
    """What an engine does unless told, left on.

    Attributes:
        name: what the user did.
        setting, value: the adapter's setting that does it.
        cause: what a diagnosis calls it, as in `Model.remedies`.
    """

    name: str
    setting: str
    value: object
    cause: str


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """What a user must state lest the engine takes a value of its own, left out.

    Attributes:
        name: what the user did.
        within: tag of the elements whose children state it, as attributes.
        defaults: attribute, and setting of the adapter, -> the engine's own value.
        cause: what a diagnosis calls it, as in `Model.remedies`.
    """

    name: str
    within: str
    defaults: Mapping[str, object]
    cause: str
