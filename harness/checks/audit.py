"""Audit of one model: literals, compiled terms, poses and the engine's own defaults."""

from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from pathlib import Path

import msgspec

from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.modelfiles.bindings import SIDECAR, Binding, bindings
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.poses import Poses
from physics_crosscheck.harness.records.survey import ActingQuantity, Audit
from physics_crosscheck.reference.mechanism.system import System
from .acting import (
    DRAG,
    acting_quantities,
    declared_quantities,
    merged,
    planar_quantities,
    urdf_quantities,
)
from .compiled_terms import Compiled
from .findings import finding, format_omission, negative_findings, robot_findings, source_line
from .plausibility.kinds import plausibility_findings
from .poses import check_poses
from .prepare import PreparedTree
from .task import SystemTask, TreeTask

MAX_DOF = 12
"""Largest number of coordinates of a robot whose terms are compared: they are n^2, in n states."""


SWITCHING = {"contact", "dry friction", "joint limit"}
"""Remarks on forces that a system with interactions declares."""


def audit_file(task: TreeTask) -> Audit:
    """Audit a model of declared bodies by reading its file without the declaration."""
    sidecar = task.declared
    model = str(sidecar.settings.get("model", ""))
    floating = bool(sidecar.settings.get("floating", False))
    robot = read_robot(sidecar.model, floating=floating, model=model)
    return Audit(
        findings=(*robot_findings(robot), *plausibility_findings(robot)),
        left_out=tuple(format_omission(one) for one in robot.left_out),
        acting=planar_quantities(task.spec, task.engine),
    )


def audit_terms(task: TreeTask) -> Audit:
    """Compare the compiled terms of a model of bodies with those of the equations.

    Raises:
        EngineError, BlownUpError: naming the file.
    """
    count = len(task.target.names)
    if count > MAX_DOF:
        message = (
            f"the terms of {count} coordinates are not compared one by one, since they are more "
            f"than {MAX_DOF}; `crosscheck run` compares its accelerations"
        )
        return Audit(findings=(finding("unresolved", ("terms",), message, severity="note"),))
    model, coordinates = task.load()
    return Audit(findings=tuple(Compiled.prepare(task, model, coordinates).findings()))


def audit_acting(task: TreeTask) -> Audit:
    """Return what the numbers of a file act as; nothing in engines without a documented law.

    Raises:
        EngineError: if the file cannot be compiled.
    """
    return Audit(findings=(), acting=_file_quantities(task))


def _file_quantities(task: TreeTask | SystemTask) -> tuple[ActingQuantity, ...]:
    engine = engines()[task.engine]
    if task.file.suffix in engine.compiles:
        return acting_quantities(engine.compiled(task.file))
    target, steps = task.target, None
    if isinstance(target, PreparedTree) and task.spec.path == target.place:
        steps = target.steps
    rows = merged(urdf_quantities(task.spec, task.engine, steps))
    # Default damping is the same for all files, and off here.
    return tuple(row for row in rows if row.quantity != DRAG)


def audit_declared(task: SystemTask) -> Audit:
    """Audit a model of declared energies: literals, compiled terms, poses, the engine's defaults.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    declared, lost = declared_bindings(task.target.system, task.declared)
    literals = (*literal_findings(declared), *lost)
    engine = engines()[task.engine]
    model, coordinates = task.load()
    rounded = max((abs(b.error) for b in declared if b.rounded), default=0.0)
    # Terms of motions that switch have no single value at a state.
    measured = () if task.target.system.interactions else _compiled(task, model, coordinates)
    compiled = [_explained(one, rounded) for one in measured]
    z, w = coordinates.to_engine(task.target.visited)
    remarks = (*model.remarks(z, w), *engine.file_remarks(task.declared.model))
    if task.target.system.interactions:  # the system declares what switches
        remarks = tuple(one for one in remarks if one.kind not in SWITCHING)
    compiled = _without_lost_digits(compiled, remarks, task)
    wrong = _wrong(compiled)
    defaults = (_default(remark, wrong, task) for remark in remarks)
    poses, elsewhere = _poses(task, model, coordinates)
    signs = negative_findings(task.declared.model)
    findings = (*literals, *compiled, *elsewhere, *signs, *defaults)
    return Audit(findings=findings, poses=poses, acting=_acting(task, model))


def _acting(task: SystemTask, model: LoadedModel) -> tuple[ActingQuantity, ...]:
    """Return what the file's numbers act as, then what a system with interactions declares."""
    rows = planar_quantities(task.spec, task.engine, model)
    if not task.target.system.interactions:
        return rows
    return (*(rows or _file_quantities(task)), *declared_quantities(task.target.system))


def _compiled(
    task: SystemTask, model: LoadedModel, coordinates: CoordinateMap
) -> Iterator[AuditFinding]:
    return Compiled.prepare(task, model, coordinates).findings()


def _poses(
    task: SystemTask, model: LoadedModel, coordinates: CoordinateMap
) -> tuple[Poses, tuple[AuditFinding, ...]]:
    """Return the poses of the bodies, and a finding for frames that cannot be looked up."""
    reached = task.target.visited[:, : len(task.target.system.q)]
    try:
        checked = check_poses(task.target.system, task.declared, model, coordinates, reached)
    except SidecarError as error:
        return Poses(note="[frames] can't be read"), (finding("frames", ("frames",), str(error)),)
    return checked.record, tuple(
        finding("pose", one.frames, one.message, expected=0.0, actual=one.off)
        for one in checked.findings
    )


def _wrong(compiled: Sequence[AuditFinding]) -> set[str]:
    return {one.kind for one in compiled if one.severity == "finding"}


def _without_lost_digits(
    compiled: list[AuditFinding], remarks: Sequence[Remark], task: SystemTask
) -> list[AuditFinding]:
    """Turn differences into notes where they vanish in an engine that keeps all digits."""
    wrong = _wrong(compiled)
    undo = {k: v for r in remarks if wrong & set(r.shows_in) for k, v in r.undone_by.items()}
    if not undo:
        return compiled
    model, coordinates = task.with_settings(**undo).load()
    differences = list(Compiled.prepare(task, model, coordinates).findings())
    shown = {kind for remark in remarks if remark.undone_by for kind in remark.shows_in}
    return [
        one
        if one.kind not in shown or any(_same(one, other) for other in differences)
        else _note(one, "the engine's own rounding explains it")
        for one in compiled
    ]


def _same(first: AuditFinding, second: AuditFinding) -> bool:
    """Return whether two findings concern one term; accelerations are listed for the worst state
    only.
    """
    return first.kind == second.kind and (
        first.kind == "acceleration" or first.subject == second.subject
    )


def _note(difference: AuditFinding, why: str) -> AuditFinding:
    message = f"{difference.message}; {why}"
    return msgspec.structs.replace(difference, message=message, severity="note")


def _explained(difference: AuditFinding, rounded: float) -> AuditFinding:
    """Return a note for a difference that rounded literals explain; those have their own notes."""
    if difference.expected is None or difference.actual is None or difference.severity != "finding":
        return difference
    if abs(difference.actual - difference.expected) > 10 * rounded * abs(difference.expected):
        return difference
    return _note(difference, "the rounded numbers of the file explain it")


def _default(remark: Remark, wrong: Set[str], task: SystemTask) -> AuditFinding:
    """Return a finding for an engine default that enters a wrong term, or a note if the terms are
    right.
    """
    blamed = remark.fault or wrong & set(remark.shows_in)
    message = remark.message
    if remark.related_address:
        related = replace(remark, address=remark.related_address)
        message += f" ({where(related, task.declared, task.engine)})"
    return finding(
        remark.kind,
        remark.subject or (remark.message,),
        message,
        location=where(remark, task.declared, task.engine),
        actual=remark.value,
        severity="finding" if blamed else "note",
    )


def where(remark: Remark, sidecar: Sidecar, engine: str) -> SourceLine | None:
    """Return the line that a remark concerns, or only the file, or None."""
    if remark.address is None:
        return None
    file, address = sidecar.model, remark.address
    if address.startswith(SIDECAR):
        file, address = Path(f"{file}.toml"), address.removeprefix(SIDECAR)
        key = address.removeprefix("settings.")
        if key in sidecar.engine_settings.get(engine, {}):
            address = f"settings.{engine}.{key}"
    return SourceLine(file=str(file), line=line_of(file, address))


MOST_LOST = 10
"""Maximum number of unreadable bindings that are reported one by one."""


def declared_bindings(
    system: System, sidecar: Sidecar
) -> tuple[tuple[Binding, ...], tuple[AuditFinding, ...]]:
    """Return every readable binding, and a finding for each unreadable one.

    After ten unreadable bindings the rest are not checked; one finding counts them.
    """
    try:
        return bindings(system, sidecar), ()
    except (LocationError, SidecarError):
        readable: list[Binding] = []
        lost: list[AuditFinding] = []
        for i, (address, expression) in enumerate(sidecar.bindings.items()):
            try:
                single = replace(sidecar, bindings={address: expression})
                readable += bindings(system, single)
            except (LocationError, SidecarError) as error:
                lost.append(finding("binding", (address,), f"the binding can't be read: {error}"))
            if len(lost) == MOST_LOST and i + 1 < len(sidecar.bindings):
                remaining = len(sidecar.bindings) - i - 1
                rest = (
                    f"{remaining} more bindings were not checked, after {MOST_LOST} unreadable ones"
                )
                lost.append(finding("binding", ("bindings",), f"{rest}; fix these first"))
                break
        if not lost:
            raise  # the error is between two bindings
        return tuple(readable), tuple(lost)


def literal_findings(declared: tuple[Binding, ...]) -> Iterator[AuditFinding]:
    """Yield a finding for each literal that differs from its expression, a note for a
    rounded one.
    """
    for b in declared:
        if b.exact:
            continue
        stated = f"{b.address} is {b.place.text}"
        declared_value = f"{b.expression} = {b.correction!r}"
        error = f"{'relative ' if b.expected else ''}error {abs(b.error):.1e}"
        if b.rounded:
            message = f"{stated}, which is {declared_value} rounded ({error})"
        else:
            message = f"{stated}, but {declared_value} ({error})"
        yield finding(
            "rounded" if b.rounded else "literal",
            (b.address,),
            message,
            location=source_line(b.place),
            expected=b.expected,
            actual=b.value,
            replacement="" if b.rounded else repr(b.correction),
            severity="note" if b.rounded else "finding",
        )
