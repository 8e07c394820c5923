"""Findings without motion: an audit, or features of a file that motions do not test."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.poses import Poses


class Audit(Record, frozen=True, kw_only=True):
    """The audit of a model in a folder that declares energies.

    Attributes:
        findings: Findings of the audit.
        poses: Comparison of frames.
    """

    findings: tuple[AuditFinding, ...]
    poses: Poses


class FileSurvey(Record, frozen=True, kw_only=True):
    """The audit of a model in a folder that declares bodies.

    Attributes:
        findings: Inertias that no rigid body can have.
        left_out: Features of the file that are not compared.
    """

    findings: tuple[AuditFinding, ...]
    left_out: tuple[str, ...]
