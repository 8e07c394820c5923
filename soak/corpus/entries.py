"""Every entry of the corpus by its name."""

from __future__ import annotations

from collections.abc import Iterable

from soak.corpus.arguments import argument_entries
from soak.corpus.baselines import baseline_entries
from soak.corpus.dependencies import dependency_entries
from soak.corpus.entry import CorpusEntry
from soak.corpus.frames import frame_entries
from soak.corpus.mjcf import mjcf_entries
from soak.corpus.new_and_compare import new_and_compare_entries
from soak.corpus.pytest_plugin import pytest_entries
from soak.corpus.results import result_entries
from soak.corpus.sidecars import sidecar_entries
from soak.corpus.spaces import space_entries
from soak.corpus.systems import system_entries
from soak.corpus.urdf import urdf_entries
from soak.corpus.verdicts import verdict_entries

SOURCES = (
    system_entries,
    sidecar_entries,
    mjcf_entries,
    urdf_entries,
    space_entries,
    result_entries,
    baseline_entries,
    argument_entries,
    new_and_compare_entries,
    verdict_entries,
    frame_entries,
    dependency_entries,
    pytest_entries,
)


def _by_name(entries: Iterable[CorpusEntry]) -> dict[str, CorpusEntry]:
    named: dict[str, CorpusEntry] = {}
    for entry in entries:
        if entry.name in named:
            raise ValueError(f"two entries are called {entry.name!r}")
        named[entry.name] = entry
    return named


ENTRIES = _by_name(entry for source in SOURCES for entry in source())
