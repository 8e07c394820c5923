"""Faults that joint motions cannot show are reported by the comparison of poses."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from tests.poses.arm import (
    FRAMES,
    LINKS,
    SETTINGS,
    SWING,
    SWING_MJCF,
    URDF,
    message,
    poses,
    without_frames,
)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_links_of_a_correct_urdf_match_the_equations(engine: str, tmp_path: Path) -> None:
    check = poses(tmp_path, engine=engine, file="arm.urdf", text=URDF, sidecar=SETTINGS + LINKS)
    assert check.findings == ()
    assert [one.name for one in check.record.frames] == ["post", "arm", "tool", "tip"]
    assert all(one.agrees and (one.position or 0) < 1e-14 for one in check.record.frames)
    assert check.record.states == 84


def test_bodies_and_sites_of_a_correct_mjcf_match_the_equations(tmp_path: Path) -> None:
    check = poses(tmp_path)
    assert check.findings == ()
    assert check.record.frames[3].rotation is None  # a point is not turned
    assert (check.record.uncertainty or 1) < 1e-12


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([('axis="0 -1 0"', 'axis="0 1 0"')],
         "arm (body:arm), tool (site:tool), tip (site:tool): off by up to 1.6 m and 173 degrees"
         " from the equations' pose"),
        ([('axis="0 -1 0"', 'axis="0 1 0"')], "as if b had the other sign: an axis is flipped"),
        # The base is moved.
        ([('pos="0 0 0"><joint', 'pos="0 2.5 0"><joint')], "moved by (0, 2.5, 0) m in the world"),
        # The whole arm is turned by 90 degrees.
        ([('name="post" pos="0 0 0"', 'name="post" pos="0 0 0" euler="1.5707963267948966 0 0"')],
         "turned in the world by 90 degrees about x"),
        # The tool is moved or turned in its body.
        ([('pos="0 0 -0.8"', 'pos="0.1 0 -0.8"')],
         "tool (site:tool), tip (site:tool): off by up to 0.1 m from the equations' pose"),
        ([('pos="0 0 -0.8"', 'pos="0.1 0 -0.8"')], "offset by (0.1, 0, 0) m in its body's axes"),
        ([('euler="0.3 0 0"', 'euler="0.3 0 0.5"')],
         "its axes are turned by 28.65 degrees about z"),
        # A length is off by 1e-8.
        ([('pos="0 0 -0.8"', 'pos="0 0 -0.80000001"')], "up to 1e-08 m"),
    ],
)  # fmt: skip
def test_pose_faults_are_reported(
    changes: list[tuple[str, str]], words: str, tmp_path: Path
) -> None:
    assert words in message(poses(tmp_path, *changes))


def test_flipped_axis_compensated_in_the_sidecar_differs(
    tmp_path: Path,
) -> None:
    """Joint space agrees: b of the file is -b of the equations, and the axis points the right way;
    the other way round, the mechanism is its mirror image."""
    compensated = '[coordinates]\nb = "-b"\n[readback]\nb = "-b"\n' + FRAMES
    both = poses(tmp_path, ('axis="0 -1 0"', 'axis="0 1 0"'), sidecar=compensated)
    assert both.findings == ()
    assert "as if b had the other sign" in message(poses(tmp_path, sidecar=compensated))


def test_rotated_plane_of_motion_is_reported(tmp_path: Path) -> None:
    """About -y in the equations, about x in the file: in joint space the same pendulum."""
    sidecar = '[frames]\nrod = "body:rod"\nend = { is = "body:rod", at = [0, 0, "-l"] }\n'
    assert poses(tmp_path, text=SWING_MJCF, sidecar=sidecar, system=SWING).findings == ()
    turned = poses(
        tmp_path,
        ('axis="0 -1 0"', 'axis="1 0 0"'),
        text=SWING_MJCF,
        sidecar=sidecar,
        system=SWING,
    )
    assert message(turned).endswith("; its motion is turned by 90 degrees about z")
    moved = poses(
        tmp_path,
        ('axis="0 -1 0"', 'pos="0 0 0" axis="0 1 0"'),
        ('name="rod"', 'name="rod" pos="0 0 3"'),
        text=SWING_MJCF,
        sidecar=sidecar,
        system=SWING,
    )
    assert "an axis is flipped, and moved by (0, 0, 3) m in the world" in message(moved)


def test_world_frame_of_the_sidecar_is_applied(tmp_path: Path) -> None:
    """Rotate the mechanism and move it up a metre: it agrees once the sidecar declares it."""
    aside = ('name="post" pos="0 0 0"', 'name="post" pos="0 0 1" euler="1.5707963267948966 0 0"')
    world = FRAMES.replace(
        "[frames]\n", '[frames]\nworld = { axes = ["x", "-z", "y"], origin = [0, 0, 1] }\n'
    )
    plain = "turned in the world by 90 degrees about x, and moved by (0, 0, 1) m in the world"
    assert plain in message(poses(tmp_path, aside))
    converted = world.replace('is = "body:post"', 'is = "body:post", axes = ["x", "y", "z"]')
    for name, place in (("arm", "body:arm"), ("tool", "site:tool"), ("tip", "site:tool")):
        converted = converted.replace(
            f'{name} = "{place}"', f'{name} = {{ is = "{place}", axes = ["x", "y", "z"] }}'
        )
    assert poses(tmp_path, aside, sidecar=converted).findings == ()


def test_unknown_frame_is_reported_with_the_available_ones(tmp_path: Path) -> None:
    with pytest.raises(SidecarError) as error:
        poses(tmp_path, ('tool = "site:tool"', 'tool = "body:hand"'))
    assert str(error.value) == (
        f"{tmp_path / 'arm.xml.toml'}:5: [frames] tool: the model has no 'body:hand'; it has"
        " body:world, body:post, body:arm"
    )


@pytest.mark.parametrize(
("entry", "words"),
    [
        ('hand = "body:arm"', "hand is not a frame of arm; it declares post, arm, tool, tip"),
        ("arm = 3", 'arm must name the frame in the file, as in "body:rod"'),
        ('arm = { at = [0, 0, 0] }', "arm must name the frame in the file"),
        ('arm = { is = "body:arm", at = [0, 0] }', "at is [0, 0]; expected three lengths"),
        ('arm = { is = "body:arm", at = [0, 0, "1/0"] }', "at"),
        ('arm = { is = "body:arm", at = [0, 0, "q"] }', "q is neither a coordinate nor a constant"),
        ('arm = { is = "body:arm", by = 3 }', 'arm must name the frame in the file, as in'),
        ('world = { axes = ["x", "y", "-z"] }', "remove the mirror"),
        ('world = { axes = ["x", "y"] }', "expected three axes"),
        ('world = "x, z, -y"', "world must be a table with axes, origin or both"),
    ],
)  # fmt: skip
def test_invalid_frame_entry_is_rejected(entry: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(SidecarError) as error:
        poses(tmp_path, sidecar=f"[frames]\n{entry}\n")
    assert words in str(error.value)
    assert str(error.value).startswith(f"{tmp_path / 'arm.xml.toml'}:3: [frames]")


def test_missing_frames_are_noted(
    tmp_path: Path,
) -> None:
    none = poses(tmp_path, system=without_frames(), sidecar="")
    assert none.record.note == "the system declares no frames"
    unmapped = poses(tmp_path, sidecar="")
    assert unmapped.record.note == "the sidecar maps no frame of the system"
    assert unmapped.record.unchecked == ("post", "arm", "tool", "tip")
    assert poses(tmp_path, sidecar='[frames]\narm = "body:arm"\n').record.unchecked == (
        "post", "tool", "tip",
    )  # fmt: skip
