"""Remarks of engines on a model are reported with file and line."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import Array, LoadedModel, Remark
from physics_crosscheck.harness.checks.audit import where
from physics_crosscheck.harness.engines.mujoco import MujocoModel
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.records import SourceLine
from tests.audit.models import MODELS, AuditCopy, messages


def test_remark_of_a_model_is_reported_with_its_line(
    audit_copy: AuditCopy, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def remarks(self: LoadedModel, z: Array, w: Array) -> Iterator[Remark]:
        yield Remark(message="a word")
        yield Remark(message="a number", address="body/joint[theta]@damping", value=2.0)
        yield Remark(message="the file", address="")

    monkeypatch.setattr(MujocoModel, "remarks", remarks)
    findings = [
        f for f in audit_copy("simple_pendulum", "mujoco.xml", "mujoco") if f.kind == "default"
    ]
    assert [f.message for f in findings] == ["a word", "a number", "the file"]
    assert findings[0].location is None
    assert [f.location and Path(f.location.file).name for f in findings[1:]] == ["mujoco.xml"] * 2
    assert findings[1].location is not None
    assert findings[1].location.line is not None
    assert findings[2].location == SourceLine(file=str(tmp_path / "mujoco.xml"))


def test_model_without_remarks_yields_none() -> None:
    silent: Any = None
    assert tuple(LoadedModel.remarks(silent, np.zeros((1, 1)), np.zeros((1, 1)))) == ()


SWITCHED_ON = [
    ("link_damping = 0.04", "damping of links", "link damping (0.04)", False),
    ("motors = true", "motors", "joint motors", True),
    ("inertia_from_file = false", "inertias of collision shapes", "inertia from", False),
]


@pytest.mark.parametrize(("setting", "called", "part", "fault"), SWITCHED_ON)
def test_pybullet_default_left_on_by_a_setting_is_reported_as_on(
    audit_copy: AuditCopy, setting: str, called: str, part: str, fault: bool
) -> None:
    change = ("[settings]\n", f"[settings]\n{setting}\n")
    findings = audit_copy("simple_pendulum", "robot.urdf", "pybullet", change)
    off = next(f for f in findings if "are switched off by the adapter" in f.message)
    for _, _, other, _ in SWITCHED_ON:
        assert (other in off.message) == (other != part)
    assert "speed limit" in off.message
    on = next(f for f in findings if "left on" in f.message)
    assert on.message.startswith(f"PyBullet's own {called}, left on by the setting")
    assert on.location is not None
    toml = Path(on.location.file)
    assert toml.name == "robot.urdf.toml"
    assert toml.read_text().splitlines()[(on.location.line or 0) - 1] == setting
    if fault:
        assert on.severity == "finding"


def test_pybullet_defaults_are_reported_as_switched_off(audit_copy: AuditCopy) -> None:
    findings = audit_copy("simple_pendulum", "robot.urdf", "pybullet")
    off = next(f for f in findings if "are switched off" in f.message)
    assert off.message == (
        "PyBullet's own link damping (0.04), joint motors, speed limit, inertia from collision"
        " shapes and gravity are switched off by the adapter"
    )
    assert not any("left on" in f.message for f in findings)


def test_damping_set_by_the_sidecar_is_reported_with_its_line(audit_copy: AuditCopy) -> None:
    findings = audit_copy(
        "simple_pendulum", "space.py", "pymunk", ("[settings]\n", "[settings]\ndamping = 0.99\n")
    )
    damped = next(f for f in findings if "Space.damping is 0.99" in f.message)
    assert "space.py.toml:" in str(damped.location)


def line_with(file: Path, text: str) -> int:
    """Return the number, counted from 1, of the only line that contains a text."""
    (number,) = [i for i, line in enumerate(file.read_text().splitlines(), 1) if text in line]
    return number


def test_gravity_in_a_comment_is_ignored(audit_copy: AuditCopy) -> None:
    changes = (('gravity="0 0 -9.81"', ""), ("<worldbody>", '<!-- gravity="0" -->\n<worldbody>'))
    findings = audit_copy("simple_pendulum", "mujoco.xml", "mujoco", *changes)
    assert "the file sets no gravity" in messages(findings, "default", "note")


def test_gravity_of_an_included_file_counts(audit_copy: AuditCopy, tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text('<mujoco><option gravity="0 0 -9.81"/></mujoco>')
    changes = (
        ('gravity="0 0 -9.81"', ""),
        ("<worldbody>", '<include file="own.xml"/>\n<worldbody>'),
    )
    findings = audit_copy("simple_pendulum", "mujoco.xml", "mujoco", *changes)
    assert "the file sets no gravity" not in messages(findings, "default", "note")


def test_engine_setting_is_located_in_the_table_of_the_engine() -> None:
    sidecar = read_sidecar(MODELS / "drum_pendulum" / "mujoco.xml.toml")
    shared = replace(sidecar, settings={"step": 1.0}, engine_settings={"mujoco": {"step": 2.0}})
    assert where(Remark(message="", address=None), shared, "mujoco") is None
    missing = Remark(message="", address="sidecar:settings.step")
    assert where(missing, shared, "mujoco") == SourceLine(file=f"{sidecar.model}.toml")


def test_gravity_overridden_by_a_sidecar_is_reported_with_both_lines(
    audit_copy: AuditCopy, tmp_path: Path
) -> None:
    change = ("[bindings]", "[settings]\ngravity = [0, 0, -1.62]\n\n[bindings]")
    findings = audit_copy("simple_pendulum", "mujoco.xml", "mujoco", change)
    (finding,) = [f for f in findings if "overrides" in f.message]
    file, sidecar = tmp_path / "mujoco.xml", tmp_path / "mujoco.xml.toml"
    assert finding.location == SourceLine(file=str(file), line=line_with(file, "gravity="))
    assert "0 0 -9.81" in finding.message
    assert finding.message.endswith(f"({sidecar}:{line_with(sidecar, 'gravity =')})")
    assert finding.severity == "finding"  # the equations have another value
