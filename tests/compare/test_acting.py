"""Two files side by side: what their numbers act as, and the usual mistake that explains it."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main

ARM = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body pos="0 0 2"><joint name="hinge" axis="0 1 0"/>
<geom name="arm" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1" friction="0.7"/>
</body></worldbody><actuator><position joint="hinge" kp="20" dampratio="1"/></actuator></mujoco>"""


@pytest.mark.parametrize(("old", "new", "words"), [
    ('kp="20" dampratio="1"', 'kp="0.3490658503988659" dampratio="1"',
     "natural frequency 2.431 Hz in A, 0.3211 Hz in B: the gain of B is per degree"),
    (' dampratio="1"', "", "damping ratio 1 in A, 0 in B: the damping of B is lost"),
    ('size="1 1 1"', 'size="1 1 1" friction="0.7"',
     "friction 1 in A, 0.7 in B: the friction of B is the product of the two of the other file"),
    ('friction="0.7"', 'friction="1.7"', "floor with arm: friction 1 in A, 1.7 in B"),
])  # fmt: skip
def test_a_usual_mistake_is_named(
    old: str, new: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.xml").write_text(ARM)
    (tmp_path / "b.xml").write_text(ARM.replace(old, new))
    main(["compare", str(tmp_path / "a.xml"), str(tmp_path / "b.xml"), "--engine", "mujoco"])
    assert words in " ".join(capsys.readouterr().out.split())


def test_equal_files_have_no_such_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.xml").write_text(ARM)
    (tmp_path / "b.xml").write_text(ARM.replace('name="arm"', 'name="arm" rgba="1 0 0 1"'))
    main(["compare", str(tmp_path / "a.xml"), str(tmp_path / "b.xml"), "--engine", "mujoco"])
    assert "act as" not in capsys.readouterr().out
