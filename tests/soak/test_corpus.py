"""A part of the corpus: fast entries, with many folders per run."""

from __future__ import annotations

from pathlib import Path

import pytest

from soak.corpus.__main__ import chunks, table
from soak.corpus.entries import ENTRIES
from soak.corpus.entry import RUN, CorpusEntry
from soak.corpus.judge import EntryResult, judge, judge_separately

SLOW_TO_REFUSE = ("tower of powers", "more jobs", "a folder twice")
"""Entries that take long or run a model."""

COMMANDS = [
    entry
    for entry in ENTRIES.values()
    if entry.name.startswith(("arguments/", "report/"))
    and not any(words in entry.name for words in SLOW_TO_REFUSE)
]
FOLDERS = [
    entry
    for entry in ENTRIES.values()
    if entry.batched and entry.name.startswith(("system.py/", "sidecar/", "mjcf/", "frames/"))
][::24]


def wrong(judged: list[EntryResult]) -> list[str]:
    return [
        f"{one.name}: {'; '.join(one.wrong)}: {one.printed[:200]}" for one in judged if one.wrong
    ]


def test_corpus_covers_every_format_and_command() -> None:
    assert len(ENTRIES) > 1000
    assert len(COMMANDS) + len(FOLDERS) > 140
    formats = {name.split("/")[0] for name in ENTRIES}
    assert formats == {
        "system.py", "sidecar", "mjcf", "urdf", "space.py", "report", "baseline", "arguments",
        "new", "compare", "derive", "audit", "gate", "mutate", "wrong", "right", "frames",
        "absent", "pytest",
    }  # fmt: skip


def test_judging_in_a_checkout_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".git").mkdir()
    (tmp_path / "mine").write_text("")
    with pytest.raises(RuntimeError, match="is a checkout"):
        judge_separately(COMMANDS[0])
    assert (tmp_path / "mine").is_file()


@pytest.mark.slow
def test_commands_reject_invalid_arguments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert not wrong([judge_separately(entry) for entry in COMMANDS])


@pytest.mark.slow
def test_hostile_folders_fail_alone_and_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert not wrong(list(judge(FOLDERS)))


def test_slow_entries_have_separate_processes() -> None:
    def entry(name: str, **fields: object) -> CorpusEntry:
        return CorpusEntry(name=name, build=lambda folder: None, **fields)  # type: ignore[arg-type]

    some = [entry("a"), entry("b", slow=True), entry("c", command=("derive",)), entry("d")]
    assert [[one.name for one in chunk] for chunk in chunks(some, 2)] == [["c"], ["a", "d"], ["b"]]
    assert entry("a").command == RUN


def test_wrong_entry_is_counted() -> None:
    some = [
        EntryResult(name=name, code=3, printed="", seconds=0.1, wrong=wrong)
        for name, wrong in (("urdf/a", ()), ("urdf/b", ("a traceback is printed",)))
    ]
    assert table(some).splitlines()[1].split() == ["urdf", "2", "1"]
