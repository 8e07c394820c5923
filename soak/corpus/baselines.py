"""Hostile baselines, met by `run`, `gate` and `accept`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from soak.corpus.entry import Build, Entry, both, replaced
from soak.corpus.mjcf import FILE as MJCF_FILE

_GATE = ("gate", "@hostile", "--baseline", "@baseline", "--out", "@og", "--jobs", "1")
_RUN = ("run", "@hostile", "--out", "@out", "--baseline", "@baseline", "--jobs", "1")
ACCEPT = ("accept", "--folder", "@hostile", "--baseline", "@baseline", "--jobs", "1",
          "--reason", "as it is")  # fmt: skip
_NAMED = r"oscillator\.json"


def _edited(change: Callable[[Any], object]) -> Build:
    """The baseline's file with a change that leaves it JSON."""

    def build(place: Path) -> None:
        path = place / "baseline" / "oscillator.json"
        table = json.loads(path.read_text("utf-8"))
        change(table)
        path.write_text(json.dumps(table), "utf-8")

    return build


def _bytes(change: Callable[[bytes], bytes]) -> Build:
    def build(place: Path) -> None:
        path = place / "baseline" / "oscillator.json"
        path.write_bytes(change(path.read_bytes()))

    return build


def _instead(make: Callable[[Path], object]) -> Build:
    def build(place: Path) -> None:
        path = place / "baseline" / "oscillator.json"
        path.unlink()
        make(path)

    return build


FILES = {
    "nothing": _bytes(lambda data: b""),
    "half of it": _bytes(lambda data: data[: len(data) // 2]),
    "a merge's marks": _bytes(lambda data: b"<<<<<<< HEAD\n" + data),
    "nested": _bytes(lambda data: b"[" * 100_000),
    "UTF-16": _bytes(lambda data: data.decode().encode("utf-16")),
    "half a character": _bytes(lambda data: data.replace(b"as it is", b"\\ud800")),
    "a digit changed": _bytes(lambda data: data.replace(b"0.1", b"0.2", 1)),
    "a folder": _instead(lambda path: path.mkdir()),
    "a link to itself": _instead(lambda path: path.symlink_to(path)),
    "a link to nothing": _instead(lambda path: path.symlink_to("/nothing/at/all")),
    "an unknown format": _edited(lambda t: t.update(format=99)),
    "a format of a text": _edited(lambda t: t.update(format="2")),
    "no cases": _edited(lambda t: t.pop("cases")),
    "cases that are none": _edited(lambda t: t.update(cases=None)),
    "an unknown outcome": _edited(lambda t: t["cases"][0].update(outcome="PASSES")),
    "a case that differs": _edited(lambda t: t["cases"][0].update(outcome="DIFFERS")),
    "a case of another engine": _edited(lambda t: t["cases"][0].update(engine="pybullet")),
    "a case without an engine": _edited(lambda t: t["cases"][0].pop("engine")),
    "a case of another scenario": _edited(lambda t: t["cases"][0].update(scenario="free")),
    "a case twice": _edited(lambda t: t["cases"].append(t["cases"][0])),
    "another system": _edited(lambda t: t["declared"].update(system="other")),
    "no snapshot": _edited(lambda t: t.update(snapshots={})),
    "a snapshot by another name": _edited(
        lambda t: t.update(snapshots=dict(zip("xyz", t["snapshots"].values(), strict=False)))
    ),
    "a reason of nan": _edited(lambda t: t["cases"][0].update(reason=float("nan"))),
}


def _swap(table: str, *names: str) -> Build:
    """Two entries with some fields of each other."""

    def change(whole: Any) -> None:
        one, other, *_ = whole[table]
        for name in names:
            one[name], other[name] = other[name], one[name]

    return _edited(change)


SWAPPED = {
    "entries swapped": _swap("cases", "engine"),
    "entries with each other's seals": _swap("cases", "seal"),
    "entries swapped but for their names": _edited(
        lambda t: t.update(cases=[
            {**other, "engine": one["engine"]} for one, other in zip(
                t["cases"], reversed(t["cases"]), strict=True)])
    ),
}  # fmt: skip
"""Of a model in two engines."""


def baselines() -> Iterator[Entry]:
    """Every entry of the format."""
    for name, build in FILES.items():
        for command in (_GATE, _RUN):
            yield Entry(name=f"baseline/{command[0]}, {name}", build=build, before=(ACCEPT,),
                        command=command, codes=(2, 3), says=_NAMED)  # fmt: skip
    for name, build in SWAPPED.items():
        for command in (_GATE, _RUN):
            yield Entry(name=f"baseline/{command[0]}, {name}", build=build, model="robot.urdf",
                        before=(ACCEPT,), command=command, codes=(2, 3), says=_NAMED)  # fmt: skip
    yield Entry(name="baseline/gate, a file", build=_a_file, command=_GATE, codes=(2, 3),
                says="baseline")  # fmt: skip
    yield Entry(name="baseline/run, a file", build=_a_file, command=_RUN, codes=(2, 3),
                says="baseline")  # fmt: skip
    yield Entry(name="baseline/accept into a file", build=_a_file, command=ACCEPT, codes=(2, 3),
                says="baseline")  # fmt: skip
    broken = replaced(MJCF_FILE, ("<worldbody>", "<worldbody"))
    yield Entry(name="baseline/accept what fails", build=broken, command=ACCEPT, codes=(2, 3),
                says=r"mujoco\.xml")  # fmt: skip
    yield Entry(name="baseline/accept into what is damaged", build=both(FILES["half of it"]),
                before=(ACCEPT,), command=ACCEPT, codes=(2, 3), says=_NAMED)  # fmt: skip


def _a_file(place: Path) -> None:
    (place / "baseline").write_text("no folder", "utf-8")
