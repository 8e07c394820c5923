"""Baseline files with arbitrary content: accepted unmodified, or rejected in one sentence."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from physics_crosscheck.harness.baseline.file import (
    canonical,
    file_text,
    read_file,
    sealed,
    snapshot_key,
)
from physics_crosscheck.harness.baseline.store import BaselineError, accepted_text, read_baseline
from physics_crosscheck.harness.records.baseline import (
    AcceptedAudit,
    AcceptedCase,
    AcceptedDeclaration,
    AcceptedFinding,
    RobotOptions,
    Snapshot,
    StepEnds,
    WholeSteps,
)
from physics_crosscheck.harness.records.read import decoded
from tests.baseline.samples import DECLARED, ENTRY, SNAPSHOT, SYSTEM, baseline, entry

Table = dict[str, Any]
ROBOT = msgspec.structs.replace(DECLARED, robot=RobotOptions(floating=True, model="arm"))
EVENTFUL = msgspec.structs.replace(SNAPSHOT, events=(1.05,))
"""A snapshot with all fields: `events` is only written if not empty."""
KEY = snapshot_key(EVENTFUL)
CONTENT = {"m.xml": "0123456789abcdef"}
STEPS = WholeSteps(
    coordinates=("x",),
    components=("x_ddot",),
    controls=1,
    states=((0.1, 0.2, 0.3),),
    scale=(1.0,),
    ends=StepEnds(values=((0.5,),), uncertainty=((1e-12,),)),
    laws={"step": 0.002},
)
ACCEPTED = replace(
    baseline(entry(snapshot=KEY, steps=STEPS, content=CONTENT)),
    declared=ROBOT,
    snapshots={KEY: EVENTFUL},
)
TEXT = file_text(ACCEPTED)
WRONG = {"no": ["such", "thing"]}
"""A value that no field has."""


def plain() -> Table:
    table: Table = json.loads(TEXT)
    return table


def snapshot_in(table: Table) -> Table:
    snapshot: Table = next(iter(table["snapshots"].values()))
    return snapshot


def resealed(table: Table) -> Table:
    """Recompute seals and keys, as a knowledgeable forger would."""
    case, declared = table["cases"][0], table["declared"]
    snapshot = decoded(json.dumps(snapshot_in(table)).encode(), Snapshot)
    key = snapshot_key(snapshot)
    table["snapshots"] = {key: snapshot_in(table)}
    case["snapshot"] = key
    case["seal"] = sealed(decoded(json.dumps(case).encode(), AcceptedCase)).seal
    declared["seal"] = sealed(decoded(json.dumps(declared).encode(), AcceptedDeclaration)).seal
    return table


def rejection(folder: Path, data: bytes) -> str:
    file = folder / f"{SYSTEM}.json"
    file.write_bytes(data)
    with pytest.raises(BaselineError) as caught:
        read_baseline(folder)
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    assert len(message) < 600
    return message


FIELDS = [
    *(("cases", name) for name in AcceptedCase.__struct_fields__),
    *(("declared", name) for name in AcceptedDeclaration.__struct_fields__),
    *(("snapshots", name) for name in Snapshot.__struct_fields__ if name != "steps"),
]


def table_of(table: Table, place: str) -> Table:
    part: Table = {
        "cases": table["cases"][0],
        "declared": table["declared"],
        "snapshots": snapshot_in(table),
    }[place]
    return part


def other(value: Any) -> Any:
    """Return a different value of the same type."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, str):
        return {"AGREES": "DIFFERS"}.get(value, f"{value}x")
    if isinstance(value, dict):
        return {name: other(each) for name, each in value.items()}
    return [other(each) for each in value]


def _spoil(part: Table, name: str) -> None:
    part[name] = WRONG


def _modify(part: Table, name: str) -> None:
    part[name] = other(part[name])


@pytest.mark.parametrize(("place", "name"), FIELDS)
@pytest.mark.parametrize("damage", [_spoil, _modify, dict.pop])
def test_wrong_modified_or_missing_field_is_rejected(
    tmp_path: Path, place: str, name: str, damage: Callable[[Table, str], object]
) -> None:
    table = plain()
    damage(table_of(table, place), name)
    message = rejection(tmp_path, json.dumps(table).encode())
    edited = "is damaged, badly merged or edited by hand" in message
    assert edited or (damage is not _modify and "is malformed" in message)


SHAPES: dict[str, Callable[[Table], object]] = {
    "no segment": lambda t: snapshot_in(t).update(
        t=[], length=[], start=[], input_nodes=[], end=[]
    ),
    "a time too few": lambda t: snapshot_in(t)["t"].pop(),
    "a length too few": lambda t: snapshot_in(t)["length"].pop(),
    "a start too few": lambda t: snapshot_in(t)["start"].pop(),
    "a start of one component": lambda t: snapshot_in(t)["start"][1].pop(),
    "an end too few": lambda t: snapshot_in(t)["end"].pop(),
    "an end of three components": lambda t: snapshot_in(t)["end"][0].append(1.0),
    "inputs of a segment too few": lambda t: snapshot_in(t)["input_nodes"].pop(),
    "inputs without a node": lambda t: snapshot_in(t)["input_nodes"][0].clear(),
    "two inputs where one is declared": lambda t: snapshot_in(t)["input_nodes"][0][0].append(0.0),
    "a scale too few": lambda t: snapshot_in(t)["scale"].pop(),
    "a scale of nothing": lambda t: snapshot_in(t).update(scale=[0.0, 1.0]),
    "a length of nothing": lambda t: snapshot_in(t).update(length=[0.1, 0.0, 0.1]),
    "a component too many": lambda t: snapshot_in(t)["components"].append("y"),
    "another scenario's snapshot": lambda t: snapshot_in(t).update(scenario="driven"),
    "an end of the model too few": lambda t: t["cases"][0]["end"].pop(),
    "an end of the model that is ragged": lambda t: t["cases"][0]["end"][2].pop(),
    "an uncertainty too few": lambda t: t["cases"][0]["end_uncertainty"].pop(),
    "a step of no component": lambda t: t["cases"][0]["steps"]["ends"]["values"][0].clear(),
    "a state of no control": lambda t: t["cases"][0]["steps"]["states"][0].pop(),
    "a case that is there twice": lambda t: t["cases"].append(t["cases"][0]),
    "a case of another system": lambda t: t["cases"][0].update(system="disc"),
    "a different system": lambda t: t["declared"].update(system="disc"),
}


@pytest.mark.parametrize("name", SHAPES)
def test_inconsistent_data_with_valid_seals_is_rejected(tmp_path: Path, name: str) -> None:
    table = plain()
    SHAPES[name](table)
    rejection(tmp_path, json.dumps(resealed(table)).encode())


TEXTS: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "not JSON"),
    "half of it": (TEXT.encode()[: len(TEXT) // 2], "not JSON"),
    "a merge's marks": (b"<<<<<<< HEAD\n" + TEXT.encode(), "not JSON"),
    "more after it": (TEXT.encode() + b"{}", "not JSON"),
    "a mark of byte order": (b"\xef\xbb\xbf" + TEXT.encode(), "not JSON"),
    "two-byte characters": (TEXT.encode("utf-16"), "not JSON"),
    "invalid bytes": (b"\xff\xfe", "not JSON"),
    "an invalid byte within": (TEXT.encode().replace(b"first", b"\xff"), "not JSON"),
    "half a character": (TEXT.encode().replace(b"first", b"\\ud800"), "not JSON"),
    "NaN": (TEXT.encode().replace(b"0.25", b"NaN", 1), "not JSON"),
    "infinity": (TEXT.encode().replace(b"0.25", b"1e999", 1), "out of range"),
    "brackets without an end": (b"[" * 100_000, "not JSON"),
    "braces without an end": (b'{"a":' * 100_000, "not JSON"),
    "null": (b"null", "not a baseline of format 2"),
    "a number": (b"2", "not a baseline of format 2"),
    "a list": (b"[]", "not a baseline of format 2"),
    "an empty object": (b"{}", "not a baseline of format 2"),
    "a format that is a text": (b'{"format": "2"}', "not a baseline of format 2"),
    "a format that is a fraction": (b'{"format": 2.5}', "not a baseline of format 2"),
    "a format alone": (b'{"format": 2}', "is malformed"),
    "a later format": (TEXT.encode().replace(b'"format": 2', b'"format": 3'), "use the version"),
    "a huge format": (b'{"format": 1' + b"0" * 400 + b"}", "not "),
    "an outcome that there is not": (TEXT.encode().replace(b'"AGREES"', b'"PASSES"'), "PASSES"),
    "a field that there is not": (
        TEXT.encode().replace(b'"reason"', b'"extra": 1, "reason"'), "extra"),
    "a part that there is not": (TEXT.encode().replace(b'"cases"', b'"causes"'), "causes"),
    "no case's snapshot": (TEXT.encode().replace(b'"free@', b'"free@0', 1), "is damaged"),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_not_a_baseline_is_rejected(tmp_path: Path, name: str) -> None:
    data, message = TEXTS[name]
    assert message in rejection(tmp_path, data)


def test_file_of_format_1_must_be_accepted_again(tmp_path: Path) -> None:
    old = {"format": 1, "head": {}, "cases": {"m.xml/free [e]": {}}, "tracks": {}}
    message = rejection(tmp_path, json.dumps(old).encode())
    assert "baseline has format 1 of an earlier crosscheck" in message
    assert "run `crosscheck accept --reason TEXT`" in message


def test_swapped_entries_are_rejected(tmp_path: Path) -> None:
    table = json.loads(file_text(baseline(ENTRY, entry(model="other.xml", reason="another"))))
    first, second = table["cases"]
    for name in ("model", "scenario", "engine"):
        first[name], second[name] = second[name], first[name]
    assert "is damaged, badly merged or edited by hand" in rejection(
        tmp_path, json.dumps(table).encode()
    )


def test_entry_of_another_system_is_rejected(tmp_path: Path) -> None:
    table = plain()
    stranger = sealed(entry(system="disc", model="b.xml"))
    table["cases"].append(json.loads(canonical(stranger)))
    assert "belongs to a different system" in rejection(tmp_path, json.dumps(table).encode())


def test_missing_snapshot_is_reported(tmp_path: Path) -> None:
    table = plain()
    table["snapshots"] = {}
    assert "its snapshot is missing" in rejection(tmp_path, json.dumps(table).encode())


def test_folder_in_place_of_a_file_is_rejected(tmp_path: Path) -> None:
    (tmp_path / f"{SYSTEM}.json").mkdir()
    with pytest.raises(BaselineError, match="can't be read"):
        read_baseline(tmp_path)


@pytest.mark.parametrize("place", [f"{SYSTEM}.json", f"{SYSTEM}/m.xml.accepted"])
def test_pipe_or_device_in_place_of_a_file_is_not_opened(tmp_path: Path, place: str) -> None:
    path = tmp_path / place
    path.parent.mkdir(exist_ok=True)
    for make in (os.mkfifo, lambda path: path.symlink_to("/dev/zero")):
        make(path)
        if path.suffix == ".json":
            with pytest.raises(BaselineError, match="can't be read: it is a "):
                read_baseline(tmp_path)
        assert accepted_text(tmp_path, SYSTEM, "m.xml", "0") is None
        path.unlink()


def test_entry_without_an_engine_is_rejected(tmp_path: Path) -> None:
    table = plain()
    table["cases"][0]["engine"] = ""
    message = rejection(tmp_path, json.dumps(resealed(table)).encode())
    assert "does not name a model, scenario and engine" in message


def test_accepted_audit_round_trips_or_is_rejected(tmp_path: Path) -> None:
    finding = AcceptedFinding(
        kind="literal", subject=("m",), message="m is 1.4", expected=1.3, actual=1.4
    )
    audit = AcceptedAudit(
        system=SYSTEM, model="m.xml", engine="e", reason="so", findings=(finding,)
    )
    text = file_text(replace(baseline(), audits={audit.id: audit}))
    assert read_file(text.encode(), SYSTEM).audits == {audit.id: sealed(audit)}
    assert file_text(read_file(text.encode(), SYSTEM)) == text
    assert "is damaged, badly merged or edited by hand" in rejection(
        tmp_path, text.replace("1.4", "1.5").encode()
    )
    table = json.loads(text)
    table["audits"] *= 2
    assert "appears twice" in rejection(tmp_path, json.dumps(table).encode())
    other = json.loads(canonical(sealed(msgspec.structs.replace(audit, system="disc"))))
    table["audits"] = [other]
    assert "belongs to a different system" in rejection(tmp_path, json.dumps(table).encode())


def test_written_baseline_round_trips() -> None:
    read = read_file(TEXT.encode(), SYSTEM)
    assert read.snapshots == ACCEPTED.snapshots
    assert [sealed(case) for case in ACCEPTED.cases.values()] == list(read.cases.values())
    assert file_text(read) == TEXT


def test_whole_numbers_in_float_fields_round_trip() -> None:
    whole = entry(resolution=1, constants={}, global_error=0)
    assert read_file(file_text(baseline(whole)).encode(), SYSTEM).cases[whole.id].resolution == 1.0


def test_file_has_one_line_per_quantity_with_names_first() -> None:
    lines = [line.strip() for line in TEXT.splitlines()]
    begin = lines.index('"system": "spring",', 5)
    names = [line.split('"')[1] for line in lines[begin : begin + 25]]
    assert tuple(names) == AcceptedCase.__struct_fields__[:25]
    assert lines[begin + 4].startswith('"summary": "AGREES, E 5e-14 U 1e-12; global error 0.50%')


def test_seals_are_stable() -> None:
    # If numbers were written differently, every accepted baseline would be rejected.
    assert canonical(entry().constants["k"]) == b'{"standard_error":1e-9,"value":47.0}'
    assert snapshot_key(SNAPSHOT) == "free@9d8b4c50223e"
    assert sealed(ENTRY).seal == "f3d097a1f37b7db4"
