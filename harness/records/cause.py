"""A cause of a discrepancy: the kind of the wrong number, its subject, and its name in words."""

import math
from typing import Literal

import msgspec

from .base import Number, Record, SourceLine
from .codes import cause_code

CauseKind = Literal[
    "literal", "literals", "unbound literal", "taken", "dropped", "gravity", "default", "law",
    "axis", "zero",
    "exchange", "constant", "inertia", "damping", "quadratic damping", "friction", "spring",
    "offset force",
]  # fmt: skip
"""Kind of a cause.

A `literal` is a number of the model file or its sidecar; `literals` are several of one expression,
and an `unbound literal` has no constant. A number of a robot file can be `taken` differently by an
engine, or several can be `dropped` as if they were zero. The other kinds are: a component of the
engine's `gravity`; a `default` of the engine; another `law` of contacts, limits or drives; a
reversed joint `axis` or a moved `zero`; an `exchange` of two constants; a `constant` of the
equations; or a term on a coordinate that the equations lack.
"""

IN_FILE = ("literal", "literals", "unbound literal", "gravity")
"""Kinds of numbers in the model's files for which the motion implies another value."""

SWITCHES = ("axis", "default", "law", "exchange", "dropped")
"""Kinds of causes without a fitted number."""

_PHRASES = {
    **dict.fromkeys(
        (
            "literal",
            "literals",
            "unbound literal",
            "taken",
            "dropped",
            "default",
            "law",
            "constant",
        ),
        "{}",
    ),
    "gravity": "gravity along {}",
    "axis": "axis of {} reversed",
    "zero": "zero of {}",
    "exchange": "{} exchanged",
}
"""Name of a cause by its kind; a missing term is named by its kind and coordinate."""


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
    * `law`: contacts, limits, friction or drives act by another law.
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
        is_read: Whether the bodies that the engine compiled have the estimate.
        locations: Lines and byte ranges of the numbers; empty if no file states them.
    """

    kind: CauseKind
    subject: tuple[str, ...]
    nominal: Number
    estimate: Number
    standard_error: Number
    is_read: bool = False
    locations: tuple[SourceLine, ...] = ()
    code: str = ""

    def __post_init__(self) -> None:
        msgspec.structs.force_setattr(self, "code", cause_code(self.kind))

    @property
    def replacement(self) -> str:
        """Text to write at each location; empty if no number of a file must change."""
        if self.kind not in IN_FILE or self.estimate is None or self.standard_error is None:
            return ""
        return digits_known(self.estimate, self.standard_error)

    @property
    def id(self) -> CauseId:
        """Identity of the cause."""
        return CauseId(kind=self.kind, subject=self.subject)

    def __str__(self) -> str:
        return str(self.id)


def digits_known(value: float, error: float) -> str:
    """Format a fitted value with at most ten digits, without digits below its standard error."""
    places = 15 if error == 0 else max(0, -math.floor(math.log10(error)))
    return f"{round(value, places) + 0.0:.10g}"
