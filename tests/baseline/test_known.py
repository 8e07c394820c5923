"""Known differences in a run, and what changed since the baseline."""

from __future__ import annotations

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
from physics_crosscheck.harness.records.case import Case, CaseId
from physics_crosscheck.harness.records.diff import Diff, Status
from physics_crosscheck.harness.records.outcome import Outcome
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
KNOWN = entry(outcome=Outcome.DIFFERS, discrepancy=1e-3, reason="the engine's own limit")


@pytest.fixture(autouse=True)
def numerics(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("physics_crosscheck.harness.baseline.fingerprint.VERSION", NUMERICS)


def accepted(*entries: AcceptedCase) -> Accepted:
    one = baseline(*entries)
    model = ModelFiles(FOLDER, "m.xml", ("e",), FILES, ())
    scan = FolderFiles(FOLDER, one.declared.declared, (model,), ())
    return Accepted(
        place=Path("reports/baseline"),
        systems={SYSTEM: one},
        folders={str(FOLDER): (scan, one)},
        versions={"e": "1.0"},
        resolution=1e-9,
        engines=(),
    )


def measured(
    this: Case, value: Measurement | Failure
) -> dict[tuple[str, CaseId], Measurement | Failure]:
    return {(this.folder, this.id): value}


def marked(this: Case, value: Measurement | Failure) -> Case:
    (found,) = mark_known((this,), measured(this, value), accepted(KNOWN))
    return found


def since(this: Case, value: Measurement | Failure) -> tuple[Diff, ...]:
    found = changes_since((this,), measured(this, value), accepted(ENTRY))
    assert found is not None
    return found.changes


DIFFERS = case(Outcome.DIFFERS, discrepancy=1e-3, reason="it is off")
OTHER_SCENARIO = msgspec.structs.replace(
    measurement(), snapshot=msgspec.structs.replace(SNAPSHOT, duration=5.0)
)


def test_a_known_difference_has_the_reason_it_was_accepted_with() -> None:
    found = marked(DIFFERS, measurement())
    assert found.accepted == "the engine's own limit"
    assert found.reason == "it is off"
    assert found.passes
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
def test_one_that_changed_is_told_so_and_does_not_pass(
    this: Case, value: Measurement | Failure, why: str
) -> None:
    found = marked(this, value)
    note = "it is off; a difference was accepted here (the engine's own limit), but "
    assert found.reason.startswith(f"{note}{why}")
    assert not found.accepted


def test_cases_that_agree_failed_or_were_not_measured_are_left_as_they_are() -> None:
    for outcome in (Outcome.AGREES, Outcome.FAILED, Outcome.ABSENT):
        this = case(outcome)
        assert marked(this, measurement()) is this
    assert mark_known((DIFFERS,), {}, accepted(KNOWN)) == (DIFFERS,)
    assert mark_known((DIFFERS,), {}, None) == (DIFFERS,)


def test_what_changed_since_is_told_worst_first() -> None:
    gone, new = entry(model="gone.xml"), case(model="new.xml")
    this = case(global_error=0.05)
    found = changes_since((new, this), measured(this, measurement()), accepted(ENTRY, gone))
    assert found is not None
    assert found.name == "reports/baseline"
    assert [(change.label, change.id.model) for change in found.changes] == [
        ("changed, worse", "m.xml"),
        ("gone", "gone.xml"),
        ("new", "new.xml"),
    ]
    assert found.changes[0].messages[0] == "error at dt 0.5 % -> 5 %"
    assert found.changes[1].messages[0] == "accepted, but the case no longer exists"


def test_nothing_is_told_of_what_is_as_it_was_or_was_not_measured() -> None:
    this = case()
    for values in (measured(this, measurement()), {}):
        found = changes_since((this,), values, accepted(ENTRY))
        assert found is not None
        assert found.changes == ()
    assert changes_since((this,), {}, None) is None


def test_a_case_that_failed_did_not_run_and_a_better_one_is_an_improvement() -> None:
    failed, better = case(Outcome.FAILED, reason="no XML"), case(global_error=0.001)
    (change,) = since(failed, Failure("no XML", ""))
    assert (change.status, *change.messages) == (Status.NOT_RUN, "FAILED: no XML")
    (change,) = since(better, measurement())
    assert change.status is Status.IMPROVED


def test_a_declaration_that_can_t_be_loaded_takes_its_cases_with_it() -> None:
    failed = case(Outcome.FAILED, model="system.py", engine="-", scenario="-", reason="NameError")
    found = changes_since((failed,), {}, accepted(ENTRY))
    assert found is not None
    (change,) = found.changes
    assert (change.status, *change.messages) == (
        Status.NOT_RUN,
        "FAILED; the baseline has 1 case of it",
    )


def test_a_folder_that_ran_out_of_time_is_not_said_to_be_new_whatever_it_is_called() -> None:
    failed = case(
        Outcome.FAILED, system="called_otherwise", model="system.py", engine="-", scenario="-"
    )
    before = accepted(ENTRY, entry(model="other.xml"))
    found = changes_since((failed,), {}, before)
    assert found is not None
    (change,) = found.changes
    assert (change.status, *change.messages) == (
        Status.NOT_RUN,
        "FAILED; the baseline has 2 cases of it",
    )
    unread = changes_since((failed,), {}, dataclasses.replace(before, folders={}))
    assert unread is not None
    assert [change.status for change in unread.changes] == [Status.NEW]  # nothing tells what it is


def test_a_model_that_can_t_be_read_stands_for_its_own_accepted_cases_alone() -> None:
    failed = case(Outcome.FAILED, engine="-", scenario="-", reason="no TOML")
    found = changes_since((failed,), {}, accepted(ENTRY, entry(model="gone.xml")))
    assert found is not None
    assert [(change.status, change.id.model, *change.messages) for change in found.changes] == [
        (Status.NOT_RUN, "m.xml", "FAILED; the baseline has 1 case of it"),
        (Status.GONE, "gone.xml", "accepted, but the case no longer exists"),
    ]


def test_a_folder_with_a_file_that_can_t_be_read_ends_no_run_and_is_not_as_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(folder: Path, _: Path) -> FolderFiles:
        raise PermissionError(13, "Permission denied", str(folder / "mesh.stl"))

    monkeypatch.setattr("physics_crosscheck.harness.baseline.stale.folder_files", refuse)
    write_baseline(tmp_path, [baseline()], {})
    found = known.accepted(tmp_path, [FOLDER], 1e-9)
    assert found is not None
    assert (found.folders, found.snapshots) == ({}, {})
    this = case(Outcome.FAILED, reason="mesh.stl can't be read")
    changes = changes_since((this,), {}, found)
    assert changes is not None
    assert [(c.status, *c.messages) for c in changes.changes] == [
        (Status.NOT_RUN, "its folder has an unreadable file")
    ]
