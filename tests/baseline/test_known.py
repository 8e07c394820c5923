"""Known differences in a run, and what changed since the baseline."""

import dataclasses
from pathlib import Path

import msgspec
import pytest

from physics_crosscheck.harness.baseline import known
from physics_crosscheck.harness.baseline.fingerprint import FolderFiles, ModelFiles
from physics_crosscheck.harness.baseline.known import Accepted, changes_since, mark_known
from physics_crosscheck.harness.baseline.store import write_baseline
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.records.baseline import AcceptedCase, Measurement
from physics_crosscheck.harness.records.diff import Diff, Status
from physics_crosscheck.records import Case, CaseId, Outcome
from tests.baseline.samples import (
    ENTRY,
    FILES,
    NUMERICS,
    SNAPSHOT,
    SYSTEM,
    baseline,
    case,
    entry,
    measurement,
)

FOLDER = Path("models/spring")
KNOWN_DIFFERENCE = entry(outcome=Outcome.DIFFERS, discrepancy=1e-3, reason="the engine's own limit")


@pytest.fixture(autouse=True)
def numerics(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.baseline.fingerprint.VERSION", NUMERICS)


def accepted(*entries: AcceptedCase) -> Accepted:
    stored = baseline(*entries)
    model = ModelFiles(FOLDER, "m.xml", ("e",), FILES, ())
    scan = FolderFiles(FOLDER, stored.declared.declared, (model,), ())
    return Accepted(
        place=Path("reports/baseline"),
        systems={SYSTEM: stored},
        folders={str(FOLDER): (scan, stored)},
        versions={"e": "1.0"},
        resolution=1e-9,
        engines=(),
    )


def measured(
    this: Case, value: Measurement | Failure
) -> dict[tuple[str, CaseId], Measurement | Failure]:
    return {(this.folder, this.id): value}


def marked(this: Case, value: Measurement | Failure) -> Case:
    (case,) = mark_known((this,), measured(this, value), accepted(KNOWN_DIFFERENCE))
    return case


def since(this: Case, value: Measurement | Failure) -> tuple[Diff, ...]:
    comparison = changes_since((this,), measured(this, value), accepted(ENTRY))
    assert comparison is not None
    return comparison.changes


DIFFERS = case(Outcome.DIFFERS, discrepancy=1e-3, reason="it is off")
OTHER_SCENARIO = msgspec.structs.replace(
    measurement(), snapshot=msgspec.structs.replace(SNAPSHOT, duration=5.0)
)


def test_known_difference_keeps_its_accepted_reason() -> None:
    known_case = marked(DIFFERS, measurement())
    assert known_case.accepted == "the engine's own limit"
    assert known_case.reason == "it is off"
    assert known_case.passes
    assert not DIFFERS.accepted  # a record is never changed


@pytest.mark.parametrize(("this", "value", "why"), [
    (DIFFERS, measurement(move=1e-6), "the model's motion changed by 1.0e-06 ± 8e-13 of its"),
    (DIFFERS, measurement(equations=1e-6), "the equations' motion changed"),
    (DIFFERS, Failure("it blew up", ""), "it blew up"),
    (DIFFERS, msgspec.structs.replace(measurement(), on_accepted=None),
     "the coordinates or inputs of the system changed"),
    (case(Outcome.DIFFERS, discrepancy=2e-3, reason="it is off"), measurement(),
     "the discrepancy changed from 1.000e-03 ± 1.000e-12 to 2.000e-03 ± 1.000e-12"),
    (case(Outcome.DIFFERS, discrepancy=2e-3, reason="it is off"), OTHER_SCENARIO,
     "the discrepancy changed from"),
    (case(Outcome.UNRESOLVED, reason="it is off"), measurement(),
     "the verdict changed from DIFFERS to UNRESOLVED"),
])  # fmt: skip
def test_changed_known_difference_does_not_pass(
    this: Case, value: Measurement | Failure, why: str
) -> None:
    changed_case = marked(this, value)
    note = "it is off; a difference was accepted here (the engine's own limit), but "
    assert changed_case.reason.startswith(f"{note}{why}")
    assert not changed_case.accepted


def test_agreeing_failed_and_unmeasured_cases_are_unmodified() -> None:
    for outcome in (Outcome.AGREES, Outcome.FAILED, Outcome.ABSENT):
        this = case(outcome)
        assert marked(this, measurement()) is this
    assert mark_known((DIFFERS,), {}, accepted(KNOWN_DIFFERENCE)) == (DIFFERS,)
    assert mark_known((DIFFERS,), {}, None) == (DIFFERS,)


def test_changes_are_sorted_worst_first() -> None:
    gone, new = entry(model="gone.xml"), case(model="new.xml")
    this = case(global_error=0.05)
    comparison = changes_since((new, this), measured(this, measurement()), accepted(ENTRY, gone))
    assert comparison is not None
    assert comparison.name == "reports/baseline"
    assert [(change.label, change.id.model) for change in comparison.changes] == [
        ("changed, worse", "m.xml"),
        ("gone", "gone.xml"),
        ("new", "new.xml"),
    ]
    assert comparison.changes[0].messages[0] == "error at dt 0.5 % -> 5 %"
    assert comparison.changes[1].messages[0] == "accepted, but the case no longer exists"


def test_unchanged_and_unmeasured_cases_are_not_listed() -> None:
    this = case()
    for values in (measured(this, measurement()), {}):
        comparison = changes_since((this,), values, accepted(ENTRY))
        assert comparison is not None
        assert comparison.changes == ()
    assert changes_since((this,), {}, None) is None


def test_failed_case_did_not_run_and_better_case_improved() -> None:
    failed, better = case(Outcome.FAILED, reason="no XML"), case(global_error=0.001)
    (change,) = since(failed, Failure("no XML", ""))
    assert (change.status, *change.messages) == (Status.NOT_RUN, "FAILED: no XML")
    (change,) = since(better, measurement())
    assert change.status is Status.IMPROVED


def test_failed_declaration_counts_for_all_its_cases() -> None:
    failed = case(Outcome.FAILED, model="system.py", engine="-", scenario="-", reason="NameError")
    comparison = changes_since((failed,), {}, accepted(ENTRY))
    assert comparison is not None
    (change,) = comparison.changes
    assert (change.status, *change.messages) == (
        Status.NOT_RUN,
        "FAILED; the baseline has 1 case of it",
    )


def test_folder_that_timed_out_is_not_new_under_any_name() -> None:
    failed = case(
        Outcome.FAILED, system="called_otherwise", model="system.py", engine="-", scenario="-"
    )
    before = accepted(ENTRY, entry(model="other.xml"))
    comparison = changes_since((failed,), {}, before)
    assert comparison is not None
    (change,) = comparison.changes
    assert (change.status, *change.messages) == (
        Status.NOT_RUN,
        "FAILED; the baseline has 2 cases of it",
    )
    unread = changes_since((failed,), {}, dataclasses.replace(before, folders={}))
    assert unread is not None
    assert [change.status for change in unread.changes] == [Status.NEW]  # its system is unknown


def test_unreadable_model_counts_for_its_own_cases_only() -> None:
    failed = case(Outcome.FAILED, engine="-", scenario="-", reason="no TOML")
    comparison = changes_since((failed,), {}, accepted(ENTRY, entry(model="gone.xml")))
    assert comparison is not None
    assert [(each.status, each.id.model, *each.messages) for each in comparison.changes] == [
        (Status.NOT_RUN, "m.xml", "FAILED; the baseline has 1 case of it"),
        (Status.GONE, "gone.xml", "accepted, but the case no longer exists"),
    ]


def test_folder_with_an_unreadable_file_counts_as_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(folder: Path, _: Path) -> FolderFiles:
        raise PermissionError(13, "Permission denied", str(folder / "mesh.stl"))

    monkeypatch.setattr("physics_crosscheck.harness.baseline.stale.folder_files", refuse)
    write_baseline(tmp_path, [baseline()], {})
    stored = known.accepted(tmp_path, [FOLDER], 1e-9)
    assert stored is not None
    assert (stored.folders, stored.snapshots) == ({}, {})
    this = case(Outcome.FAILED, reason="mesh.stl can't be read")
    changes = changes_since((this,), {}, stored)
    assert changes is not None
    assert [(c.status, *c.messages) for c in changes.changes] == [
        (Status.NOT_RUN, "its folder has an unreadable file")
    ]
