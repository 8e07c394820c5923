"""Advice about a robot's file as findings of its audit."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.checks.findings import finding
from physics_crosscheck.harness.checks.plausibility.facts import RobotFacts
from physics_crosscheck.harness.checks.plausibility.kinds import advise
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.records.finding import AuditFinding


def plausibility_findings(robot: Robot) -> tuple[AuditFinding, ...]:
    """Return advice about a file with a tree, and a note if its meshes are not read."""
    if robot.tree is None:
        return ()
    facts = RobotFacts(robot, robot.tree)
    with np.errstate(all="ignore"):  # bodies whose numbers overflow have no advice
        advice = advise(facts)
    findings = tuple(
        finding(
            one.kind,
            one.subject,
            one.message,
            location=one.line,
            expected=one.expected,
            actual=one.actual,
            severity="advice",
        )
        for one in advice
    )
    unread = any(body.has_mesh and body.hull is None for body in facts.bodies)
    return (*findings, _UNREAD) if unread else findings


_UNREAD = finding(
    "unresolved",
    ("meshes",),
    "some meshes are missing or not read, and not compared with masses and inertias; COLLADA"
    " files need `pip install 'physics-crosscheck[meshes]'`",
    severity="note",
)
