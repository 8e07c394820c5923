"""What is found of a model without motion: its audit, or what its file says beyond its motions."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.poses import Poses


class Audit(Record, frozen=True, kw_only=True):
    """Of a model of a folder that declares energies.

    Attributes:
        findings: what it has wrong.
        poses: where its bodies are.
    """

    findings: tuple[AuditFinding, ...]
    poses: Poses


class FileSurvey(Record, frozen=True, kw_only=True):
    """Of a model file of a folder that declares bodies.

    Attributes:
        findings: inertias that no body can have.
        left_out: what the file says and the check leaves out.
    """

    findings: tuple[AuditFinding, ...]
    left_out: tuple[str, ...]
