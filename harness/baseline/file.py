"""Baseline file of a system, with one line per quantity and strict reading.

Every entry contains its own names and a seal over its whole content. A snapshot is named by the
hash of its content. So a file that was damaged, badly merged or edited by hand is rejected.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import (
    FORMAT,
    AcceptedAudit,
    AcceptedCase,
    AcceptedDeclaration,
    BaselineFile,
    RobotOptions,
    Snapshot,
    WholeSteps,
)
from physics_crosscheck.harness.records.case import CaseId, ModelId
from physics_crosscheck.harness.records.outcome import Outcome

T = TypeVar("T")
A = TypeVar("A", AcceptedCase, AcceptedAudit)
S = TypeVar("S", AcceptedCase, AcceptedAudit, AcceptedDeclaration)

_RESTORE = "restore it from version control, or remove it and run `crosscheck accept` again"
_NOT_BELIEVED = (
    "is damaged, badly merged or edited by hand; restore it from version control, "
    "or remove this entry and accept it again"
)


class BaselineFileError(ValueError):
    """An invalid baseline file; the message gives the problem, its place and the remedy."""


class _ShapeError(BaselineFileError):
    """JSON with the wrong structure."""


@dataclass(frozen=True, kw_only=True)
class SystemBaseline:
    """The accepted results of a system.

    Attributes:
        declared: the accepted declaration, and the system folder.
        snapshots: snapshots that cases refer to, by key.
        cases: accepted result of each case.
        audits: accepted audit findings, by model.
    """

    declared: AcceptedDeclaration
    snapshots: Mapping[str, Snapshot] = field(repr=False)
    cases: Mapping[CaseId, AcceptedCase] = field(repr=False)
    audits: Mapping[ModelId, AcceptedAudit] = field(default_factory=dict, repr=False)

    @property
    def system(self) -> str:
        """Name of the system."""
        return self.declared.system

    @property
    def robot(self) -> RobotOptions | None:
        """Options for reading the robot file; None for a system folder."""
        robot = self.declared.robot
        return robot if isinstance(robot, RobotOptions) else None

    @property
    def known_differences(self) -> dict[CaseId, AcceptedCase]:
        """Accepted cases with an outcome other than AGREES."""
        return {
            case: entry for case, entry in self.cases.items() if entry.outcome is not Outcome.AGREES
        }

    @property
    def is_untested(self) -> bool:
        """Return whether every engine refused the file when it was accepted."""
        return all(entry.outcome is Outcome.REFUSED for entry in self.cases.values())

    def snapshot(self, case: CaseId) -> Snapshot | None:
        """Return the accepted snapshot of a case; None if the engine refused the file."""
        entry = self.cases[case]
        snapshot = self.snapshots.get(entry.snapshot)
        if snapshot is None or entry.steps is msgspec.UNSET:
            return snapshot
        return msgspec.structs.replace(snapshot, steps=entry.steps)


class _Head(msgspec.Struct):
    """The format field, which distinguishes another format from a damaged file."""

    format: object = None


class _Folder(msgspec.Struct):
    """The part of the file that names the folder."""

    declared: AcceptedDeclaration


def canonical(record: Record) -> bytes:
    """Return the canonical JSON text of a record: sorted names, no spaces, shortest numbers."""
    return msgspec.json.encode(record, order="sorted")


def sealed(record: S) -> S:
    """Return a record with a seal over its other fields."""
    bare = msgspec.structs.replace(record, seal="")
    return msgspec.structs.replace(record, seal=_hash(canonical(bare), 16))


def snapshot_key(snapshot: Snapshot) -> str:
    """Return the name of a snapshot, derived from its content, such as `free@1f0a2b3c4d5e`."""
    return f"{snapshot.scenario}@{_hash(canonical(snapshot), 12)}"


def _hash(data: bytes, digits: int) -> str:
    return hashlib.sha256(data).hexdigest()[:digits]


def file_text(baseline: SystemBaseline) -> str:
    """Return the text of a system's baseline file; omit snapshots that no case needs."""
    needed = sorted({entry.snapshot for entry in baseline.cases.values()} - {""})
    cases = [
        f"    {_table(sealed(_as_read(baseline.cases[case])), '    ')}"
        for case in sorted(baseline.cases)
    ]
    audits = [
        f"    {_table(sealed(_as_read(baseline.audits[model])), '    ')}"
        for model in sorted(baseline.audits)
    ]
    accepted = f'  "audits": {_block("[", audits, "]")},\n' if audits else ""
    snapshots = [f"    {_line(key)}: {_table(baseline.snapshots[key], '    ')}" for key in needed]
    return (
        "{\n"
        f'  "format": {FORMAT},\n'
        f'  "declared": {_table(sealed(_as_read(baseline.declared)), "  ")},\n'
        f'  "cases": {_block("[", cases, "]")},\n'
        f"{accepted}"
        f'  "snapshots": {_block("{", snapshots, "}")}\n'
        "}\n"
    )


def _as_read(record: S) -> S:
    """Convert a record as a file does, so that whole numbers become the declared type."""
    return msgspec.json.decode(canonical(record), type=type(record))


def _line(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _table(record: Record, indent: str) -> str:
    """Format a record with one line per field."""
    fields: dict[str, object] = msgspec.to_builtins(record)
    lines = [f"{indent}  {_line(name)}: {_line(value)}" for name, value in fields.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def _block(opening: str, tables: Sequence[str], closing: str) -> str:
    return f"{opening}\n" + ",\n".join(tables) + f"\n  {closing}" if tables else opening + closing


def read_file(data: bytes, system: str) -> SystemBaseline:
    """Read the baseline file of a system.

    Raises:
        FileError: if any part is invalid.
    """
    _check_format(data)
    file = _decoded(data, BaselineFile)
    if sealed(file.declared) != file.declared:
        raise BaselineFileError(f"declared: {_NOT_BELIEVED}")
    if file.declared.system != system:
        raise BaselineFileError(f"belongs to the system {file.declared.system!r}; {_RESTORE}")
    for key, snapshot in file.snapshots.items():
        if snapshot_key(snapshot) != key:
            raise BaselineFileError(f"{key}: {_NOT_BELIEVED}")
        if not _is_whole(snapshot):
            raise BaselineFileError(f"{key}: is incomplete: its tables differ in size; {_RESTORE}")
    return SystemBaseline(
        declared=file.declared,
        snapshots=file.snapshots,
        cases=_cases(file, system),
        audits=_audits(file, system),
    )


def read_target(data: bytes) -> tuple[str, bool]:
    """Return the folder or robot file that a baseline file names, and whether it is a robot file.

    The rest of the file is neither read nor checked.

    Raises:
        FileError: for a text that names no folder.
    """
    _check_format(data)
    declared = _decoded(data, _Folder).declared
    return declared.folder, declared.robot is not msgspec.UNSET


def _check_format(data: bytes) -> None:
    """Reject other formats.

    Raises:
        FileError: naming the format.
    """
    again = "remove it and run `crosscheck accept --reason TEXT`"
    try:
        version = _decoded(data, _Head).format
    except _ShapeError:
        _decoded(data, object)  # report text that is not JSON as such
        version = None
    if isinstance(version, int) and version < FORMAT:
        raise BaselineFileError(
            f"baseline has format {version} of an earlier crosscheck, expected {FORMAT}; {again}"
        )
    if version != FORMAT:
        raise BaselineFileError(
            f"not a baseline of format {FORMAT}; use the version of crosscheck that "
            f"wrote it, or {again}"
        )


def _decoded(data: bytes, wanted: type[T]) -> T:
    """Decode a record. Duplicate keys are not detected here; the seals detect those that matter.

    Raises:
        FileError: if the text is not JSON, or its structure is wrong.
    """
    try:
        return msgspec.json.decode(data, type=wanted)
    except msgspec.ValidationError as error:
        raise _ShapeError(f"is malformed: {error}; {_RESTORE}") from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise BaselineFileError(f"not JSON: {error}; {_RESTORE}") from None


def _cases(file: BaselineFile, system: str) -> dict[CaseId, AcceptedCase]:
    cases: dict[CaseId, AcceptedCase] = {}
    for entry in file.cases:
        _believe(entry, str(entry.id), system, is_known=entry.id in cases)
        if not (entry.model and entry.scenario and entry.engine):
            raise BaselineFileError(
                f"{entry.id}: does not name a model, scenario and engine; {_RESTORE}"
            )
        snapshot = file.snapshots.get(entry.snapshot)
        if entry.outcome is Outcome.REFUSED and not entry.snapshot:
            cases[entry.id] = entry
            continue
        if snapshot is None:
            raise BaselineFileError(
                f"{entry.id}: is incomplete: its snapshot is missing; {_RESTORE}"
            )
        if not _fits(entry, snapshot):
            raise BaselineFileError(
                f"{entry.id}: is inconsistent: its segments differ from those of its snapshot"
            )
        cases[entry.id] = entry
    return cases


def _believe(record: A, called: str, system: str, *, is_known: bool) -> None:
    """Reject a record with a broken seal, of another system, or with a duplicate key."""
    if sealed(record) != record:
        raise BaselineFileError(f"{called}: {_NOT_BELIEVED}")
    if record.system != system:
        raise BaselineFileError(f"{called}: belongs to a different system; {_RESTORE}")
    if is_known:
        raise BaselineFileError(f"{called}: appears twice; {_RESTORE}")


def _audits(file: BaselineFile, system: str) -> dict[ModelId, AcceptedAudit]:
    audits: dict[ModelId, AcceptedAudit] = {}
    for audit in file.audits:
        _believe(audit, f"the audit of {audit.id}", system, is_known=audit.id in audits)
        audits[audit.id] = audit
    return audits


def _is_whole(snapshot: Snapshot) -> bool:
    """Return whether a snapshot's tables are consistent, and its numbers valid."""
    count, width = len(snapshot.t), len(snapshot.components)
    inputs = {len(row) for nodes in snapshot.input_nodes for row in nodes}
    return (
        count > 0
        and {len(snapshot.length), len(snapshot.input_nodes)} == {count}
        and _is_table(snapshot.start, count, width)
        and _is_table(snapshot.end, count, width)
        and len(snapshot.scale) == width
        and inputs <= {len(snapshot.inputs)}
        and all(snapshot.input_nodes)
        and all(value > 0 for value in _positive(snapshot))
    )


def _positive(snapshot: Snapshot) -> Iterator[float]:
    yield from snapshot.length
    yield from snapshot.scale


def _fits(entry: AcceptedCase, snapshot: Snapshot) -> bool:
    """Return whether an entry's ends match the segments and the scenario of a snapshot."""
    size = len(snapshot.t), len(snapshot.components)
    tables = (entry.end, entry.end_uncertainty)
    return (
        snapshot.scenario == entry.scenario
        and all(_is_table(table, *size) for table in tables)
        and (isinstance(entry.steps, msgspec.UnsetType) or _has_whole_steps(entry.steps))
    )


def _has_whole_steps(steps: WholeSteps) -> bool:
    """Return whether the tables of whole steps have consistent sizes."""
    count, width = len(steps.states), len(steps.components)
    least = 2 * len(steps.coordinates) + steps.controls
    return (
        count > 0
        and len({len(row) for row in steps.states}) == 1
        and len(steps.states[0]) >= least
        and len(steps.scale) == width
        and _is_table(steps.ends.values, count, width)
        and _is_table(steps.ends.uncertainty, count, width)
    )


def _is_table(rows: Sequence[Sequence[object]], count: int, width: int) -> bool:
    return len(rows) == count and all(len(row) == width for row in rows)
