"""Every entry of the corpus by its name."""

from __future__ import annotations

from collections.abc import Iterable

from soak.corpus.arguments import arguments
from soak.corpus.baselines import baselines
from soak.corpus.beyond import beyond
from soak.corpus.entry import Entry
from soak.corpus.files_of_new import files_of_new
from soak.corpus.frames import frames
from soak.corpus.mjcf import mjcf
from soak.corpus.pytests import pytests
from soak.corpus.results import results
from soak.corpus.sidecars import sidecars
from soak.corpus.spaces import spaces
from soak.corpus.systems import systems
from soak.corpus.urdf import urdf
from soak.corpus.verdicts import verdicts

ROOMS = (
    systems,
    sidecars,
    mjcf,
    urdf,
    spaces,
    results,
    baselines,
    arguments,
    files_of_new,
    verdicts,
    frames,
    beyond,
    pytests,
)


def _named(entries: Iterable[Entry]) -> dict[str, Entry]:
    found: dict[str, Entry] = {}
    for entry in entries:
        if entry.name in found:
            raise ValueError(f"two entries are called {entry.name!r}")
        found[entry.name] = entry
    return found


ENTRIES = _named(entry for room in ROOMS for entry in room())
