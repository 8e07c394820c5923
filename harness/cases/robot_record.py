"""What is told of a robot's file beside its verdict, and with which settings engines run it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from harness.cases.system_record import quantities
from harness.records.base import SourceLine, number
from harness.records.finding import AuditFinding
from harness.records.system import Scenario, System
from harness.robots.inertias import impossible
from harness.robots.robot import LeftOut, Robot
from harness.text.status import counted
from reference.multibody.tree import WORLD
from reference.samples import Samples
from reference.trees import TreeSystem

ALONE: Mapping[str, object] = MappingProxyType({"smooth": True, "couplings": False})
"""Settings of every engine: what the equations leave out is left out there too."""

METHOD = "recursion along the tree; Gauss collocation of order 16, checked by DOP853"


def inertia_findings(robot: Robot) -> tuple[AuditFinding, ...]:
    """Inertias that no body can have; of what stands still, a note."""
    still = {part.name for part in robot.parts if part.body == WORLD}
    return tuple(
        AuditFinding(
            kind="inertia",
            subject=(one.link, one.kind),
            message=f"{one.sentence}; {one.remedy}",
            location=SourceLine(file=str(one.file), line=one.line or None),
            expected=None,
            found=None,
            severity="note" if one.link in still else "finding",
        )
        for one in impossible(robot)
    )


def settings_of(robot: Robot) -> Mapping[str, object]:
    """With which every engine runs it."""
    own: dict[str, object] = dict(robot.stated)
    if robot.controls:
        own["controls"] = list(robot.controls)
    if robot.tree is not None and robot.tree.couplings:
        own["couplings"] = [robot.tree.links[one.follower].name for one in robot.tree.couplings]
    if robot.floats:
        own["floating"] = True
    if robot.held:
        own["held"] = list(robot.held)
    return {**ALONE, **own}


def sidecar_beside(file: Path) -> tuple[str, ...]:
    """A sidecar counts in its folder, and not where its file is checked alone."""
    beside = file.with_name(f"{file.name}.toml")
    return (f"what {beside.name} says, which is read with its folder",) if beside.is_file() else ()


def told(one: LeftOut) -> str:
    """Such as: dry friction (7)."""
    return one.what if one.count == 1 else f"{one.what} ({one.count})"


def tree_record(
    folder: str, system: TreeSystem, drawn: Samples, scenario: str, seconds: float
) -> System:
    """What is written of a tree: its joints, and the states at which it is checked."""
    count = len(drawn.start)
    return System(
        name=system.name,
        folder=folder,
        title=system.title,
        source=system.source,
        kind="autonomous",
        coordinates=quantities(system.coordinates),
        constants=(),
        inputs=(),
        outputs=(),
        scenarios=(
            Scenario(
                name=scenario,
                description=f"{counted(count, 'state')}, each under forces of its own",
                duration=drawn.length,
                inputs={},
                segments=count,
                method=METHOD,
                bound=number(float(drawn.bound.max())),
                global_bound=None,
            ),
        ),
        seconds=seconds,
    )
