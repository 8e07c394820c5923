"""What PyBullet prints: it says why it can't load a file on the C library's stdout alone."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from physics_crosscheck.harness.engines.captured import captured

_PLACE = re.compile(r"b3(Warning|Error|Printf)\[[^\]]*\]:\s*")


@contextmanager
def printed() -> Iterator[list[str]]:
    """A list that holds, once it is over, what was printed: a sentence each, on one line.

    It is printed again afterwards, for those who read it there.
    """
    said: list[str] = []
    texts: list[str] = []
    try:
        with captured() as texts:
            yield said
    finally:
        said += _errors("".join(texts))


def _errors(text: str) -> list[str]:
    """The errors that follow one another at the end are one sentence, its parts each after b3Error.

    Their places in PyBullet's sources say nothing to those who wrote the file.
    """
    parts = [" ".join(part.split()) for part in _PLACE.split(text)[2::2] if part.strip()]
    kinds = _PLACE.findall(text)
    errors = [part for kind, part in zip(kinds, parts, strict=False) if kind == "Error"]
    return ["; ".join(errors)] if errors else []
