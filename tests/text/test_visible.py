"""Names show as they are to be read: none writes to a terminal, a log of GitHub's or a summary."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from harness.gate.text import _cell
from harness.text.github import Annotation, plain_line
from harness.text.markup import escape
from harness.text.visible import odd_name, visible

GITHUB = {"GITHUB_ACTIONS": "true"}


@pytest.mark.parametrize(("text", "shown"), [
    ("left arm", "left arm"),
    ("é\U0001f916", "é\U0001f916"),
    ("\x1b[31mred\x1b[0m", "\\x1b[31mred\\x1b[0m"),
    ("\x9b31m", "\\x9b31m"),
    ("a\nb\r\tc", "a\\nb\\r\\tc"),
    ("a\x00\x07\x7f", "a\\x00\\x07\\x7f"),
    ("\u2028\u2029\x85", "\\u2028\\u2029\\x85"),
    ("\u202eevil", "\\u202eevil"),
    ("\udcff", "\\udcff"),
])  # fmt: skip
def test_what_no_name_may_have_is_shown_as_an_escape(text: str, shown: str) -> None:
    assert visible(text) == shown
    assert (odd_name(text) is None) == (text == shown)


def test_in_a_table_of_a_terminal_neither_markup_nor_escapes_count() -> None:
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=200, highlight=False)
    console.print(escape("[bold]a[/] \x1b]0;title\x07\x1b[2J [link=http://evil]b\nnext"))
    assert file.getvalue() == ("[bold]a[/] \\x1b]0;title\\x07\\x1b[2J [link=http://evil]b\nnext\n")


@pytest.mark.parametrize(("line", "shown"), [
    ("::error::a", "| ::error::a"),
    ("  ::add-mask::a", "|   ::add-mask::a"),
    ("a ##[group]b", "a ## [group]b"),
    ("CHANGED a::b", "CHANGED a::b"),
])  # fmt: skip
def test_no_line_of_a_log_is_a_command_that_we_did_not_write(line: str, shown: str) -> None:
    assert plain_line(line, GITHUB) == shown
    assert plain_line(line, {}) == line


def test_an_annotation_is_one_command_whatever_it_tells(tmp_path: Path) -> None:
    evil = "a\n::error file=x::y\r,title=b\x1b[31m%0A::warning::z"
    note = Annotation(level="error", file=tmp_path / "m.xml", line=1, title=evil, message=evil)
    command = note.command(tmp_path)
    assert len(command.splitlines()) == 1
    assert command.isprintable()
    assert command.startswith("::error file=m.xml,line=1,title=a%0A%3A%3Aerror file=x")


def test_a_cell_of_a_summary_is_text(tmp_path: Path) -> None:
    said = _cell("[click](http://evil) <b> a|b `c`\n\x1b[31m")
    assert said == "[click]&#40;http://evil) &lt;b&gt; a\\|b &#96;c&#96; \\x1b[31m"
