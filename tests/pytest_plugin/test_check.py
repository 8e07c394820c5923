"""`check`, the function for people who write their own tests."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from harness import check
from harness.engines.pymunk import PymunkEngine
from harness.files.folders import FolderError, builtin
from harness.records.outcome import Outcome
from harness.records.results import Results
from harness.records.schema import schema
from harness.records.write import encoded
from harness.text.failure import diagnosis_lines
from harness.text.findings import audit_lines
from tests.standing import brief, standing_only

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model with a wrong stiffness beside a sound one."""
    folder = tmp_path / "mine"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    standing_only(folder)
    brief(folder)
    path = folder / "mujoco.xml"
    path.write_text(path.read_text().replace('stiffness="47.0"', 'stiffness="47.000047"'))
    return folder


def test_results_agree_have_numbers_and_follow_the_schema() -> None:
    result = check("free_pair", engines=["pymunk"])
    assert result
    assert result.agree
    assert {case.engine for case in result.cases} == {"pymunk"}
    case = result.case(result.cases[0].scenario)
    assert case.outcome is Outcome.AGREES
    assert case.verdict is not None
    assert case.full_run is not None
    known = case.verdict.discrepancy, case.verdict.uncertainty, case.full_run.global_error
    e, u, error = (-1.0 if value is None else value for value in known)
    assert 0 < e < u < 1e-9
    assert 0 < error < 1
    assert "AGREES; all that agree do so to" in str(result)
    jsonschema.validate(json.loads(encoded(result)), schema(Results))


def test_a_wrong_model_does_not_agree_and_the_text_says_why(folder: Path) -> None:
    result = check(folder, engines=["mujoco"])
    assert not result
    assert not result.agree
    case = result.case("free", model="mujoco.xml")
    assert case.outcome is Outcome.DIFFERS
    assert not case.passes
    assert result.case("free", model="robot.urdf").passes
    wrong = next(model for model in result.models if model.model == "mujoco.xml")
    assert not wrong.passes
    assert wrong.diagnosis is not None
    assert "joint[x]@stiffness (mujoco.xml:" in diagnosis_lines(wrong.diagnosis)[0]
    assert "joint[x]@stiffness is 47.000047" in audit_lines(wrong.findings)[0]
    text = str(result)
    assert text == repr(result)
    assert "mass_spring_damper/mujoco.xml/free [mujoco]\nDIFFERS: x_dot ends" in text
    assert "the motion wants 47 ±" in text
    assert "Traceback" not in text
    for wanted in ({"scenario": "free"}, {"scenario": "nothing"}):
        with pytest.raises(LookupError, match=r"mass_spring_damper/robot.urdf/free \[mujoco\]"):
            result.case(**wanted)


def test_an_engine_that_is_not_installed_never_agrees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PymunkEngine, "version", lambda _: None)
    result = check("torsional_disc", engines=["pymunk"])
    assert {case.outcome for case in result.cases} == {Outcome.ABSENT}
    assert not result.agree
    assert "pymunk is not installed" in str(result)


def test_wrong_arguments_are_refused_by_name() -> None:
    with pytest.raises(FolderError, match="nowhere: no such folder"):
        check("nowhere")
    with pytest.raises(FolderError, match="no engine 'havok' is known"):
        check("torsional_disc", engines=["havok"])
    with pytest.raises(ValueError, match="is not between"):
        check("torsional_disc", resolution=0)


@pytest.mark.slow
def test_a_script_without_a_guard_may_call_it() -> None:
    script = "from harness import check\n"
    script += "print(check('torsional_disc', engines=['pymunk'], jobs=1).agree)\n"
    done = subprocess.run(
        [sys.executable, "-"], input=script, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stdout == "True\n", done.stderr


def test_the_package_imports_nothing_before_it_is_asked_to() -> None:
    told = "import sys, harness; print([m for m in sys.modules if m.startswith('harness')])"
    done = subprocess.run(
        [sys.executable, "-c", told], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "['harness']\n"
    assert callable(check)
