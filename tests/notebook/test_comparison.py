"""`compare` as a value: the wrong number with its line, as record, table, text and page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from physics_crosscheck import CompareError, Comparison, compare
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records import comparison
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Outcome
from tests.compare.asking import changed

MODEL = builtin() / "simple_pendulum" / "mujoco.xml"


@pytest.fixture(scope="module")
def heavier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("heavier")
    return changed(folder, MODEL, ('mass="0.45"', 'mass="0.4501"'))


@pytest.fixture(scope="module")
def differing(heavier: Path) -> Comparison:
    return compare("simple_pendulum/mujoco.xml", heavier)


def test_two_files_of_one_mechanism_agree_without_differences() -> None:
    same = compare("simple_pendulum/robot.urdf", MODEL, engine="mujoco")
    assert same
    assert same.agree
    assert same.compared is not None
    assert same.compared.uncertainty is not None
    assert same.compared.uncertainty < 1e-10
    assert not [one for one in same.differences if one.moves]
    assert "AGREES" in same._repr_html_()


def test_wrong_number_is_named_with_its_line(differing: Comparison, heavier: Path) -> None:
    assert not differing
    assert differing.outcome is Outcome.DIFFERS
    mass = next(one for one in differing.differences if one.source == "file")
    assert (mass.kind, mass.about, mass.a, mass.b) == ("mass", "pendulum", 0.45, 0.4501)
    line = next(one for one in differing.differences if one.source == "line" and one.moves)
    assert (line.kind, line.a, line.b) == ("body[pendulum]/inertial@mass", "0.45", "0.4501")
    assert line.share == pytest.approx(1, abs=0.01)
    assert line.where_b is not None
    assert line.where_b.line is not None
    assert Path(line.where_b.file) == heavier
    assert 'mass="0.4501"' in heavier.read_text().splitlines()[line.where_b.line - 1]


def test_table_and_page_have_the_same_content(differing: Comparison) -> None:
    pytest.importorskip("pandas")
    frame = differing.to_frame()
    assert len(frame) == len(differing.differences)
    (row,) = frame[frame.source == "line"].to_dict("records")
    assert (row["a"], row["b"], row["moves"]) == ("0.45", "0.4501", True)
    assert row["where_b"].endswith("mujoco.xml:38")
    html = differing._repr_html_()
    ElementTree.fromstring(html)
    for text in ("DIFFERS", "body[pendulum]/inertial@mass", "0.4501", "mujoco.xml:38"):
        assert text in html


def test_text_equals_terminal_output_and_record_equals_json_output(
    differing: Comparison,
) -> None:
    assert "mujoco.xml:38" in str(differing)
    assert repr(differing) == str(differing)
    record = comparison.ComparisonResult
    assert set(record.__struct_fields__) == set(Comparison.__struct_fields__)
    assert json.loads(encoded(differing))["outcome"] == "DIFFERS"


def test_joints_are_mapped_and_starts_are_given(tmp_path: Path) -> None:
    other = changed(tmp_path, MODEL, ('<joint name="theta"', '<joint name="phi"'))
    Path(f"{other}.toml").unlink()
    plain = tmp_path / "plain.xml"
    plain.write_text(MODEL.read_text())
    comparison = compare(plain, other, joints={"theta": "phi"}, starts=[{"theta": 0.5}])
    assert comparison.agree, str(comparison)


ARM = """\
<mujoco>
  <option timestep="0.002" gravity="0 0 -9.81"/>
  <worldbody>
    <body>
      <joint name="hip" axis="0 1 0"/>
      <inertial pos="0 0 -0.2" mass="1.2" diaginertia="0.016 0.016 0.001"/>
      <body pos="0 0 -0.4">
        <joint name="knee" axis="0 1 0"/>
        <inertial pos="0 0 -0.15" mass="0.7" diaginertia="0.005 0.005 0.0004"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_page_reports_reversed_joint(tmp_path: Path) -> None:
    arm, turned = tmp_path / "arm.xml", tmp_path / "turned.xml"
    arm.write_text(ARM)
    turned.write_text(ARM.replace('name="knee" axis="0 1 0"', 'name="knee" axis="0 -1 0"'))
    apart = compare(arm, turned)
    assert not apart
    assert apart.compared is not None
    assert apart.compared.turned == ("knee",)
    assert "knee turns the other way in B (mapped so, " in apart._repr_html_()


def test_errors_name_python_parameters(tmp_path: Path) -> None:
    with pytest.raises(CompareError, match=r"nowhere\.xml: there is no such file"):
        compare("nowhere.xml", MODEL)
    with pytest.raises(CompareError, match="choose another with engine_a=") as error:
        compare(MODEL, MODEL, engine="pymunk")
    assert "--" not in str(error.value)
    with pytest.raises(ValueError, match="resolution must be a number"):
        compare(MODEL, MODEL, resolution=0)
    with pytest.raises(CompareError, match="theta starts at inf"):
        compare(MODEL, MODEL, starts=[{"theta": float("inf")}])


@pytest.mark.parametrize(("given", "message"), [
    ({"b": None}, "b must be a path, not None"),
    ({"engine": ["mujoco"]}, r"engine must be a string, not \['mujoco'\]"),
    ({"joints": 5}, "joints is 5, expected joints of A by those of B"),
    ({"joints": {"theta": 5}}, "joints is .* expected joints of A by those of B"),
    ({"starts": {"theta": 1.0}}, "starts is .* expected a list of states"),
    ({"limit": "long"}, "limit must be a number of seconds, not 'long'"),
])  # fmt: skip
def test_argument_of_wrong_type_is_rejected(given: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        compare(**{"a": MODEL, "b": MODEL, **given})


def test_failing_engine_gives_outcome_failed_with_reason(tmp_path: Path) -> None:
    broken = tmp_path / "broken.xml"
    broken.write_text('<mujoco><worldbody><body><joint name="theta"/></body></worldbody></mujoco>')
    comparison = compare(broken, MODEL)
    assert comparison.outcome is Outcome.FAILED
    assert not comparison.agree
    assert "broken.xml" in comparison.reason
    assert comparison.differences == ()
    assert "FAILED" in comparison._repr_html_()
