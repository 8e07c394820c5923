"""Proposed changes as diffs that can be applied."""

import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest

from physics_crosscheck.harness.checks.findings import source_line
from physics_crosscheck.harness.modelfiles.locations import find_in
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.html.remedies import lines_of, unified
from physics_crosscheck.harness.results.next_steps import ProposedChange
from physics_crosscheck.records import Outcome, SourceLine
from tests.records.made import case, finding, model, results

URDF = """<robot>
  <link name="rod">
    <inertial>
      <mass value="0.9"/>
      <inertia ixx="0.024" iyy="0.024" izz="0.0001" ixy="0"/>
      <origin xyz="0 0 -0.3" rpy="0 0 0"/>
    </inertial>
  </link>
</robot>
"""
SIDECAR = "[settings]\nstep = 0.01\ngravity = [0, 0, -9.8]"


def located(address: str, file: Path, text: str) -> SourceLine:
    """Return a number's line with its byte range."""
    return source_line(find_in(text.encode(), file, [address])[address])


def edit(subject: str | tuple[str, ...], new: str, text: str = URDF) -> ProposedChange:
    addresses = (subject,) if isinstance(subject, str) else subject
    file = Path("models/disc/robot.urdf")
    places = tuple(located(one, file, text) for one in addresses)
    return ProposedChange(subject=addresses, locations=places, old=float(places[0].text), new=new)


def patched(*edits: ProposedChange, text: str = URDF) -> str:
    return unified(edits, (("robot.urdf", text), ("robot.urdf.toml", SIDECAR)))


MASS = edit("link[rod]/inertial/mass@value", "0.8")
(LINE,) = MASS.locations


def test_patch_changes_only_the_number() -> None:
    patch = patched(MASS)
    assert patch.startswith("--- a/models/disc/robot.urdf\n+++ b/models/disc/robot.urdf\n@@ -1,7 ")
    assert lines_of(patch) == ('- <mass value="0.9"/>', '+ <mass value="0.8"/>')


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_git_applies_patch_of_file_and_sidecar_without_final_newline(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "disc"
    folder.mkdir(parents=True)
    (folder / "robot.urdf").write_text(URDF)
    (folder / "robot.urdf.toml").write_text(SIDECAR)
    where = located("settings.gravity[2]", Path("models/disc/robot.urdf.toml"), SIDECAR)
    subject = ("sidecar:settings.gravity[2]",)
    gravity = ProposedChange(subject=subject, locations=(where,), old=-9.8, new="-9.81")
    patch = patched(MASS, gravity)
    subprocess.run(["git", "apply", "-"], input=patch, text=True, cwd=tmp_path, check=True)
    assert (folder / "robot.urdf").read_text() == URDF.replace("0.9", "0.8")
    assert (folder / "robot.urdf.toml").read_text() == SIDECAR.replace("-9.8]", "-9.81]")


def test_patch_distinguishes_equal_numbers_in_a_line() -> None:
    single = edit("link[rod]/inertial/inertia@iyy", "0.03")
    assert lines_of(patched(single))[1] == (
        '+ <inertia ixx="0.024" iyy="0.03" izz="0.0001" ixy="0"/>'
    )
    both = edit(("link[rod]/inertial/inertia@ixx", "link[rod]/inertial/inertia@iyy"), "0.03")
    assert 'ixx="0.03" iyy="0.03" izz="0.0001"' in lines_of(patched(both))[1]


@pytest.mark.parametrize(
    "uncertain",
    [
        replace(MASS, locations=(SourceLine(file=LINE.file, line=4, span=LINE.span, text="0.7"),)),
        replace(
            MASS, locations=(SourceLine(file=LINE.file, line=99, span=(9000, 9003), text="0.9"),)
        ),
        replace(MASS, locations=(SourceLine(file=LINE.file, line=4),)),
        replace(MASS, locations=(SourceLine(file="other.urdf", span=LINE.span, text="0.9"),)),
        replace(MASS, locations=(LINE, SourceLine(file=LINE.file, line=4))),
    ],
)
def test_uncertain_change_makes_no_patch(uncertain: ProposedChange) -> None:
    """Reject a changed number, a wrong or missing byte range, another file, or a partial fix."""
    assert patched(uncertain) == ""
    other = edit("link[rod]/inertial/origin@xyz[2]", "-0.4")
    assert patched(other, uncertain) == ""


def test_absolute_path_becomes_a_file_name() -> None:
    where = SourceLine(file="/models/disc/robot.urdf", line=4, span=LINE.span, text="0.9")
    patch = patched(replace(MASS, locations=(where,)))
    assert patch.startswith("--- a/robot.urdf\n+++ b/robot.urdf\n")


NAMES = ["rod is long", "a | b", 'it\'s "so"', "Stäbchen 杆", "x\u2028y", "::error::x", "50% [b]"]
"""Names with separators of sentences, tables, markup and lines."""


class _Buttons(HTMLParser):
    """The texts that the buttons of a page copy."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.texts += [value or "" for name, value in attrs if name == "data-copy"]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("name", NAMES)
def test_copied_patch_applies_with_unusual_names(
    name: str, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "my models" / "robot.urdf"
    file.parent.mkdir()
    # Two links have the same mass; an address quotes none of the characters.
    text = URDF.replace('"rod"', quoteattr(name)).replace("<robot>", "<robot>\n<!-- 0.9 -->")
    text = text.replace("\n", end)
    file.write_bytes(text.encode())
    where = located("mass@value", file, text)
    wrong = finding(
        f"link[{name}]/inertial/mass@value is 0.9 where m = 0.8",
        subject=(f"link[{name}]/inertial/mass@value",), location=where, expected=0.8, actual=0.9,
        replacement="0.8",
    )  # fmt: skip
    folder = str(file.parent)
    wrong_model = model(wrong, model="robot.urdf", folder=folder, text=text)
    seen = results(case(Outcome.AGREES, model="robot.urdf", folder=folder), models=(wrong_model,))
    write_report(tmp_path / "index.html", seen)
    page = _Buttons()
    page.feed((tmp_path / "index.html").read_bytes().decode())
    (patch,) = {copied for copied in page.texts if copied.startswith("--- ")}
    for tool in (["git", "apply", "-"], ["patch", "--binary", "-p1"]):
        if shutil.which(tool[0]) is None:
            continue
        file.write_bytes(text.encode())
        subprocess.run(tool, input=patch.encode(), cwd=tmp_path, check=True)
        assert file.read_bytes() == text.replace('value="0.9"', 'value="0.8"').encode()
