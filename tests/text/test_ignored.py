"""Findings that a project ignores: they fail nothing, and are counted."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.results import ignored
from physics_crosscheck.harness.results.github import run_notes
from physics_crosscheck.harness.results.ignored import CodeFilter
from physics_crosscheck.records import Outcome, Results, SourceLine
from tests.records.made import case, cause, diagnosis, finding, model, results


def wrong(tmp_path: Path, comment: str = "") -> Results:
    """Return a case whose two causes explain it, and a finding on line 3 of its file."""
    (tmp_path / "mujoco.xml").write_text(f"<mujoco>\n{comment}\n<geom/>\n")
    line = SourceLine(file="mujoco.xml", line=3)
    where = {"folder": str(tmp_path)}
    both = diagnosis(cause("mass", locations=(line,)), cause("x", kind="axis", locations=(line,)))
    bad = model(finding(location=line), diagnosis=both, **where)
    return results(case(Outcome.DIFFERS, kind="motion", **where), models=(bad,))


@pytest.mark.parametrize(("given", "comment", "codes"), [
    ({"ignore": ("XC1", "XC2")}, "", "2 findings ignored: XC101, XC201"),
    ({"ignore": ("XC1", "XC301")}, "", "2 findings ignored: XC101, XC301"),
    ({"select": ("XC4",)}, "", "2 findings ignored: XC101, XC301"),
    ({}, "<!-- crosscheck: ignore XC101, XC201 XC208 -->", "2 findings ignored: XC101, XC201"),
])  # fmt: skip
def test_ignored_difference_passes_and_is_counted(
    tmp_path: Path, given: dict[str, tuple[str, ...]], comment: str, codes: str
) -> None:
    chosen = CodeFilter(**given)
    run = chosen.results(wrong(tmp_path, comment))
    assert (exit_code(run, False), run_notes(run), chosen.lines()) == (0, [], [codes])


def test_comments_of_a_file_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = list[Path]()

    def read(path: Path) -> bytes:
        opened.append(path)
        return b"\n" * 9

    monkeypatch.setattr(ignored, "read_regular", read)
    findings = [finding(location=SourceLine(file="a.xml", line=line)) for line in range(1, 9)]
    assert CodeFilter().reported(findings, str(tmp_path)) == findings
    assert len(opened) == 1


@pytest.mark.parametrize("given", [{"ignore": ("XC201",)}, {"ignore": ("XC1",)}, {}])
def test_other_difference_stays(tmp_path: Path, given: dict[str, tuple[str, ...]]) -> None:
    """Find a pair of causes that counts as ignored by one of them."""
    assert exit_code(CodeFilter(**given).results(wrong(tmp_path)), False) == 1


def test_failed_run_and_refused_file_are_never_ignored() -> None:
    failed = results(case(Outcome.FAILED, reason="it died"), case(Outcome.REFUSED))
    assert CodeFilter(select=("XC1",)).results(failed) == failed


def test_concise_line_has_file_line_code_and_message(tmp_path: Path) -> None:
    first, second = (note.concise for note in run_notes(wrong(tmp_path)))
    assert first.startswith(f"{tmp_path}/mujoco.xml:3: XC201 ")
    assert second == f"{tmp_path}/mujoco.xml:3: XC101 is wrong"
