"""Hostile `results.json` files for `report`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from soak.corpus.entry import Build, CorpusEntry, write_file

_COMMAND = ("report", "@hostile/results.json", "--out", "@out")
_entry = partial(CorpusEntry, command=_COMMAND, codes=(2,), match=r"results\.json")


def _example_results() -> Any:
    """Return results with every field of the records."""
    from physics_crosscheck.harness.records.results import Results
    from tests.records.examples import example

    return example(Results)


def _change_value(*path: str | int, value: object) -> Build:
    """Return a build that writes the example results with one value replaced."""

    def build(workspace: Path) -> None:
        whole = _example_results()
        parent = whole
        for part in path[:-1]:
            parent = parent[part]
        parent[path[-1]] = value
        (workspace / "hostile" / "results.json").write_text(json.dumps(whole), "utf-8")

    return build


TEXTS = {
    "nothing": b"",
    "no JSON": b"{",
    "null": b"null",
    "a number": b"1",
    "a list": b"[]",
    "nested 100000 deep": b"[" * 100_000,
    "objects nested 100000 deep": b'{"a":' * 100_000,
    "cases nested 100000 deep": b'{"schema": 2, "cases": ' + b"[" * 100_000,
    "another schema": b'{"schema": 99}',
    "a schema of 5000 digits": b'{"schema": ' + b"9" * 5000 + b"}",
    "a schema that is a text": b'{"schema": "1"}',
    "a schema alone": b'{"schema": 2}',
    "a mark of byte order": b'\xef\xbb\xbf{"schema": 2}',
    "UTF-16": '{"schema": 2}'.encode("utf-16"),
    "no UTF-8": b'{"schema": 2, "created": "\xff"}',
    "half a character": b'{"schema": 2, "created": "\\ud800"}',
    "a number of 5000 digits": b'{"schema": 2, "seconds": ' + b"9" * 5000 + b"}",
    "nan": b'{"schema": 2, "seconds": NaN}',
    "zeros": bytes(4096),
    "noise": bytes(range(256)) * 16,
    "two of them": b'{"schema": 2}{"schema": 2}',
    "a key twice": b'{"schema": 2, "schema": 2}',
}

VALUES: dict[str, tuple[tuple[str | int, ...], object]] = {
    "cases null": (("cases",), None),
    "cases a text": (("cases",), "none"),
    "an unknown outcome": (("cases", 0, "outcome"), "PASSES"),
    "an outcome that is null": (("cases", 0, "outcome"), None),
    "a system that is a list": (("systems", 0), []),
    "an unknown field": (("cases", 0, "colour"), "red"),
    "series of other lengths": (("cases", 0, "series", "t"), [0.0, 1.0, 2.0]),
    "a sketch that is code": (("systems", 0, "sketch", "shapes", 0, "radius"), ["exec", 1.0]),
    "rungs of 400 digits": (("cases", 0, "verdict", "steps"), 10**400),
    "seconds of 1e999": (("seconds",), 1e308 * 10),
}

MARKUP = "</script><script>open('PWNED')</script>{{ 7 * 7 }}{% for %}<!-- \u202e \x00 \x1b[2J"


def result_entries() -> Iterator[CorpusEntry]:
    """Yield the entries of `report`."""
    for name, data in TEXTS.items():
        yield _entry(f"report/{name}", write_file("results.json", data))
    for name, (path, value) in VALUES.items():
        yield _entry(f"report/{name}", _change_value(*path, value=value))
    for path in (("created",), ("cases", 0, "reason"), ("cases", 0, "stdout"),
                 ("systems", 0, "title"), ("models", 0, "text"),
                 ("models", 0, "sidecar")):  # fmt: skip
        build = _change_value(*path, value=MARKUP)
        where = ".".join(map(str, path))
        yield _entry(f"report/markup in {where}", build, codes=(0, 2), match="")
    for name, build in _ODD.items():
        yield _entry(f"report/{name}", build, codes=(2, 3))
    command = ("report", "@hostile/results.json", "--out", "@hostile/system.py")
    yield CorpusEntry(
        "report/an out folder that is a file", _write_example, command=command, codes=(2, 3)
    )


def _write_example(workspace: Path) -> None:
    (workspace / "hostile" / "results.json").write_text(json.dumps(_example_results()), "utf-8")


_ODD: dict[str, Build] = {
    "a folder": lambda workspace: (workspace / "hostile" / "results.json").mkdir(),
    "not there": lambda workspace: None,
    "a link to itself": lambda workspace: (workspace / "hostile" / "results.json").symlink_to(
        workspace / "hostile" / "results.json"
    ),
}
