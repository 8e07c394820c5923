"""Warnings of MuJoCo, collected instead of written to a log file in the working folder."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

MAX_WARNINGS = 20
"""The most warnings that are kept; each kind counts once."""

_TIME = re.compile(r"\s*Time = \S+$")


class Warnings:
    """Warnings as sentences, each kind once, in the order of arrival."""

    def __init__(self) -> None:
        self._kinds: dict[str, str] = {}

    def __call__(self, message: str) -> None:
        """Add a warning of MuJoCo."""
        sentence = " ".join(message.split())
        if len(self._kinds) < MAX_WARNINGS:
            self._kinds.setdefault(_TIME.sub("", sentence), sentence)

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds.values())

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Collect all warnings that MuJoCo gives in this block, its own and Python's."""
        import mujoco

        mujoco.set_mju_user_warning(self)
        try:
            # While it reads a file, MuJoCo uses Python's warnings, which a user may have made
            # errors.
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                yield
        finally:
            mujoco.set_mju_user_warning(None)
            for warning in caught:
                self(str(warning.message))
