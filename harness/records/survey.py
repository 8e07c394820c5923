"""Findings without motion."""

from .base import Number, Record
from .finding import AuditFinding
from .poses import Poses


class ActingQuantity(Record, frozen=True, kw_only=True):
    """A quantity that the numbers of a file act as in an engine.

    Attributes:
        subject: What it belongs to, such as `drive of knee` or `floor with foot`.
        quantity: Its name, such as `friction` or `natural frequency`.
        value: Its value; None if it is not finite.
        unit: Its unit; empty for a ratio.
        rule: How it follows from the file; empty if that is clear.
        parts: Friction of two shapes; or a drive's damping, and the ratio by it alone.
        declared: Whether a system declares it, for its rigid contacts.
    """

    subject: str
    quantity: str
    value: Number
    unit: str = ""
    rule: str = ""
    parts: tuple[float, ...] = ()
    declared: bool = False


class Audit(Record, frozen=True, kw_only=True):
    """The audit of a model.

    Attributes:
        findings: Findings of the audit.
        poses: Comparison of frames; None where none can be declared.
        left_out: Features of the file that are not compared.
        acting: Quantities that the numbers act as.
    """

    findings: tuple[AuditFinding, ...]
    poses: Poses | None = None
    left_out: tuple[str, ...] = ()
    acting: tuple[ActingQuantity, ...] = ()
