"""The badge: as a picture, in words, and for shields.io."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.html.badge import message, picture, shields, write_badge
from tests.records.made import case, results

DIFFERS = case(Outcome.DIFFERS, scenario="far")


def test_badge_states_agreement_or_problems() -> None:
    assert message(results(case(), case(scenario="far"))) == (
        "2 of 2 agree to 11.3 digits",
        "green",
    )
    assert message(results(case(), DIFFERS)) == ("1 differ of 2", "orange")
    accepted = case(Outcome.DIFFERS, accepted="soft")
    assert message(results(case(), accepted)) == ("1 of 2 agree to 11.3 digits", "green")
    failed = case(Outcome.FAILED, engine="x")
    assert message(results(DIFFERS, failed)) == ("1 failed, 1 differ of 2", "orange")
    assert message(results(case(Outcome.ABSENT)))[0] == message(results())[0] == "nothing tested"


def test_picture_is_small_and_has_text() -> None:
    svg = picture(results(case(), DIFFERS))
    root = ET.fromstring(svg)
    assert root.attrib["aria-label"] == "crosscheck: 1 differ of 2"
    assert [one.text for one in root.iter() if one.tag.endswith(("title", "text"))] == [
        "crosscheck: 1 differ of 2", "crosscheck", "1 differ of 2",
    ]  # fmt: skip
    assert len(svg) < 1000
    assert "http" not in svg.replace("http://www.w3.org/2000/svg", "")


def test_file_name_selects_the_format(tmp_path: Path) -> None:
    run = results(case())
    for name in ("badge.json", "badge.svg"):
        write_badge(tmp_path / name, run)
    assert json.loads((tmp_path / "badge.json").read_text()) == {
        "schemaVersion": 1, "label": "crosscheck", "message": "1 of 1 agree to 11.3 digits",
        "color": "brightgreen",
    }  # fmt: skip
    assert (tmp_path / "badge.svg").read_text() == picture(run)
    assert (tmp_path / "badge.json").read_text() == shields(run)
