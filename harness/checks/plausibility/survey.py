"""Advice about a robot's file as findings of its audit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.modelfiles.mesh_files import unread_meshes
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.results.status import unread_words
from ..findings import finding
from .facts import RobotFacts
from .kinds import advise

_UNREAD = ("unreadable", "without a reader")


def plausibility_findings(robot: Robot) -> tuple[AuditFinding, ...]:
    """Return advice about a file with a tree, and a note if its meshes are not read."""
    if robot.tree is None or has_stand_ins(robot.file):
        return ()
    facts = RobotFacts(robot, robot.tree)
    with np.errstate(all="ignore"):  # bodies whose numbers overflow have no advice
        advice = advise(facts)
    return (*advice, *_uncompared(facts))


def _uncompared(facts: RobotFacts) -> Iterator[AuditFinding]:
    """Yield a note if the hull of a body with meshes is unknown."""
    bodies = [body for body in facts.bodies if body.has_mesh and body.hull is None]
    if not bodies:
        return
    unread = unread_meshes(shape for body in bodies for shape in body.shapes)
    why = unread_words(unread) or "some have no volume, or axes that some programs turn"
    collada = any(one.problem in _UNREAD and one.name.endswith(".dae") for one in unread)
    hint = ". COLLADA files need `pip install 'physics-crosscheck[meshes]'`" if collada else ""
    message = f"meshes are not compared with masses and inertias: {why}{hint}"
    yield finding("unresolved", ("meshes",), message, severity="note")
