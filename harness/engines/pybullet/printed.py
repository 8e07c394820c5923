"""PyBullet's printed output: it explains load errors only on the C library's stdout."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from physics_crosscheck.harness.engines.captured import capture_output

_PLACE = re.compile(r"b3(Warning|Error|Printf)\[[^\]]*\]:\s*")


@contextmanager
def collect_printed_errors() -> Iterator[list[str]]:
    """Yield a list that holds the printed errors as sentences after the block ends.

    The output is printed again afterwards.
    """
    messages: list[str] = []
    texts: list[str] = []
    try:
        with capture_output() as texts:
            yield messages
    finally:
        messages += _errors("".join(texts))


def _errors(text: str) -> list[str]:
    """Join the errors at the end into one sentence; each part follows b3Error.

    Their places in PyBullet's sources are left out, since they do not help the user.
    """
    parts = [" ".join(part.split()) for part in _PLACE.split(text)[2::2] if part.strip()]
    kinds = _PLACE.findall(text)
    errors = [part for kind, part in zip(kinds, parts, strict=False) if kind == "Error"]
    return ["; ".join(errors)] if errors else []
