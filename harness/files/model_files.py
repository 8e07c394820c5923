"""The model files of a system folder, each with its sidecar."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.engines.registry import model_formats, readers
from harness.files.sidecar import Sidecar, SidecarError, read_sidecar


@dataclass(frozen=True, kw_only=True)
class UnreadModel:
    """A model file that can't be run for its sidecar.

    Attributes:
        model: its name; `-` where the folder has none.
        reason: one sentence.
    """

    model: str
    reason: str


def model_files(folder: Path) -> Iterator[Sidecar | UnreadModel]:
    """Every model file's sidecar; an `UnreadModel` for one that can't be read or has none."""
    described = set()
    for path in sorted(folder.glob("*.toml")):
        described.add(path.with_suffix("").name)
        try:
            yield read_sidecar(path)
        except SidecarError as error:
            yield UnreadModel(model=path.with_suffix("").name, reason=str(error))
    formats = model_formats()
    for path in sorted(folder.iterdir()):
        if path.suffix in formats and path.name not in described:
            reason = (
                f"{path}: this model file has no sidecar; write {path.name}.toml with at least"
                f" engines = {json.dumps([e.name for e in readers(path.suffix)])}"
                " (or the engines meant)"
            )
            yield UnreadModel(model=path.name, reason=reason)
    if not described:
        reason = f"{folder}: it has no model file with a sidecar, so nothing was run"
        yield UnreadModel(model="-", reason=reason)


def chosen_engines(sidecar: Sidecar, only: Sequence[str]) -> list[str]:
    """The engines that a sidecar names, of those that are wanted; `only` empty: all."""
    return [name for name in sidecar.engines if not only or name in only]
