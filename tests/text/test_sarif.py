"""SARIF: results that a code host shows at the lines of a file."""

import json
import re
from email.message import Message
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.checks.findings import source_line
from physics_crosscheck.harness.modelfiles.locations import find_in
from physics_crosscheck.harness.records.codes import codes
from physics_crosscheck.harness.results import sarif as sarif_module
from physics_crosscheck.harness.results.github import run_notes
from physics_crosscheck.harness.results.sarif import sarif
from physics_crosscheck.records import Cause, Diagnosis, Explanation, Outcome, SourceLine
from tests.records.made import case, finding, model, results
from tests.text.test_outputs import planted


def sarif_results(text: str) -> list[dict[str, Any]]:
    log = json.loads(text)
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    rules = [rule["id"] for rule in run["tool"]["driver"]["rules"]]
    for rule in run["tool"]["driver"]["rules"]:
        assert codes()[rule["id"]].remedy in rule["help"]["text"].replace("{{", "{").replace(
            "}}", "}"
        )
    assert rules == sorted({result["ruleId"] for result in run["results"]})
    assert run["columnKind"] == "unicodeCodePoints"
    for result in run["results"]:
        assert rules[result["ruleIndex"]] == result["ruleId"]
        assert result["level"] in ("error", "warning", "note")
        for place in [*result["locations"], *result.get("relatedLocations", [])]:
            _check_place(place["physicalLocation"])
        for fix in result.get("fixes", []):
            for change in fix["artifactChanges"]:
                _check_uri(change["artifactLocation"]["uri"])
                for replacement in change["replacements"]:
                    _check_region(replacement["deletedRegion"])
    return list(run["results"])


def _check_place(place: dict[str, Any]) -> None:
    _check_uri(place["artifactLocation"]["uri"])
    if "region" in place:
        _check_region(place["region"])


def _check_region(region: dict[str, Any]) -> None:
    assert region["startLine"] >= 1
    if "startColumn" in region:
        assert 1 <= region["startColumn"] < region["endColumn"]


def _check_uri(uri: str) -> None:
    """Section 3.4.3: a relative reference of RFC 3986, percent-encoded; or a file: URI."""
    assert re.fullmatch(r"(file://)?[A-Za-z0-9/_.~!$&'()*+,;=@%-]+", uri), uri


def apply_fix(fix: dict[str, Any], text: str) -> str:
    """Return a file's text with a fix applied as an editor does it."""
    lines = text.splitlines(keepends=True)
    (change,) = fix["artifactChanges"]
    last_first = sorted(
        change["replacements"],
        key=lambda replacement: (
            replacement["deletedRegion"]["startLine"],
            replacement["deletedRegion"]["startColumn"],
        ),
        reverse=True,
    )
    for replacement in last_first:
        region, line = replacement["deletedRegion"], replacement["deletedRegion"]["startLine"] - 1
        start, end = region["startColumn"] - 1, region["endColumn"] - 1
        lines[line] = (
            lines[line][:start] + replacement["insertedContent"]["text"] + lines[line][end:]
        )
    return "".join(lines)


def test_cause_and_finding_have_their_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models" / "disc").mkdir(parents=True)
    (tmp_path / "models" / "disc" / "mujoco.xml").write_text("")
    listed = sarif_results(sarif(planted()))
    assert {result["ruleId"] for result in listed} == {"XC201", "XC101"}
    for result in listed:
        (place,) = result["locations"]
        physical = place["physicalLocation"]
        assert physical["artifactLocation"]["uri"] == "models/disc/mujoco.xml"
        assert physical["region"]["startLine"] == 21


@pytest.mark.parametrize(
    ("urls", "address"),
    [
        (["Source, https://a.org", "Documentation, https://b.org/docs/"],
         "https://b.org/docs/messages/XC606.html"),
        (["documentation,https://b.org"], "https://b.org/messages/XC606.html"),
        (["Documentation, docs/index.md", "Source, https://a.org"], None),
        (None, None),
    ],
)  # fmt: skip
def test_rule_links_to_documentation_of_the_package(
    monkeypatch: pytest.MonkeyPatch, urls: list[str] | None, address: str | None
) -> None:
    installed = Message()
    for url in urls or ():
        installed["Project-URL"] = url
    monkeypatch.setattr(sarif_module, "metadata", {"physics-crosscheck": installed}.__getitem__)
    absent = results(case(Outcome.ABSENT, reason="pymunk is not installed"))
    (rule,) = json.loads(sarif(absent))["runs"][0]["tool"]["driver"]["rules"]
    assert rule.get("helpUri") == address


def test_agreeing_case_is_not_a_result() -> None:
    assert sarif_results(sarif(results(case()))) == []


def test_missing_engine_is_a_warning() -> None:
    (result,) = sarif_results(
        sarif(results(case(Outcome.ABSENT, reason="pymunk is not installed")))
    )
    assert (result["ruleId"], result["level"]) == ("XC606", "warning")


TEXT = """<mujoco>
  <!-- Stäbchen --> <a name="é" m="0.9"/>
  <b m="1.25"/> <c m="0.9"/>
  <d m="0.9"/>
</mujoco>
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "models" / "disc" / "mujoco.xml"
    path.parent.mkdir(parents=True)
    path.write_text(TEXT)
    return path


def places(file: Path, *addresses: str) -> tuple[SourceLine, ...]:
    spans = find_in(TEXT.encode(), file, addresses)
    return tuple(source_line(spans[address]) for address in addresses)


def copies(file: Path) -> Cause:
    addresses = ("a[é]@m", "c@m", "d@m")
    return Cause(
        kind="literals",
        subject=addresses,
        nominal=0.9,
        estimate=0.8,
        standard_error=1e-12,
        locations=places(file, *addresses),
    )


def diagnosed(*causes: Cause) -> Diagnosis:
    return Diagnosis(explained=True, explanations=(Explanation(causes=causes, remaining=0.0),))


def test_cause_of_several_lines_lists_and_fixes_all(file: Path) -> None:
    wrong = case(Outcome.DIFFERS, reason="x is off")
    seen = results(wrong, models=(model(text=TEXT, diagnosis=diagnosed(copies(file))),))
    (result,) = sarif_results(sarif(seen))
    regions = [place["physicalLocation"]["region"] for place in result["locations"]]
    assert [region["startLine"] for region in regions] == [2, 3, 4]
    assert "the motion implies 0.8" in result["message"]["text"]
    (fix,) = result["fixes"]
    assert apply_fix(fix, TEXT) == TEXT.replace('m="0.9"', 'm="0.8"')
    (note,) = run_notes(seen)
    assert (note.file, note.line) == (Path("models/disc/mujoco.xml"), 2)


def test_changed_file_or_partly_fixable_cause_has_no_fix(file: Path) -> None:
    wrong = case(Outcome.DIFFERS, reason="x is off")
    other = TEXT.replace('"0.9"/>', '"0.7"/>')
    changed = results(wrong, models=(model(text=other, diagnosis=diagnosed(copies(file))),))
    axis = Cause(kind="axis", subject=("j",), nominal=0.0, estimate=1.0, standard_error=0.0)
    half = results(wrong, models=(model(text=TEXT, diagnosis=diagnosed(copies(file), axis)),))
    for seen in (changed, half):
        (result,) = sarif_results(sarif(seen))
        assert "fixes" not in result
    assert len(result["locations"]) + len(result["relatedLocations"]) == 3


def test_finding_is_a_result_and_an_annotation_with_or_without_line(file: Path) -> None:
    (where,) = places(file, "b@m")
    literal = finding(
        "b@m is 1.25 where m = 1.5", subject=("b@m",), location=where, expected=1.5, actual=1.25,
        replacement="1.5",
    )  # fmt: skip
    term = finding("inertia of x is off", kind="inertia", subject=("x",), expected=1.0, actual=2.0)
    models = (
        model(literal, term, text=TEXT),
        model(literal, term, text=TEXT, engine="mjx"),
        model(engine="drake", audit=None, audit_failure="no memory is left"),
    )
    seen = results(case(), models=models)
    first, second, failed = sarif_results(sarif(seen))
    assert [result["ruleId"] for result in (first, second, failed)] == ["XC101", "XC121", "XC613"]
    assert first["message"]["text"].endswith("b@m is 1.25 where m = 1.5; write 1.5")
    assert first["locations"][0]["physicalLocation"]["region"]["startLine"] == 3
    assert apply_fix(first["fixes"][0], TEXT) == TEXT.replace("1.25", "1.5")
    for result in (second, failed):
        (place,) = result["locations"]
        uri = {"uri": "models/disc/mujoco.xml"}
        assert place["physicalLocation"] == {"artifactLocation": uri}, "no line is invented"
    assert [note.line for note in run_notes(seen)] == [3, None, None]


def test_rejected_file_is_a_result_with_its_lines(file: Path) -> None:
    lines = tuple(SourceLine(file=str(file), line=line) for line in (3, 4))
    refused = case(Outcome.FAILED, reason="no mass", locations=lines)
    (result,) = sarif_results(sarif(results(refused)))
    both = [*result["locations"], *result["relatedLocations"]]
    assert [place["physicalLocation"]["region"]["startLine"] for place in both] == [3, 4]
