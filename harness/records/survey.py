"""Findings without motion."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.poses import Poses


class Audit(Record, frozen=True, kw_only=True):
    """The audit of a model.

    Attributes:
        findings: Findings of the audit.
        poses: Comparison of frames; None where none can be declared.
        left_out: Features of the file that are not compared.
    """

    findings: tuple[AuditFinding, ...]
    poses: Poses | None = None
    left_out: tuple[str, ...] = ()
