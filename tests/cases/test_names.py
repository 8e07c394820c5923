"""Names that look like our own words go through a whole run."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.harness.records.read import read_results
from tests.commands import crosscheck
from tests.faults.known_folder import ROOT, one_scenario
from tests.standing import brief


@pytest.mark.slow
def test_a_body_called_nut_and_bolt_with_a_wrong_mass_is_named_with_its_line(
    tmp_path: Path,
) -> None:
    folder = one_scenario("mass_spring_damper", tmp_path / "bolted", "free")
    brief(folder)
    for name in ("mujoco.xml", "mujoco.xml.toml"):
        text = (ROOT / "models" / "mass_spring_damper" / name).read_text()
        assert "body[mass]" in text or 'name="mass"' in text
        text = text.replace("body[mass]", "body[nut and bolt]")
        text = text.replace('body name="mass"', 'body name="nut and bolt"')
        (folder / name).write_text(text.replace('mass="1.3', 'mass="1.313'))
    done = crosscheck(
        "run",
        folder,
        "--engine",
        "mujoco",
        "-k",
        "mujoco.xml",
        "--out",
        "out",
        "--jobs",
        "1",
        cwd=tmp_path,
    )
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    lines = (folder / "mujoco.xml").read_text().splitlines()
    line = next(i for i, text in enumerate(lines, 1) if 'mass="1.313' in text)
    told = "body[nut and bolt]/inertial@mass is 1.313; the motion implies 1.3"
    assert told in done.stdout
    assert f"change bolted/mujoco.xml:{line} from 1.313 to 1.3" in done.stdout
    found = read_results(tmp_path / "out" / "results.json").models
    (model,) = (one for one in found if one.engine == "mujoco")
    assert model.diagnosis is not None
    assert model.diagnosis.explained
    (cause,) = model.diagnosis.explanations[0].causes
    assert cause.id == CauseId(kind="literal", subject=("body[nut and bolt]/inertial@mass",))
    assert [place.line for place in cause.locations] == [line]
    assert "nut and bolt" in (tmp_path / "out" / "index.html").read_text()
