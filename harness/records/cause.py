"""A cause of a discrepancy: what kind of number is wrong, of what, and its name in words."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from physics_crosscheck.harness.records.base import Number, Record, SourceLine
from physics_crosscheck.harness.records.codes import cause_code

CauseKind = Literal[
    "literal", "literals", "unbound literal", "taken", "dropped", "gravity", "default", "axis",
    "zero",
    "exchange", "constant", "inertia", "damping", "quadratic damping", "friction", "spring",
    "offset force",
]  # fmt: skip
"""What a cause is.

A `literal` (several of one expression, `literals`, or one that stands for no constant, `unbound
literal`) of the model file or its sidecar; a number of a file that says what is right and that an
engine has `taken` otherwise, or several that it has `dropped`, as if they were zero; a component of
the engine's `gravity`; a
`default` of the engine; a joint's `axis` reversed or its `zero` moved; two constants' `exchange`;
a `constant` of the equations; or a term on a coordinate that the equations lack.
"""

IN_FILE = ("literal", "literals", "unbound literal", "gravity")
"""Kinds of numbers that the model's files state, or would: the motion implies another value."""

_PHRASES = {
    **dict.fromkeys(
        ("literal", "literals", "unbound literal", "taken", "dropped", "default", "constant"), "{}"
    ),
    "gravity": "gravity along {}",
    "axis": "axis of {} reversed",
    "zero": "zero of {}",
    "exchange": "{} exchanged",
}
"""The name of a cause, by its kind; a term that the equations lack is its kind, on a coordinate."""


class CauseId(Record, frozen=True, kw_only=True, order=True):
    """A wrong or missing number.

    Types of cause:

    * `literal`: one number of the model file or its sidecar.
    * `literals`: several numbers with the same bound expression.
    * `unbound literal`: a number that no binding ties to a constant.
    * `taken`: a number that the engine read differently.
    * `dropped`: numbers that the engine treated as zero.
    * `gravity`: a component of the engine's gravity.
    * `default`: a default of the engine.
    * `axis`: a reversed joint axis.
    * `zero`: a shifted zero position of a joint.
    * `exchange`: two exchanged constants.
    * `constant`: a constant of the equations.
    * `inertia`, `damping`, `quadratic damping`, `friction`, `spring`, `offset force`: a term that
      the equations lack.

    Attributes:
        kind: Type of the cause.
        subject: Affected numbers, constants, joint, coordinate or axis; or an engine's behavior.
    """

    kind: CauseKind
    subject: tuple[str, ...]

    def __str__(self) -> str:
        phrase = _PHRASES.get(self.kind, f"{self.kind} on {{}}")
        return phrase.format(", ".join(self.subject))


class Cause(Record, frozen=True, kw_only=True):
    """A cause, with the value that explains the motion.

    Attributes:
        kind: Type of the cause.
        code: Message code of the kind; empty without one.
        subject: Affected numbers, constants, joint, coordinate or axis; or an engine's behavior.
        nominal: Value in the file or in the equations.
        estimate: Value that explains the motion.
        standard_error: Standard error of the estimate.
        locations: Lines and byte ranges of the numbers; empty if no file states them.
    """

    kind: CauseKind
    subject: tuple[str, ...]
    nominal: Number
    estimate: Number
    standard_error: Number
    locations: tuple[SourceLine, ...] = ()
    code: str = ""

    def __post_init__(self) -> None:
        msgspec.structs.force_setattr(self, "code", cause_code(self.kind))

    @property
    def replacement(self) -> str:
        """What to write at each location; empty where no number of a file is to change."""
        if self.kind not in IN_FILE or self.estimate is None or self.standard_error is None:
            return ""
        return digits_known(self.estimate, self.standard_error)

    @property
    def id(self) -> CauseId:
        """Which one it is."""
        return CauseId(kind=self.kind, subject=self.subject)

    def __str__(self) -> str:
        return str(self.id)


def digits_known(value: float, error: float) -> str:
    """A fitted value with ten digits, but none below its standard error."""
    places = 15 if error == 0 else max(0, -math.floor(math.log10(error)))
    return f"{round(value, places) + 0.0:.10g}"
