"""Hostile names are escaped in terminals, logs of GitHub and summaries."""

import io
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TextIO, cast

import pytest
from rich.console import Console

from physics_crosscheck.harness.commands.gate.text import _cell, _code
from physics_crosscheck.harness.interfaces.cli import main as cli
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.terminal.console import escape
from physics_crosscheck.harness.render.terminal.table import print_results
from physics_crosscheck.harness.results.failure import failure_message
from physics_crosscheck.harness.results.github import (
    Annotation,
    LogStream,
    commands,
    harmless_json,
    plain_logs,
    run_notes,
)
from physics_crosscheck.harness.results.sarif import sarif
from physics_crosscheck.harness.results.status import Decision, TestStatus
from physics_crosscheck.harness.results.visible import odd_name, visible
from physics_crosscheck.records import Cause, Diagnosis, Explanation, Outcome, Results, SourceLine
from tests.records.made import case, finding, model, results


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
def test_forbidden_characters_are_escaped(text: str, shown: str) -> None:
    assert visible(text) == shown
    assert (odd_name(text) is None) == (text == shown)


def test_terminal_table_ignores_markup_and_escapes() -> None:
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=200, highlight=False)
    console.print(escape("[bold]a[/] \x1b]0;title\x07\x1b[2J [link=http://evil]b\nnext"))
    assert file.getvalue() == ("[bold]a[/] \\x1b]0;title\\x07\\x1b[2J [link=http://evil]b\nnext\n")


def test_annotation_is_one_command(tmp_path: Path) -> None:
    evil = "a\n::error file=x::y\r,title=b\x1b[31m%0A::warning::z"
    note = Annotation(level="error", file=tmp_path / "m.xml", line=1, title=evil, message=evil)
    command = note.command(tmp_path)
    assert len(command.splitlines()) == 1
    assert command.isprintable()
    assert command.startswith("::error file=m.xml,line=1,title=a%0A%3A%3Aerror file=x")


def test_cell_of_summary_is_plain_text(tmp_path: Path) -> None:
    cell = _cell("[click](http://evil) <b> a|b `c`\n\x1b[31m @you #12 *a* my_name _b_ &lt;")
    assert cell == (
        "&#91;click&#93;(http<!-- -->://evil) &#60;b&#62; a&#124;b &#96;c&#96; &#92;x1b&#91;31m"
        " @<!-- -->you &#35;<!-- -->12 &#42;a&#42; my_name &#95;b&#95; &amp;lt;"
    )
    assert _code("a`b``c\n|") == "``` a`b``c | ```"


@pytest.mark.parametrize(("parts", "shown"), [
    (["::error::a\n"], "| ::error::a\n"),
    ([":", ":err", "or::a\nb"], "| ::error::a\nb"),
    (["x ##", "[group]y\n"], "x ## [group]y\n"),
    (["safe\r::error::a\n"], "safe\r| ::error::a\n"),
    (["why? ", "::no\n", "  ::error::a\n"], "why? ::no\n|   ::error::a\n"),
    (["CHANGED a::b\n", "  ::add-mask::a\n"], "CHANGED a::b\n|   ::add-mask::a\n"),
])  # fmt: skip
def test_partial_log_writes_form_no_commands(parts: list[str], shown: str) -> None:
    inner = io.StringIO()
    log = LogStream(inner)
    for part in parts:
        log.write(part)
        log.flush()
    log.end()
    assert inner.getvalue() == shown


HOSTILE = (
    "::error file=x::pwned ##[error]a %0A [red]b[/red] <img src=x onerror=alert(1)> | `c`"
    " ![i](http://evil) *d* @you #12 {0} \x9b31m \u202e \"q\" 'r'"
)
"""A name with characters that each format must escape."""


def _hostile_results(folder: Path) -> Results:
    """Return a differing case and a finding with a hostile robot, file and body name."""
    file = folder / "a b#[%41].urdf"
    text = "<robot>\n<mass value='3.3'/></robot>"
    file.write_text(text)
    where = SourceLine(file=str(file), line=2, span=(21, 24), text="3.3")
    wrong = finding(
        f"{HOSTILE} is 3.3 where m = 3.6", subject=(HOSTILE,), location=where, expected=3.6,
        actual=3.3, replacement="3.6",
    )  # fmt: skip
    cause = Cause(
        kind="literal", subject=(HOSTILE,), nominal=3.3, estimate=3.6, standard_error=1e-12,
        locations=(where,),
    )  # fmt: skip
    diagnosis = Diagnosis(
        explained=True, explanations=(Explanation(causes=(cause,), remaining=0.0),)
    )
    names = {"system": HOSTILE, "model": file.name, "folder": str(folder)}
    differs = case(Outcome.DIFFERS, reason=f"{HOSTILE} is off", scenario=HOSTILE, **names)
    failed = case(Outcome.FAILED, reason=f"{HOSTILE}", engine="drake", **names)
    model_ = model(wrong, text=text, diagnosis=diagnosis, **names)
    return results(differs, failed, models=(model_,))


def _terminal(seen: Results) -> str:
    out = io.StringIO()
    log = LogStream(out)
    print_results(Console(file=cast(TextIO, log), width=160, highlight=False), seen)
    log.end()
    return out.getvalue()


def _pytest(seen: Results) -> str:
    (checked_model,) = seen.models
    decision = Decision(TestStatus.FAIL, seen.cases[0].reason)
    messages = [
        failure_message(seen.cases[0], decision, checked_model.diagnosis),
        failure_message(checked_model, decision),
    ]
    return "\n".join(messages)


def _commands(seen: Results) -> str:
    return "\n".join(commands(run_notes(seen), {"GITHUB_ACTIONS": "true"}))


@pytest.mark.parametrize("form", [_terminal, _pytest, _commands])
def test_hostile_name_is_printed_without_commands_or_escapes(
    form: Callable[[Results], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    text = form(_hostile_results(tmp_path))
    assert "pwned" in text
    assert "##[" not in text
    assert not set(text) & {"\x9b", "\x1b", "\u202e", "\r"}
    for line in text.split("\n"):
        assert not line.lstrip().startswith("::") or line.startswith(
            "::error file=a b#[%2541].urdf"
        )
    if form is _terminal:
        assert "[red]b[/red]" in text


def test_hostile_name_is_text_in_report_and_sarif(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    seen = _hostile_results(tmp_path)
    write_report(tmp_path / "index.html", seen)
    assert "<img src=x" not in (tmp_path / "index.html").read_text()
    log = harmless_json(sarif(seen))
    assert "##[" not in log
    for result in json.loads(log)["runs"][0]["results"]:
        text = result["message"]["text"]
        assert "](" not in text
        assert "{{0}}" in text
        assert "\x9b" not in text
        place = result["locations"][0]["physicalLocation"]["artifactLocation"]
        assert place == {"uri": "a%20b%23%5B%2541%5D.urdf"}


def test_run_on_github_prints_no_command_from_robot_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    moments = 'ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"'
    link = f'<link name="{{}}"><inertial><mass value="1"/><inertia {moments}/></inertial>'
    Path("r.urdf").write_text(
        '<robot name="::error::pwned ##[error]x">'
        + f"{link.format('a')}</link>{link.format('::error::b')}</link>"
        + '<joint name="::error::j" type="continuous"><parent link="a"/><child link="::error::b"/>'
        + '<axis xyz="0 1 0"/></joint></robot>'
    )
    assert cli.main(["run", "r.urdf", "--engine", "mujoco", "--details"]) == 0
    output = capsys.readouterr()
    assert "::error::pwned" in output.out
    for line in (output.out + output.err).splitlines():
        assert not line.lstrip().startswith("::")
        assert "##[" not in line


def test_regular_files_are_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catch a command in a file that a later step prints."""
    with (tmp_path / "log").open("w+") as file:
        monkeypatch.setattr(sys, "stdout", file)
        with plain_logs():
            print("::error::x")
        file.seek(0)
        assert file.read() == "| ::error::x\n"
