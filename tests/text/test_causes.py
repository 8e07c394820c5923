"""Explanations in sentences, pages of message codes, and changes of two results."""

import re
from typing import Any

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.baseline.diff import diff_cases
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.cause import CauseKind
from physics_crosscheck.harness.records.codes import Code, codes
from physics_crosscheck.harness.records.diff import Diff, numbers_of
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.harness.results.messages import code_lines
from physics_crosscheck.records import Cause, CauseId, Explanation, Outcome, SourceLine
from tests.records.made import case, full_run


def cause(
    kind: CauseKind,
    *subject: str,
    nominal: Number = 1.0,
    estimate: Number = 2.0,
    error: Number = 1e-6,
    lines: tuple[int, ...] = (),
) -> Cause:
    return Cause(
        kind=kind,
        subject=subject,
        nominal=nominal,
        estimate=estimate,
        standard_error=error,
        locations=tuple(SourceLine(file="robot.urdf", line=line) for line in lines),
    )


def sentences(*causes: Cause, tied: tuple[CauseId, ...] = ()) -> list[str]:
    return cause_sentences(Explanation(causes=causes, remaining=2.5e-7, tied_with=tied))


@pytest.mark.parametrize(
    ("explained", "sentence"),
    [
        (cause("literal", "joint[x]@stiffness", nominal=47.47, estimate=47.0000001, lines=(7,)),
         "joint[x]@stiffness (robot.urdf:7) is 47.47; the motion implies 47 ± 1e-06"),
        (cause("literals", "a@ixx", "a@iyy", lines=(3, 4)),
         "a@ixx, a@iyy (robot.urdf:3, robot.urdf:4) is 1; the motion implies 2 ± 1e-06"),
        (cause("unbound literal", "joint[x]@armature", nominal=0.01, estimate=-1e-9, error=1e-8),
         "joint[x]@armature is 0.01; the motion implies 0 ± 1e-08"),
        (cause("gravity", "z", nominal=-9.81, estimate=-9.8),
         "gravity along z is -9.81; the motion implies -9.8 ± 1e-06"),
        (cause("axis", "theta"), "axis of theta reversed explains the motion"),
        (cause("exchange", "k1", "k2"), "k1, k2 exchanged explains the motion"),
        (cause("default", "Space.damping"), "Space.damping explains the motion"),
        (cause("constant", "m", estimate=1.5, error=0.0),
         "m is 1 in the equations; the model acts as if it were 1.5"),
        (cause("zero", "x", nominal=0.0, estimate=0.5),
         "zero of x is 0 in the equations; the model acts as if it were 0.5 ± 1e-06"),
        (cause("quadratic damping", "theta", nominal=0.0),
         "quadratic damping on theta is 0 in the equations; "
         "the model acts as if it were 2 ± 1e-06"),
        (cause("constant", "m", error=None),
         "m is 1 in the equations; the model acts as if it were 2 ± unknown"),
        (cause("taken", "m"), "m is 1 in the file; the engine acts as if it were 2 ± 1e-06"),
        (replace(cause("taken", "m", error=0.0), is_read=True),
         "m is 1 in the file, but 2 in the engine"),
        (cause("dropped", "m"), "m: in the file; the engine acts as if it were 0"),
    ],
)  # fmt: skip
def test_cause_is_a_sentence(explained: Cause, sentence: str) -> None:
    assert sentences(explained) == [sentence, "residual 2.5e-07 of the discrepancy"]


def test_ties_are_listed_at_the_end() -> None:
    tied = (CauseId(kind="constant", subject=("m",)), CauseId(kind="spring", subject=("x",)))
    assert sentences(cause("axis", "x"), tied=tied)[-1] == (
        "residual 2.5e-07 of the discrepancy; indistinguishable here from: m, spring on x"
    )


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


def test_explain_searches_for_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "Inertia", "no mass"]) == 0
    assert "XC104  A link has inertia but no mass." in capsys.readouterr().out
    assert main(["explain", "zebra", "quagga"]) == 2
    capsys.readouterr()
    assert main(["explain", "step", "too", "long", "zebra"]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("  XC180  ")


def test_explain_without_a_code_lists_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain"]) == 0
    words = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert [word for word in words if word in codes()] == list(codes())


def change_of(**fields: Any) -> Diff:
    """Return the change of a case that agreed to 11.3 digits."""
    return diff_cases(case().id, numbers_of(case()), numbers_of(case(**fields)))


def test_changed_verdict_is_better_or_worse() -> None:
    worse = change_of(outcome=Outcome.DIFFERS, reason="x is 3e-02 off")
    assert (worse.changed, *worse.outcomes, worse.is_worse) == (
        ("verdict",), Outcome.AGREES, Outcome.DIFFERS, True,
    )  # fmt: skip
    better = diff_cases(case().id, numbers_of(case(Outcome.FAILED)), numbers_of(case()))
    assert (better.changed[0], better.is_worse) == ("verdict", False)


def test_global_error_changes_by_one_percent() -> None:
    assert change_of(full_run=full_run(global_error=0.00504)).changed == ()
    assert change_of(full_run=full_run(global_error=0.0051)).changed == ("error at dt",)
    assert change_of(full_run=full_run(global_error=None)).changed == ("error at dt",)
    assert change_of(full_run=full_run(time_step=0.001)).changed == ("dt",)
