"""An explanation in sentences."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.cause import CauseKind
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.records import Cause, CauseId, Explanation, SourceLine


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
         "m is 1.5 in the model, but 1 in the equations"),
        (cause("zero", "x", nominal=0.0, estimate=0.5),
         "zero of x is 0.5 ± 1e-06 in the model, but 0 in the equations"),
        (cause("quadratic damping", "theta", nominal=0.0),
         "quadratic damping on theta is 2 ± 1e-06 in the model, but 0 in the equations"),
        (cause("constant", "m", error=None),
         "m is 2 ± unknown in the model, but 1 in the equations"),
        (cause("taken", "m"), "m is 1 in the file; the engine acts as if it were 2 ± 1e-06"),
        (replace(cause("taken", "m", error=0.0), is_read=True),
         "m is 1 in the file, but 2 in the engine"),
        (cause("dropped", "m"), "m: in the file; the engine acts as if it were 0"),
    ],
)  # fmt: skip
def test_cause_is_a_sentence(explained: Cause, sentence: str) -> None:
    assert sentences(explained) == [sentence, "residual 2.5e-07 of the discrepancy"]


def test_two_causes_are_two_sentences() -> None:
    lines = sentences(
        cause("literal", "body[nut and bolt]@mass"), cause("friction", "lock and key")
    )
    assert lines == [
        "body[nut and bolt]@mass is 1; the motion implies 2 ± 1e-06",
        "friction on lock and key is 2 ± 1e-06 in the model, but 1 in the equations",
        "residual 2.5e-07 of the discrepancy",
    ]


def test_ties_are_listed_at_the_end() -> None:
    tied = (CauseId(kind="constant", subject=("m",)), CauseId(kind="spring", subject=("x",)))
    assert sentences(cause("axis", "x"), tied=tied)[-1] == (
        "residual 2.5e-07 of the discrepancy; indistinguishable here from: m, spring on x"
    )
