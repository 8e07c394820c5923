"""Hostile baselines for `run`, `gate` and `accept`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from soak.corpus.entry import BASELINE, GATE, Build, CorpusEntry, replace_text
from soak.corpus.mjcf import FILE as MJCF_FILE

RUN = ("run", "@hostile", "--out", "@out", *BASELINE)
ACCEPT = ("accept", "--folder", "@hostile", *BASELINE, "--reason", "as it is")
_refused = partial(CorpusEntry, codes=(2, 3))
_damaged = partial(_refused, before=(ACCEPT,), match=r"oscillator\.json")


def _edit_json(change: Callable[[Any], object]) -> Build:
    """Return a build that changes the baseline file and keeps it valid JSON."""

    def build(workspace: Path) -> None:
        path = workspace / "baseline" / "oscillator.json"
        table = json.loads(path.read_text("utf-8"))
        change(table)
        path.write_text(json.dumps(table), "utf-8")

    return build


def _edit_bytes(change: Callable[[bytes], bytes]) -> Build:
    def build(workspace: Path) -> None:
        path = workspace / "baseline" / "oscillator.json"
        path.write_bytes(change(path.read_bytes()))

    return build


def _replace_file(make: Callable[[Path], object]) -> Build:
    def build(workspace: Path) -> None:
        path = workspace / "baseline" / "oscillator.json"
        path.unlink()
        make(path)

    return build


FILES = {
    "nothing": _edit_bytes(lambda data: b""),
    "half of it": _edit_bytes(lambda data: data[: len(data) // 2]),
    "a merge's marks": _edit_bytes(lambda data: b"<<<<<<< HEAD\n" + data),
    "nested": _edit_bytes(lambda data: b"[" * 100_000),
    "UTF-16": _edit_bytes(lambda data: data.decode().encode("utf-16")),
    "half a character": _edit_bytes(lambda data: data.replace(b"as it is", b"\\ud800")),
    "a digit changed": _edit_bytes(lambda data: data.replace(b"0.1", b"0.2", 1)),
    "a folder": _replace_file(lambda path: path.mkdir()),
    "a link to itself": _replace_file(lambda path: path.symlink_to(path)),
    "a link to nothing": _replace_file(lambda path: path.symlink_to("/nothing/at/all")),
    "an unknown format": _edit_json(lambda t: t.update(format=99)),
    "a format of a text": _edit_json(lambda t: t.update(format="2")),
    "no cases": _edit_json(lambda t: t.pop("cases")),
    "cases that are none": _edit_json(lambda t: t.update(cases=None)),
    "an unknown outcome": _edit_json(lambda t: t["cases"][0].update(outcome="PASSES")),
    "a case that differs": _edit_json(lambda t: t["cases"][0].update(outcome="DIFFERS")),
    "a case of another engine": _edit_json(lambda t: t["cases"][0].update(engine="pybullet")),
    "a case without an engine": _edit_json(lambda t: t["cases"][0].pop("engine")),
    "a case of another scenario": _edit_json(lambda t: t["cases"][0].update(scenario="free")),
    "a case twice": _edit_json(lambda t: t["cases"].append(t["cases"][0])),
    "another system": _edit_json(lambda t: t["declared"].update(system="other")),
    "no snapshot": _edit_json(lambda t: t.update(snapshots={})),
    "a snapshot by another name": _edit_json(
        lambda t: t.update(snapshots=dict(zip("xyz", t["snapshots"].values(), strict=False)))
    ),
    "a reason of nan": _edit_json(lambda t: t["cases"][0].update(reason=float("nan"))),
}


def _swap_fields(table: str, *names: str) -> Build:
    """Return a build that swaps some fields between the first two entries of a table."""

    def change(whole: Any) -> None:
        first, second, *_ = whole[table]
        for name in names:
            first[name], second[name] = second[name], first[name]

    return _edit_json(change)


SWAPPED = {
    "entries swapped": _swap_fields("cases", "engine"),
    "entries with each other's seals": _swap_fields("cases", "seal"),
    "entries swapped but for their names": _edit_json(
        lambda t: t.update(cases=[
            {**other, "engine": one["engine"]} for one, other in zip(
                t["cases"], reversed(t["cases"]), strict=True)])
    ),
}  # fmt: skip
"""Swaps between the baseline entries of one model in two engines."""


def baseline_entries() -> Iterator[CorpusEntry]:
    """Yield the entries with hostile baselines."""
    for builds, model in ((FILES, MJCF_FILE), (SWAPPED, "robot.urdf")):
        for name, build in builds.items():
            for command in (GATE, RUN):
                title = f"baseline/{command[0]}, {name}"
                yield _damaged(title, build, model=model, command=command)
    for name, words in (("gate,", GATE), ("run,", RUN), ("accept into", ACCEPT)):
        title = f"baseline/{name} a file"
        yield _refused(title, _write_file_for_folder, command=words, match="baseline")
    broken = replace_text(MJCF_FILE, ("<worldbody>", "<worldbody"))
    yield _refused("baseline/accept what fails", broken, command=ACCEPT, match=r"mujoco\.xml")
    damaged = FILES["half of it"]
    yield _damaged("baseline/accept into what is damaged", damaged, command=ACCEPT)


def _write_file_for_folder(workspace: Path) -> None:
    (workspace / "baseline").write_text("no folder", "utf-8")
