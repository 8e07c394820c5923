"""The files that a run reads, for workers that have them not."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from physics_crosscheck.harness.modelfiles.parts import named_files


def luggage(places: Iterable[Path]) -> Iterator[Path]:
    """System folders and robots' files, and what models of theirs name outside of them.

    What `system.py` opens or imports from elsewhere is not known before it is run.
    """
    for place in places:
        yield place
        models = [one for one in place.iterdir() if one.is_file()] if place.is_dir() else [place]
        for model in models:
            with contextlib.suppress(OSError):  # its case says so
                yield from named_files(model)
