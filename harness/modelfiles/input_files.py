"""The files that a run reads, for remote workers."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from .parts import named_files


def input_files(places: Iterable[Path]) -> Iterator[Path]:
    """Yield system folders and robots' files, and files outside of them that their models name.

    Files that `system.py` opens or imports from elsewhere are unknown before it runs.
    """
    for place in places:
        yield place
        models = [one for one in place.iterdir() if one.is_file()] if place.is_dir() else [place]
        for model in models:
            with contextlib.suppress(OSError):  # its case reports the error
                yield from named_files(model)
