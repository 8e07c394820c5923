"""Message codes: every kind has a code, every code is used, and kinds determine codes."""

import re
from functools import cache
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.engines.protocol import UnsupportedError
from physics_crosscheck.harness.engines.remark import RemarkKind
from physics_crosscheck.harness.jobs.failure import failure_of
from physics_crosscheck.harness.modelfiles.inertias import Kind as InertiaKind
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.records.cause import CauseKind
from physics_crosscheck.harness.records.codes import GROUPS, codes
from physics_crosscheck.harness.records.diff import Diff, Status, bare_diff
from physics_crosscheck.harness.records.finding import AuditKind, PlausibilityKind
from physics_crosscheck.records import AuditFinding, Case, CaseId, Cause, Outcome, Record
from tests.records.made import case, finding

HARNESS = Path(__file__).parents[2] / "harness"
KINDS = [kind for code in codes().values() for kind in code.kinds]
CHANGES = ("model", "engine", "tool", "equations", "scenario", "numbers", "outcome", "audit",
           "unexplained", "untested")  # fmt: skip
"""Kinds of change in the gate (`harness.baseline.diff`, `harness.commands.gate.gate`)."""


def kinds_of(group: str) -> set[str]:
    return {kind.split(":")[-1] for kind in KINDS if kind.startswith(f"{group}:")}


def test_kinds_and_codes_correspond() -> None:
    assert len(set(KINDS)) == len(KINDS)
    assert kinds_of("audit") == {*get_args(AuditKind), *get_args(PlausibilityKind)}
    assert kinds_of("cause") == set(get_args(CauseKind))
    assert kinds_of("case") == set(get_args(CaseKind))
    states = {kind.split(":")[1] for kind in KINDS if kind.startswith("gate:")}
    assert states == {one.value for one in Status} - {Status.SAME.value}
    assert kinds_of("gate") == {"", *CHANGES}
    assert set(get_args(RemarkKind)) | set(get_args(InertiaKind)) <= set(get_args(AuditKind))


@cache
def kinds_in_code() -> frozenset[str]:
    """Return every string of the harness except docstrings and the declarations of kinds."""
    kinds = set[str]()
    for file in HARNESS.rglob("*.py"):
        if file.name != "codes.py":
            code = re.sub(r'"""[\s\S]*?"""|\bLiteral\[[^]]*\]', "", file.read_text())
            kinds |= set(re.findall(r'"([^"\n]*)"', code))
    return frozenset(kinds)


@pytest.mark.parametrize("group", ["audit", "cause", "case", "gate", "baseline"])
def test_no_code_is_dead(group: str) -> None:
    used = {*kinds_in_code(), ""}
    # The diagnosis takes the kinds of terms from the equations' variants.
    reference = "".join(file.read_text() for file in (HARNESS.parent / "reference").rglob("*.py"))
    dead = {kind for kind in kinds_of(group) if kind not in used and f'"{kind}"' not in reference}
    assert not dead


def test_codes_and_names_are_unique_and_in_their_group() -> None:
    assert len({one.name for one in codes().values()}) == len(codes())
    assert list(codes()) == sorted(codes())
    assert all(code[:3] in GROUPS for code in codes())


def test_code_is_written_and_follows_from_the_kind() -> None:
    record = finding("a is 1", kind="massless")
    assert record.code == "XC104"
    encoded = msgspec.json.encode(record)
    assert msgspec.json.decode(encoded)["code"] == "XC104"
    assert msgspec.json.decode(encoded.replace(b"XC104", b"XC999"), type=AuditFinding) == record
    assert msgspec.structs.replace(record, kind="triangle").code == "XC107"


def test_record_has_the_code_of_its_kind() -> None:
    cause = Cause(kind="axis", subject=("q",), nominal=1.0, estimate=None, standard_error=None)
    names = {"system": "s", "model": "m", "scenario": "c", "engine": "e"}
    bare = bare_diff(CaseId(**names), Status.SAME)
    gate = [
        msgspec.structs.replace(bare, status=Status(status), kinds=kinds).code
        for status, kinds in (("changed", ("text", "engine")), ("gone", ()), ("as accepted", ()))
    ]
    assert (cause.code, gate) == ("XC208", ["XC511", "XC502", ""])


CASES = [
    (Outcome.AGREES, "", ""),
    (Outcome.DIFFERS, "motion", "XC301"),
    (Outcome.DIFFERS, "coordinate map", "XC302"),
    (Outcome.UNRESOLVED, "coordinate map", "XC317"),
    (Outcome.UNRESOLVED, "rounding", "XC316"),
    (Outcome.REFUSED, "file", "XC403"),
    (Outcome.REFUSED, "unsupported", "XC402"),
    (Outcome.FAILED, "time limit", "XC601"),
    (Outcome.FAILED, "", "XC612"),
    (Outcome.ABSENT, "", "XC606"),
]


@pytest.mark.parametrize(("outcome", "kind", "code"), CASES)
def test_case_has_the_code_of_its_outcome_and_kind(
    outcome: Outcome, kind: CaseKind, code: str
) -> None:
    assert case(outcome, kind=kind).code == code


def test_every_failing_outcome_has_a_code() -> None:
    for outcome in set(Outcome) - {Outcome.AGREES}:
        assert case(outcome, kind="").code in codes()


class OwnError(EngineError):
    """An error of an engine outside this package."""

    kind = "mine"


def test_failure_has_the_kind_of_its_error() -> None:
    kinds = [failure_of(error("bad")).kind for error in (EngineError, UnsupportedError, OwnError)]
    assert kinds == ["file", "unsupported", ""]
    assert failure_of(SidecarError("bad")).kind == "sidecar"


def test_records_with_kinds_have_codes() -> None:
    for record in (AuditFinding, Cause, Case, Diff):
        assert issubclass(record, Record)
        assert "code" in record.__struct_fields__
