"""Malformed results files: each is rejected in one sentence, without a traceback."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.records import Results, ResultsError, read_results
from tests.records.examples import example, paths, replaced, required, value_at

EXAMPLE: dict[str, Any] = example(Results)
TEXT = json.dumps(EXAMPLE)
DEEP = "[" * 5000 + "]" * 5000


def raw(path: tuple[str | int, ...], text: str) -> str:
    """Return the example with raw text in place of a value."""
    return json.dumps(replaced(EXAMPLE, path, "HERE")).replace('"HERE"', text)


def truncated() -> Iterator[tuple[str, str]]:
    for i in range(40):
        yield f"cut after {i}/40", TEXT[: i * len(TEXT) // 40]


def wrong_types() -> Iterator[tuple[str, str]]:
    for path in paths(EXAMPLE):
        value = value_at(EXAMPLE, path)
        wrong: Any = "x" if isinstance(value, (bool, int, float)) else 7
        yield f"{path} is {wrong!r}", json.dumps(replaced(EXAMPLE, path, wrong))
        if isinstance(value, (list, dict)):
            turned: Any = [value] if isinstance(value, dict) else {"a": value}
            yield f"{path} is turned", json.dumps(replaced(EXAMPLE, path, turned))


def missing_keys() -> Iterator[tuple[str, str]]:
    for path in required(msgspec.inspect.type_info(Results)):
        parent = dict(value_at(EXAMPLE, path[:-1]))
        del parent[str(path[-1])]
        yield f"{path} is missing", json.dumps(replaced(EXAMPLE, path[:-1], parent))


def extra_keys() -> Iterator[tuple[str, str]]:
    for path in paths(EXAMPLE):
        value = value_at(EXAMPLE, path)
        if isinstance(value, dict) and value.keys() != {"a"}:
            more = json.dumps(replaced(EXAMPLE, path, {**value, "surprise": 1}))
            yield f"{path} has more", more


def numbers() -> Iterator[tuple[str, str]]:
    places: list[tuple[str | int, ...]] = [
        ("seconds",),
        ("cases", 0, "verdict", "discrepancy"),
        ("cases", 0, "series", "t", 0),
        ("systems", 0, "derivation", "linearizations", 0, "matrices", "a", 0, 0),
    ]
    for path in places:
        for text in ("NaN", "Infinity", "-Infinity", "1e999", "1" + "0" * 400, "0x10", "01", DEEP):
            yield f"{path} is {text[:12]}", raw(path, text)
    for text in ("1" + "0" * 400, "1.5", "true", "-1e400"):
        yield f"steps is {text[:12]}", raw(("cases", 0, "verdict", "steps"), text)


def twice() -> Iterator[tuple[str, str]]:
    for key in ("created", "cases", "verdict", "pose", "held"):
        yield f"{key} twice", TEXT.replace(f'"{key}":', f'"{key}": null, "{key}":', 1)
        value = json.dumps(next(value_at(EXAMPLE, p) for p in paths(EXAMPLE) if p and p[-1] == key))
        yield f"{key} twice alike", TEXT.replace(f'"{key}":', f'"{key}": {value}, "{key}":', 1)


def other_files() -> Iterator[tuple[str, str]]:
    for schema in (0, 1, 2, 99, -1, "2", None, 1.5, [1]):
        yield f"schema {schema}", json.dumps(EXAMPLE | {"schema": schema})
    for text in ("", " ", "null", "1", '"results"', "[]", "{}", "[{}]", TEXT + TEXT, TEXT + "x"):
        yield f"text {text[:12]!r}", text
    yield "deep", DEEP
    yield "deep cases", '{"schema": 5, "cases": ' + DEEP + "}"
    yield "another record", '{"schema": 5, "summary": "", "rows": []}'


def unequal() -> Iterator[tuple[str, str]]:
    """Yield examples with columns of unequal length in a table, all keys being right."""
    case: tuple[str | int, ...] = ("cases", 0, "series")
    for path in (
        (*case, "t"),
        (*case, "components"),
        (*case, "reference"),
        (*case, "error", 0),
        (*case, "defect", 0),
        (*case, "segment_t"),
        (*case, "energy", "supplied"),
        (*case, "full_runs", "error"),
        (*case, "convergence", "rungs"),
        ("models", 0, "linearizations", 0, "frequencies"),
    ):
        value = value_at(EXAMPLE, path)
        yield f"{path} is longer", json.dumps(replaced(EXAMPLE, path, [*value, value[0]]))


def sketches() -> Iterator[tuple[str, str]]:
    for tree in (["exec", 1.0], ["q", 1], ["q", -1], ["^", 1.0], [], [1.0], True, None, [[0.5]]):
        path = ("systems", 0, "sketch", "shapes", 0, "radius")
        yield f"sketch {tree}", json.dumps(replaced(EXAMPLE, path, tree))
    shape = ("systems", 0, "sketch", "shapes", 0)
    yield "sketch nested", raw((*shape, "end"), '["sin", ' * 900 + "0" + "]" * 900)
    yield "sketch without a place", json.dumps(replaced(EXAMPLE, (*shape, "center"), [0.5]))


def texts() -> dict[str, str]:
    kinds = (
        truncated, wrong_types, missing_keys, extra_keys, numbers, twice, other_files, unequal,
        sketches,
    )  # fmt: skip
    return {name: text for some in kinds for name, text in some()}


BYTES = {
    "no UTF-8": TEXT.encode().replace(b'"created": "a"', b'"created": "\xff"'),
    "overlong UTF-8": TEXT.encode().replace(b'"created": "a"', b'"created": "\xc0\xaf"'),
    "half a surrogate": TEXT.encode().replace(b'"created": "a"', b'"created": "\xed\xa0\x80"'),
    "half an escape": TEXT.encode().replace(b'"created": "a"', rb'"created": "\ud800"'),
    "UTF-16": TEXT.encode("utf-16"),
    "a mark first": b"\xef\xbb\xbf" + TEXT.encode(),
    "zeros": bytes(1000),
    "noise": bytes(range(256)),
}  # fmt: skip


def test_unmodified_example_is_read(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(TEXT)
    assert read_results(path).cases[0].verdict is not None


@pytest.mark.slow
def test_malformed_file_is_rejected_in_one_sentence_with_its_path(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "results.json"
    wrong, files = [], {name: text.encode() for name, text in texts().items()} | BYTES
    assert len(files) > 600
    for name, data in files.items():
        path.write_bytes(data)
        try:
            read_results(path)
            message = "read"
        except ResultsError as error:
            message = str(error)
        if "\n" in message or str(path) not in message or len(message) > 400:
            wrong.append((name, message[:300]))
    assert not wrong
    assert main(["report", str(path)]) == 2
    assert capsys.readouterr().err == f"crosscheck: {message}\n"
    assert not (tmp_path / "index.html").exists()


def test_path_that_is_not_a_file_is_rejected(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    for path in (tmp_path, *(tmp_path / name for name in ("none.json", "pipe", "loop"))):
        with pytest.raises(ResultsError, match="can't be read") as refused:
            read_results(path)
        assert str(path) in str(refused.value)
