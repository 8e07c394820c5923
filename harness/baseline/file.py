"""The baseline file of a system: read strictly, and written with a line a quantity.

Every entry carries its own names and a seal over all that it says; a snapshot is called by the hash
of what is in it. So a file that was damaged, badly merged or edited by hand is never believed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from physics_crosscheck.harness.baseline.seal import S, canonical, sealed, snapshot_key
from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import (
    FORMAT,
    AcceptedAudit,
    AcceptedCase,
    BaselineFile,
    Declared,
    RobotOptions,
    Snapshot,
)
from physics_crosscheck.harness.records.case import CaseId, ModelId
from physics_crosscheck.harness.records.outcome import Outcome

T = TypeVar("T")
A = TypeVar("A", AcceptedCase, AcceptedAudit)

_RESTORE = "restore it from version control, or remove it and run `crosscheck accept` again"
_NOT_BELIEVED = (
    "is damaged, badly merged or edited by hand; restore it from version control, "
    "or remove this entry and accept it again"
)


class FileError(ValueError):
    """A text that is no baseline file, or can't be believed; says what, where and the remedy."""


class _ShapeError(FileError):
    """JSON of another shape."""


@dataclass(frozen=True, kw_only=True)
class SystemBaseline:
    """What was accepted of a system.

    Attributes:
        declared: what it declared then, and its folder.
        snapshots: those that cases refer to, by key.
        cases: what was accepted of each.
        audits: what was accepted though the audit finds it wrong, by model.
    """

    declared: Declared
    snapshots: Mapping[str, Snapshot] = field(repr=False)
    cases: Mapping[CaseId, AcceptedCase] = field(repr=False)
    audits: Mapping[ModelId, AcceptedAudit] = field(default_factory=dict, repr=False)

    @property
    def system(self) -> str:
        """Its name."""
        return self.declared.system

    @property
    def robot(self) -> RobotOptions | None:
        """Options with which a robot file is read; None for a system folder."""
        robot = self.declared.robot
        return robot if isinstance(robot, RobotOptions) else None

    @property
    def known_differences(self) -> dict[CaseId, AcceptedCase]:
        """Cases that were accepted though they don't agree."""
        return {
            case: entry for case, entry in self.cases.items() if entry.outcome is not Outcome.AGREES
        }

    def snapshot(self, case: CaseId) -> Snapshot | None:
        """Return the accepted snapshot of a case; None if the engine refused the file."""
        return self.snapshots.get(self.cases[case].snapshot)


class _Head(msgspec.Struct):
    """The one field by which another format is told from a broken file."""

    format: object = None


class _Folder(msgspec.Struct):
    """The one part in which the folder is named."""

    declared: Declared


def file_text(one: SystemBaseline) -> str:
    """A system's baseline as the text of its file; snapshots that no case needs are left out."""
    needed = sorted({entry.snapshot for entry in one.cases.values()} - {""})
    cases = [
        f"    {_table(sealed(_as_read(one.cases[case])), '    ')}" for case in sorted(one.cases)
    ]
    audits = [
        f"    {_table(sealed(_as_read(one.audits[model])), '    ')}" for model in sorted(one.audits)
    ]
    accepted = f'  "audits": {_block("[", audits, "]")},\n' if audits else ""
    snapshots = [f"    {_line(key)}: {_table(one.snapshots[key], '    ')}" for key in needed]
    return (
        "{\n"
        f'  "format": {FORMAT},\n'
        f'  "declared": {_table(sealed(_as_read(one.declared)), "  ")},\n'
        f'  "cases": {_block("[", cases, "]")},\n'
        f"{accepted}"
        f'  "snapshots": {_block("{", snapshots, "}")}\n'
        "}\n"
    )


def _as_read(record: S) -> S:
    """A record as a file gives it back, whole numbers as what they are declared to be."""
    return msgspec.json.decode(canonical(record), type=type(record))


def _line(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _table(record: Record, indent: str) -> str:
    """A record with a line a field."""
    fields: dict[str, object] = msgspec.to_builtins(record)
    lines = [f"{indent}  {_line(name)}: {_line(value)}" for name, value in fields.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def _block(opening: str, tables: Sequence[str], closing: str) -> str:
    return f"{opening}\n" + ",\n".join(tables) + f"\n  {closing}" if tables else opening + closing


def read_file(data: bytes, system: str) -> SystemBaseline:
    """Read the baseline file of a system.

    Raises:
        FileError: for anything that can't be believed.
    """
    _check_format(data)
    file = _decoded(data, BaselineFile)
    if sealed(file.declared) != file.declared:
        raise FileError(f"declared: {_NOT_BELIEVED}")
    if file.declared.system != system:
        raise FileError(f"belongs to the system {file.declared.system!r}; {_RESTORE}")
    for key, snapshot in file.snapshots.items():
        if snapshot_key(snapshot) != key:
            raise FileError(f"{key}: {_NOT_BELIEVED}")
        if not _is_whole(snapshot):
            raise FileError(f"{key}: is incomplete: its tables differ in size; {_RESTORE}")
    return SystemBaseline(
        declared=file.declared,
        snapshots=file.snapshots,
        cases=_cases(file, system),
        audits=_audits(file, system),
    )


def read_target(data: bytes) -> tuple[str, bool]:
    """Return the folder or robot file that a baseline file names, and whether it is a robot file.

    What else it says is neither read nor believed.

    Raises:
        FileError: for a text in which no folder is named.
    """
    _check_format(data)
    declared = _decoded(data, _Folder).declared
    return declared.folder, declared.robot is not msgspec.UNSET


def _check_format(data: bytes) -> None:
    """Refuse other formats.

    Raises:
        FileError: saying which it is.
    """
    again = "remove it and run `crosscheck accept --reason TEXT`"
    try:
        found = _decoded(data, _Head).format
    except _ShapeError:
        _decoded(data, object)  # what is no JSON at all is told as that
        found = None
    if isinstance(found, int) and found < FORMAT:
        raise FileError(
            f"baseline has format {found} of an earlier crosscheck, expected {FORMAT}; {again}"
        )
    if found != FORMAT:
        raise FileError(
            f"not a baseline of format {FORMAT}; use the version of crosscheck that "
            f"wrote it, or {again}"
        )


def _decoded(data: bytes, wanted: type[T]) -> T:
    """Decode a record; keys that are there twice are not looked for: of what counts, seals tell.

    Raises:
        FileError: where the text is no JSON, or has another shape.
    """
    try:
        return msgspec.json.decode(data, type=wanted)
    except msgspec.ValidationError as error:
        raise _ShapeError(f"is malformed: {error}; {_RESTORE}") from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise FileError(f"not JSON: {error}; {_RESTORE}") from None


def _cases(file: BaselineFile, system: str) -> dict[CaseId, AcceptedCase]:
    cases: dict[CaseId, AcceptedCase] = {}
    for entry in file.cases:
        _believe(entry, str(entry.id), system, known=entry.id in cases)
        if not (entry.model and entry.scenario and entry.engine):
            raise FileError(f"{entry.id}: does not name a model, scenario and engine; {_RESTORE}")
        snapshot = file.snapshots.get(entry.snapshot)
        if entry.outcome is Outcome.REFUSED and not entry.snapshot:
            cases[entry.id] = entry
            continue
        if snapshot is None:
            raise FileError(f"{entry.id}: is incomplete: its snapshot is missing; {_RESTORE}")
        if not _fits(entry, snapshot):
            raise FileError(
                f"{entry.id}: is inconsistent: its segments differ from those of its snapshot"
            )
        cases[entry.id] = entry
    return cases


def _believe(one: A, called: str, system: str, *, known: bool) -> None:
    """Refuse what is not as it was sealed, of another system, or there twice."""
    if sealed(one) != one:
        raise FileError(f"{called}: {_NOT_BELIEVED}")
    if one.system != system:
        raise FileError(f"{called}: belongs to a different system; {_RESTORE}")
    if known:
        raise FileError(f"{called}: appears twice; {_RESTORE}")


def _audits(file: BaselineFile, system: str) -> dict[ModelId, AcceptedAudit]:
    audits: dict[ModelId, AcceptedAudit] = {}
    for audit in file.audits:
        _believe(audit, f"the audit of {audit.id}", system, known=audit.id in audits)
        audits[audit.id] = audit
    return audits


def _is_whole(one: Snapshot) -> bool:
    """Whether a snapshot's tables belong together, and its numbers can be worked with."""
    count, width = len(one.t), len(one.components)
    inputs = {len(row) for nodes in one.input_nodes for row in nodes}
    return (
        count > 0
        and {len(one.length), len(one.input_nodes)} == {count}
        and _is_table(one.start, count, width)
        and _is_table(one.end, count, width)
        and len(one.scale) == width
        and inputs <= {len(one.inputs)}
        and all(one.input_nodes)
        and all(value > 0 for value in _positive(one))
    )


def _positive(one: Snapshot) -> Iterator[float]:
    yield from one.length
    yield from one.scale


def _fits(entry: AcceptedCase, one: Snapshot) -> bool:
    """Whether an entry's ends are those of a snapshot's segments, of its scenario."""
    size = len(one.t), len(one.components)
    tables = (entry.end, entry.end_uncertainty)
    return one.scenario == entry.scenario and all(_is_table(table, *size) for table in tables)


def _is_table(rows: Sequence[Sequence[object]], count: int, width: int) -> bool:
    return len(rows) == count and all(len(row) == width for row in rows)
