"""What MuJoCo warns of: kept, and not written to a log file in the working folder."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

MOST = 20
"""Warnings that are kept, each kind once."""

_TIME = re.compile(r"\s*Time = \S+$")


class Warnings:
    """Sentences, each kind of them once, in the order in which they came."""

    def __init__(self) -> None:
        self._kinds: dict[str, str] = {}

    def __call__(self, message: str) -> None:
        """Take one from MuJoCo."""
        sentence = " ".join(message.split())
        if len(self._kinds) < MOST:
            self._kinds.setdefault(_TIME.sub("", sentence), sentence)

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds.values())

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Take all that MuJoCo warns of meanwhile, in its own way or in Python's."""
        import mujoco

        mujoco.set_mju_user_warning(self)
        try:
            # As it reads a file it warns in Python's: an error where a user has made them errors.
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                yield
        finally:
            mujoco.set_mju_user_warning(None)
            for one in told:
                self(str(one.message))
