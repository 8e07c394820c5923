"""Pages of the message codes: short and complete."""

from __future__ import annotations

import re

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.codes import Code, codes
from physics_crosscheck.harness.results.messages import code_lines

LONGEST = 25
"""Words of a sentence."""


@pytest.mark.parametrize("code", codes().values(), ids=str)
def test_page_has_short_sentences(code: Code) -> None:
    for text in (code.title, code.cause, code.remedy):
        assert text.endswith((".", "`"))
        for sentence in re.split(r"(?<=[.:?!])\s", text):
            assert len(sentence.split()) <= LONGEST, sentence
    assert code.example.strip()


def test_explain_prints_a_page_by_code_or_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "xc104"]) == 0
    by_code = capsys.readouterr().out
    assert main(["explain", "inertia-without-mass"]) == 0
    assert by_code == capsys.readouterr().out
    assert by_code.startswith("XC104 inertia-without-mass: A link has inertia but no mass.\n")
    assert '<mass value="0.0"/>' in by_code


@pytest.mark.parametrize("width", [60, 80, 100])
def test_explained_page_fits_the_terminal(width: int) -> None:
    lines = "\n".join(part for code in codes().values() for part in code_lines(code, width))
    assert max(map(len, lines.splitlines())) <= width


def test_explain_suggests_the_closest_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "wrong-numbr", "XC104"]) == 2
    shown = capsys.readouterr()
    assert "did you mean wrong-number" in shown.err
    assert shown.out.startswith("XC104 ")


def test_explain_without_a_code_lists_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain"]) == 0
    words = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert [word for word in words if word in codes()] == list(codes())
