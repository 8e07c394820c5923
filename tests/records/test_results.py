"""Results are plain JSON, malformed ones are rejected in one sentence; each kind has one code."""

import inspect
import json
import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, get_args

import jsonschema
import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.engines.protocol import UnsupportedError
from physics_crosscheck.harness.engines.remark import RemarkKind
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.jobs.failure import failure_of
from physics_crosscheck.harness.modelfiles.inertias import Kind as InertiaKind
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from physics_crosscheck.harness.numerics.judgement import judge
from physics_crosscheck.harness.records.base import number, numbers, rows
from physics_crosscheck.harness.records.case import CaseKind, Convergence, ForwardDynamics
from physics_crosscheck.harness.records.cause import CauseKind
from physics_crosscheck.harness.records.codes import GROUPS, codes
from physics_crosscheck.harness.records.diff import Diff, Status, bare_diff
from physics_crosscheck.harness.records.finding import AuditKind, PlausibilityKind
from physics_crosscheck.harness.records.outcome import contradiction
from physics_crosscheck.harness.records.schema import PAGES, SCHEMAS, meanings, page_texts, schema
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.results.status import status_of
from physics_crosscheck.records import (
    AuditFinding,
    Case,
    CaseId,
    Cause,
    Model,
    Outcome,
    Record,
    Results,
    ResultsError,
    read_results,
)
from tests.records.examples import example, paths, replaced, required, value_at
from tests.records.made import case, finding, results, verdict
from tests.report.samples import model


def test_nan_and_infinity_never_reach_json() -> None:
    convergence = Convergence(
        rungs=(1,),
        h=numbers([1.0]),
        defect=numbers([float("-inf")]),
        increments=numbers([float("nan"), None]),
    )
    read = json.loads(encoded(convergence), parse_constant=lambda name: pytest.fail(name))
    assert read["defect"] == [None]
    assert read["increments"] == [None, None]
    assert number(float("inf")) is None


def test_numpy_numbers_become_plain_ones() -> None:
    assert type(number(np.float64(1.5))) is float
    assert rows(np.eye(2)) == ((1.0, 0.0), (0.0, 1.0))
    assert type(rows(np.eye(2))[0][0]) is float


def test_written_results_are_read_back(tmp_path: Path) -> None:
    run = results(case(Outcome.FAILED))
    write_whole(tmp_path / "deep" / "r.json", encoded(run))
    assert read_results(tmp_path / "deep" / "r.json") == run


def test_failed_write_leaves_only_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.json"
    write_whole(path, "old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["r.json"]


@pytest.mark.parametrize(("text", "sentence"), [
    (None, "can't be read"), ("{", "not JSON"), ("[]", "not a results file of schema 5"),
    ('{"schema": 99}', "not a results file of schema 5"),
])  # fmt: skip
def test_other_file_is_rejected_with_a_remedy(
    tmp_path: Path, text: str | None, sentence: str
) -> None:
    path = tmp_path / "r.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ResultsError, match=sentence) as refused:
        read_results(path)
    assert "crosscheck run" in str(refused.value)
    assert str(path) in str(refused.value)


AGREES, DIFFERS, UNRESOLVED = Outcome.AGREES, Outcome.DIFFERS, Outcome.UNRESOLVED

CONTRADICTORY = {
    "agrees, far off": case(AGREES, verdict=verdict(discrepancy=5.2, largest_discrepancy=5.2)),
    "agrees, far off elsewhere": case(AGREES, verdict=verdict(largest_discrepancy=5.2)),
    "agrees, unsure": case(AGREES, verdict=verdict(uncertainty=1e-3, resolution=1e-9)),
    "agrees, unknown": case(AGREES, verdict=verdict(discrepancy=None)),
    "agrees, without an uncertainty": case(AGREES, verdict=verdict(uncertainty=None)),
    "agrees, below zero": case(AGREES, verdict=verdict(discrepancy=-5.2)),
    "agrees, without numbers": case(AGREES, verdict=None),
    "agrees, off its map": case(AGREES, verdict=verdict(map_residual=0.1, map_uncertainty=1e-9)),
    "agrees, its accelerations differ": case(
        AGREES, forward_dynamics=ForwardDynamics(
            outcome=DIFFERS, discrepancy=0.1, uncertainty=1e-9, component="x_ddot", states=3,
            terms=())),
    "differs, by nothing": case(DIFFERS),
    "differs, below its resolution": case(
        DIFFERS, verdict=verdict(discrepancy=1e-8, uncertainty=1e-12, resolution=1e-7)),
    "unresolved, and it differs": case(
        UNRESOLVED, verdict=verdict(discrepancy=5.2, uncertainty=0.1, resolution=1e-9)),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTRADICTORY)
def test_contradictory_case_is_rejected_with_its_place(tmp_path: Path, name: str) -> None:
    path = tmp_path / "r.json"
    write_whole(path, encoded(results(case(), CONTRADICTORY[name])))
    with pytest.raises(ResultsError) as refused:
        read_results(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: `$.cases[1]`, disc/mujoco.xml/free [mujoco]: ")
    assert "contradicts" in message or "without the numbers of a verdict" in message
    assert message.endswith("run `crosscheck run` again")


@pytest.mark.parametrize("sound", [
    case(AGREES),
    case(AGREES, verdict=verdict(discrepancy=3e-10, uncertainty=1e-12)),  # below the resolution
    # An engine with few digits: with its resolution, and an older record without it.
    case(AGREES, verdict=verdict(
        discrepancy=9e-7, uncertainty=2e-7, largest_discrepancy=9e-7, largest_uncertainty=5e-7,
        resolution=1.5e-6)),
    case(AGREES, verdict=verdict(
        discrepancy=9e-7, uncertainty=2e-7, largest_discrepancy=9e-7, largest_uncertainty=5e-7)),
    case(DIFFERS, verdict=verdict(discrepancy=0.01, largest_discrepancy=0.01)),
    case(UNRESOLVED, verdict=verdict(uncertainty=None, largest_uncertainty=None)),
    case(UNRESOLVED),  # because of its full run
    case(Outcome.FAILED), case(Outcome.FAILED, verdict=verdict(discrepancy=5.2)),
    case(Outcome.ABSENT),
])  # fmt: skip
def test_consistent_case_is_read(tmp_path: Path, sound: Case) -> None:
    path = tmp_path / "r.json"
    write_whole(path, encoded(results(sound)))
    assert read_results(path).cases == (sound,)


@pytest.mark.parametrize("seed", range(20))
def test_judgements_are_consistent(seed: int) -> None:
    """Compare the rule for files with the judge's, for any number of digits."""
    random = np.random.default_rng(seed)
    for _ in range(200):
        e, u = 10 ** random.uniform(-14, -4, (2, 5, 4))
        u[random.random(u.shape) < 0.02] = np.inf
        resolution = 10 ** random.uniform(-10, -5)
        judgement = judge(e, u, resolution, None)
        numbers_ = number(judgement.discrepancy), number(judgement.uncertainty)
        assert contradiction(judgement.outcome, *numbers_, resolution) == ""
        others = {AGREES, DIFFERS, UNRESOLVED} - {judgement.outcome, UNRESOLVED}
        assert all(contradiction(other, *numbers_, resolution) for other in others)


def with_misfit(differs: bool) -> Model:
    sound = model("oscillator", "arm.xml", "mujoco", 1)
    (linearization,) = sound.linearizations
    return replace(sound, linearizations=(replace(linearization, a_error=13.0, differs=differs),))


def test_wrong_linearization_fails_test_and_run() -> None:
    wrong, sound = with_misfit(True), with_misfit(False)
    assert sound.passes
    assert not wrong.passes
    assert [finding.kind for finding in wrong.findings] == ["linearization"]
    assert "equations' in A by 1.3e+01 of its largest entry" in wrong.findings[0].message
    assert status_of(wrong, require_engines=True).status == "fail"
    for checked, code in ((wrong, 1), (sound, 0)):
        results = Results(
            created="now", versions={}, resolution=1e-9, seconds=0.0, systems=(), models=(checked,),
            cases=(case(),), baseline=None,
        )  # fmt: skip
        assert exit_code(results, require_engines=False) == code


def structs(wanted: msgspec.inspect.Type) -> Iterator[msgspec.inspect.StructType]:
    """Yield every struct within a type; a struct may be repeated."""
    inner: list[msgspec.inspect.Type] = []
    match wanted:
        case msgspec.inspect.StructType(fields=fields):
            yield wanted
            inner = [field.type for field in fields]
        case msgspec.inspect.UnionType(types=types):
            inner = list(types)
        case (
            msgspec.inspect.VarTupleType(item_type=item) | msgspec.inspect.ListType(item_type=item)
        ):
            inner = [item]
        case msgspec.inspect.DictType(value_type=value):
            inner = [value]
    for kind in inner:
        yield from structs(kind)


@pytest.mark.parametrize("name", SCHEMAS)
def test_objects_forbid_other_keys_and_describe_all_fields(name: str) -> None:
    for definition in schema(SCHEMAS[name])["$defs"].values():
        if definition.get("type") == "object":
            assert definition["additionalProperties"] is False, definition
            assert definition["description"]
    for struct in structs(msgspec.inspect.type_info(SCHEMAS[name])):
        docstring = inspect.getdoc(struct.cls) or ""
        undescribed = [
            field.encode_name
            for field in struct.fields
            if not re.search(rf"\b{field.encode_name}\b", docstring)
        ]
        assert not undescribed, struct.cls.__name__
        assert meanings(struct.cls).keys() == {field.name for field in struct.fields}, struct.cls


@pytest.mark.parametrize("record", SCHEMAS.values(), ids=list(SCHEMAS))
def test_example_is_valid_only_without_extra_keys(record: type[Record]) -> None:
    validator = jsonschema.Draft202012Validator(schema(record))
    good: Any = example(record)
    assert validator.is_valid(good)
    assert validator.is_valid(json.loads(msgspec.json.encode(msgspec.convert(good, record))))
    for path in paths(good):
        value = good
        for step in path:
            value = value[step]
        if isinstance(value, dict) and value.keys() != {"a"}:
            assert not validator.is_valid(replaced(good, path, {**value, "surprise": 1})), path


def test_results_name_their_schema() -> None:
    properties = schema(Results)["$defs"]["Results"]["properties"]
    assert properties["schema"]["enum"] == [5]


def test_pages_have_rows_for_fields_and_sections_for_links() -> None:
    pages = page_texts(PAGES)
    heading = re.compile(r"^## (\w+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    sections = {name: dict(heading.findall(text)) for name, text in pages.items()}
    homes = [struct for found in sections.values() for struct in found]
    assert len(homes) == len(set(homes))
    every = {name: text for found in sections.values() for name, text in found.items()}
    for page in PAGES:
        for record in page.records:
            for struct in structs(msgspec.inspect.type_info(record)):
                rows = re.findall(r"^\| `(\w+)` \|", every[struct.cls.__name__], re.MULTILINE)
                assert rows == [field.encode_name for field in struct.fields]
    for name, text in pages.items():
        for file, anchor in re.findall(r"\]\(([\w-]*\.md)?#(\w+)\)", text):
            assert anchor in {one.lower() for one in sections[file or name]}, (name, file, anchor)
        assert "None" not in text


def test_field_is_described_in_at_most_twenty_words() -> None:
    for page in PAGES:
        for record in page.records:
            for struct in structs(msgspec.inspect.type_info(record)):
                for field, meaning in meanings(struct.cls).items():
                    assert 0 < len(meaning.split()) <= 20, (struct.cls, field)
                    assert meaning[0].isupper() or meaning[0] in "`K", (struct.cls, field)


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


EXAMPLE: dict[str, Any] = example(Results)
TEXT = json.dumps(EXAMPLE)
DEEP = "[" * 5000 + "]" * 5000


def raw(path: tuple[str | int, ...], text: str) -> str:
    """Return the example with raw text in place of a value."""
    return json.dumps(replaced(EXAMPLE, path, "HERE")).replace('"HERE"', text)


def truncated() -> Iterator[tuple[str, str]]:
    for i in range(40):
        yield f"cut after {i}/40", TEXT[: i * len(TEXT) // 40]


def wrong_types() -> Iterator[tuple[str, str]]:
    for path in paths(EXAMPLE):
        value = value_at(EXAMPLE, path)
        wrong: Any = "x" if isinstance(value, (bool, int, float)) else 7
        yield f"{path} is {wrong!r}", json.dumps(replaced(EXAMPLE, path, wrong))
        if isinstance(value, (list, dict)):
            turned: Any = [value] if isinstance(value, dict) else {"a": value}
            yield f"{path} is turned", json.dumps(replaced(EXAMPLE, path, turned))


def missing_keys() -> Iterator[tuple[str, str]]:
    for path in required(msgspec.inspect.type_info(Results)):
        parent = dict(value_at(EXAMPLE, path[:-1]))
        del parent[str(path[-1])]
        yield f"{path} is missing", json.dumps(replaced(EXAMPLE, path[:-1], parent))


def extra_keys() -> Iterator[tuple[str, str]]:
    for path in paths(EXAMPLE):
        value = value_at(EXAMPLE, path)
        if isinstance(value, dict) and value.keys() != {"a"}:
            more = json.dumps(replaced(EXAMPLE, path, {**value, "surprise": 1}))
            yield f"{path} has more", more


def numeric_faults() -> Iterator[tuple[str, str]]:
    places: list[tuple[str | int, ...]] = [
        ("seconds",),
        ("cases", 0, "verdict", "discrepancy"),
        ("cases", 0, "series", "t", 0),
        ("systems", 0, "derivation", "linearizations", 0, "matrices", "a", 0, 0),
    ]
    for path in places:
        for text in ("NaN", "Infinity", "-Infinity", "1e999", "1" + "0" * 400, "0x10", "01", DEEP):
            yield f"{path} is {text[:12]}", raw(path, text)
    for text in ("1" + "0" * 400, "1.5", "true", "-1e400"):
        yield f"steps is {text[:12]}", raw(("cases", 0, "verdict", "steps"), text)


def twice() -> Iterator[tuple[str, str]]:
    for key in ("created", "cases", "verdict", "pose", "held"):
        yield f"{key} twice", TEXT.replace(f'"{key}":', f'"{key}": null, "{key}":', 1)
        value = json.dumps(next(value_at(EXAMPLE, p) for p in paths(EXAMPLE) if p and p[-1] == key))
        yield f"{key} twice alike", TEXT.replace(f'"{key}":', f'"{key}": {value}, "{key}":', 1)


def other_files() -> Iterator[tuple[str, str]]:
    for version in (0, 1, 2, 99, -1, "2", None, 1.5, [1]):
        yield f"schema {version}", json.dumps(EXAMPLE | {"schema": version})
    for text in ("", " ", "null", "1", '"results"', "[]", "{}", "[{}]", TEXT + TEXT, TEXT + "x"):
        yield f"text {text[:12]!r}", text
    yield "deep", DEEP
    yield "deep cases", '{"schema": 5, "cases": ' + DEEP + "}"
    yield "another record", '{"schema": 5, "summary": "", "rows": []}'


def unequal() -> Iterator[tuple[str, str]]:
    """Yield examples with columns of unequal length in a table, all keys being right."""
    case: tuple[str | int, ...] = ("cases", 0, "series")
    for path in (
        (*case, "t"),
        (*case, "components"),
        (*case, "reference"),
        (*case, "error", 0),
        (*case, "defect", 0),
        (*case, "segment_t"),
        (*case, "energy", "supplied"),
        (*case, "full_runs", "error"),
        (*case, "convergence", "rungs"),
        ("models", 0, "linearizations", 0, "frequencies"),
    ):
        value = value_at(EXAMPLE, path)
        yield f"{path} is longer", json.dumps(replaced(EXAMPLE, path, [*value, value[0]]))


def sketches() -> Iterator[tuple[str, str]]:
    for tree in (["exec", 1.0], ["q", 1], ["q", -1], ["^", 1.0], [], [1.0], True, None, [[0.5]]):
        path = ("systems", 0, "sketch", "shapes", 0, "radius")
        yield f"sketch {tree}", json.dumps(replaced(EXAMPLE, path, tree))
    shape = ("systems", 0, "sketch", "shapes", 0)
    yield "sketch nested", raw((*shape, "end"), '["sin", ' * 900 + "0" + "]" * 900)
    yield "sketch without a place", json.dumps(replaced(EXAMPLE, (*shape, "center"), [0.5]))


def texts() -> dict[str, str]:
    kinds = (
        truncated, wrong_types, missing_keys, extra_keys, numeric_faults, twice, other_files,
        unequal, sketches,
    )  # fmt: skip
    return {name: text for some in kinds for name, text in some()}


BYTES = {
    "no UTF-8": TEXT.encode().replace(b'"created": "a"', b'"created": "\xff"'),
    "overlong UTF-8": TEXT.encode().replace(b'"created": "a"', b'"created": "\xc0\xaf"'),
    "half a surrogate": TEXT.encode().replace(b'"created": "a"', b'"created": "\xed\xa0\x80"'),
    "half an escape": TEXT.encode().replace(b'"created": "a"', rb'"created": "\ud800"'),
    "UTF-16": TEXT.encode("utf-16"),
    "a mark first": b"\xef\xbb\xbf" + TEXT.encode(),
    "zeros": bytes(1000),
    "noise": bytes(range(256)),
}  # fmt: skip


def test_unmodified_example_is_read(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(TEXT)
    assert read_results(path).cases[0].verdict is not None


@pytest.mark.slow
def test_malformed_file_is_rejected_in_one_sentence_with_its_path(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "results.json"
    wrong, files = [], {name: text.encode() for name, text in texts().items()} | BYTES
    assert len(files) > 600
    for name, data in files.items():
        path.write_bytes(data)
        try:
            read_results(path)
            message = "read"
        except ResultsError as error:
            message = str(error)
        if "\n" in message or str(path) not in message or len(message) > 400:
            wrong.append((name, message[:300]))
    assert not wrong
    assert main(["report", str(path)]) == 2
    assert capsys.readouterr().err == f"crosscheck: {message}\n"
    assert not (tmp_path / "index.html").exists()


def test_path_that_is_not_a_file_is_rejected(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    for path in (tmp_path, *(tmp_path / name for name in ("none.json", "pipe", "loop"))):
        with pytest.raises(ResultsError, match="can't be read") as refused:
            read_results(path)
        assert str(path) in str(refused.value)
