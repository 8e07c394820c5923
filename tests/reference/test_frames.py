"""Frames and points are complete, in metres and right-handed; invalid ones are rejected."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, Pose, System, ground, rotation
from physics_crosscheck.reference.mechanism.frames import frame_function
from tests.poses.arm import SWING, a, l

EYE = sp.eye(3)
TILTED = rotation((1, 2, 2), a.q)


def frames(*declared: Any) -> System:
    return replace(SWING, frames=declared)


def test_frames_and_poses_are_functions_of_q() -> None:
    turned = ground.at(0, 0, 1).hinge(a, about=(0, -1, 0)).at(0, 0, -l)
    system = frames(turned.pose("end", "the end"), Pose("tip", tuple(turned.origin), "the same"))
    values = frame_function(system)(np.array([[0.3]])).reshape(2, 12)
    place = [0.8 * np.sin(0.3), 0, 1 - 0.8 * np.cos(0.3)]
    np.testing.assert_allclose(values[:, :3], [place, place], atol=1e-16)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(values[0, 3:], [c, 0, -s, 0, 1, 0, s, 0, c], atol=1e-16)
    np.testing.assert_array_equal(values[1, 3:], np.eye(3).ravel())


def test_quaternion_equals_its_rotation() -> None:
    half = a.q / 2
    turn = Pose("rod", (0, 0, 0), "rod", (sp.cos(half), 0, -sp.sin(half), 0)).rotation
    assert sp.simplify(turn - rotation((0, -1, 0), a.q)) == sp.zeros(3, 3)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (Pose("", (0, 0, 0), "nothing"), "a frame needs a name"),
        (Pose("world", (0, 0, 0), "all"), "'world' is taken"),
        (Pose("rod", (0, 0, 0), ""), "it has no description"),
        (Pose("rod", (0, 0), "flat"), "its position must be three expressions, (x, y, z)"),  # type: ignore[arg-type]
        (Pose("rod", (a.v, 0, 0), "rod"), "it uses a_dot; use only positions and constants"),
        (Pose("rod", (sp.Symbol("w"), 0, 0), "rod"), "it uses w"),
        (Pose("rod", (l**2, 0, 0), "rod"), "its position has the unit m^2; expected m"),
        (Pose("rod", (l + a.q, 0, 0), "rod"), "has the unit"),
        (Pose("rod", (sp.I, 0, 0), "rod"), "which is not a real number"),
        (Pose("rod", (0, 0, 0), "rod", 2 * EYE), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", (0, 0, 0, 0)), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", (2, 0, 0, 0)), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", sp.diag(1, 1, -1)), "its rotation mirrors"),
        (Pose("rod", (0, 0, 0), "rod", sp.eye(2)), "must be a 3 x 3 matrix or a quaternion"),
        (Pose("rod", (0, 0, 0), "rod", l * TILTED), "its rotation has the unit m; expected 1"),
        ("rod", "is not a Pose"),
    ],
)
def test_wrong_frame_is_refused(declared: Any, words: str) -> None:
    with pytest.raises(DeclarationError) as error:
        frames(declared)
    assert words in str(error.value)


def test_two_frames_of_one_name_are_refused() -> None:
    with pytest.raises(DeclarationError, match="two frames share this name"):
        frames(Pose("rod", (0, 0, 0), "one"), Pose("rod", (0, 0, 1), "other"))


def test_plain_number_beside_a_length_is_in_metres() -> None:
    assert frames(Pose("rod", (l + 1.2, 0, 3), "rod", TILTED)).frames[0].position[2] == 3


@pytest.mark.parametrize(
    ("position", "rotation"),
    [
        (("print('run')", 0, 0), None),
        ((0, 0, 0), "print('run')"),
        ((0, 0, 0), ("print('run')", 0, 0, 0)),
        ((0, 0, 0), ((1, 0, 0), (0, 1, 0), (0, 0, "print('run')"))),
    ],
)
def test_text_in_a_pose_is_not_run(
    position: Any, rotation: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ValueError, match="write a number or an expression"):
        Pose("rod", position, "rod", rotation)
    assert capsys.readouterr().out == ""
