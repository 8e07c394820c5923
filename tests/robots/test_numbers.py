"""Numbers of robot files: their places, and the trees that changed numbers make."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import CompiledTree
from physics_crosscheck.harness.modelfiles.mjcf.numbers import CompiledNumbers
from physics_crosscheck.harness.modelfiles.numbers import NUDGE, ModelFile
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_numbers
from physics_crosscheck.reference.mechanism.tree import Tree
from tests.models import written
from tests.robots.files import joint, link

URDF = "\n".join(
    [
        '<robot name="written">',
        link("base", ""),
        joint("a", "base", "one", '<origin xyz="0, 0, 0.25" rpy="0.1 0 0"/><axis xyz="0 1 0"/>'),
        link("one"),
        joint("b", "one", "two", '<dynamics damping="0.5"/><limit effort="7"/>', "revolute"),
        link("two").replace('value="2"', "value='3.5'"),
        joint("c", "two", "welded", '<origin xyz="0.5 0 0" rpy="0 0 0"/>', "fixed"),
        link("welded"),
        joint("d", "welded", "three", '<origin xyz="0 0.1 0" rpy="0 0 0.2"/>'),
        link("three"),
        joint("e", "three", "tip", '<origin xyz="0 0 0.3"/>', "fixed"),
        link("tip"),
        '<gazebo reference="b"><springStiffness> 4 </springStiffness></gazebo>',
        "</robot>",
    ]
)


def by_address(numbers: ModelFile) -> dict[str, int]:
    indices = {one.address: i for i, one in enumerate(numbers.numerals)}
    assert len(indices) == len(numbers.numerals)
    return indices


def same(tree: Tree | None, other: Tree | None) -> bool:
    assert tree is not None
    assert other is not None
    if tree.frames.keys() != other.frames.keys():
        return False
    places = ((tree.frames[name], other.frames[name]) for name in tree.frames)
    if not all(a == b and all(map(np.array_equal, c, d)) for (a, c), (b, d) in places):
        return False
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for a, b in zip(tree.links, other.links, strict=True)
        for name in ("position", "rotation", "axis", "mass", "center", "inertia", "damping",
                     "stiffness", "rest", "armature")
    )  # fmt: skip


@pytest.mark.parametrize("address", [
    "joint[a]/origin@xyz[2]", "joint[a]/origin@rpy[0]", "joint[a]/axis@xyz[0]",
    "link[two]/inertial/mass@value", "link[one]/inertial/inertia@ixy",
    "link[welded]/inertial/origin@xyz[0]",
    "joint[c]/origin@xyz[1]", "joint[c]/origin@rpy[2]", "joint[d]/origin@rpy[2]",
    "joint[e]/origin@xyz[2]", "link[tip]/inertial/mass@value",
    "joint[b]/dynamics@damping", "gazebo[b]/springStiffness",
])  # fmt: skip
def test_tree_with_a_changed_number_matches_the_changed_file(tmp_path: Path, address: str) -> None:
    file = written(tmp_path, "r.urdf", URDF)
    numbers = robot_numbers(file, {})
    index = by_address(numbers)[address]
    assert index in numbers.relevant_numbers
    before = numbers.tree({})
    assert same(before, read_robot(file).tree)
    changed = numbers.tree({index: 0.125})
    assert not same(changed, before)
    (text,) = numbers.texts({index: 0.125}).values()
    file.write_bytes(text)
    assert same(changed, read_robot(file).tree)
    assert same(numbers.tree({}), before), "the change is temporary"


def test_numbers_have_line_value_and_scale(tmp_path: Path) -> None:
    file = written(tmp_path, "r.urdf", URDF)
    numbers = robot_numbers(file, {})
    indices = by_address(numbers)
    entry = numbers.numerals[indices["joint[a]/origin@xyz[2]"]]
    assert (entry.line, entry.value, entry.scale) == (3, 0.25, 0.25)
    assert file.read_bytes()[entry.start : entry.end] == b"0.25"
    assert numbers.numerals[indices["joint[a]/origin@xyz[0]"]].scale == 0.25
    assert numbers.numerals[indices["link[one]/inertial/inertia@ixy"]].scale == 0.3
    effort = indices["joint[b]/limit@effort"]
    assert numbers.numerals[effort].value == 7
    assert effort not in numbers.relevant_numbers


def test_invalid_number_makes_no_tree(tmp_path: Path) -> None:
    file = written(tmp_path, "r.urdf", URDF)
    numbers = robot_numbers(file, {})
    index = by_address(numbers)["joint[a]/axis@xyz[1]"]
    assert numbers.tree({index: 0.0}) is None
    assert numbers.tree({}) is not None


MJCF = """<mujoco>
<compiler angle="radian"/><option gravity="0 0 -9.81" timestep="0.002"/>
<default><joint damping="0.3"/><geom density="500" rgba="1 0 0 1"/></default>
<include file="limbs.xml"/>
</mujoco>
"""
LIMBS = """<mujocoinclude><worldbody><body><joint name="a" axis="0 1 0" armature="0.02"/>
<geom size="0.1 0.2 0.3" type="box" pos="0 0 -0.2" friction="1 0.1 0.1"/>
<geom name="light" size="0.1" pos="0 0 -0.3" mass="0.2"/>
</body></worldbody></mujocoinclude>
"""


def test_mjcf_has_the_numbers_of_included_files(tmp_path: Path) -> None:
    file = written(tmp_path, "r.xml", MJCF)
    (tmp_path / "limbs.xml").write_text(LIMBS)
    numbers = robot_numbers(file, {})
    indices = by_address(numbers)
    addresses = {numbers.numerals[i].address for i in numbers.relevant_numbers}
    assert {
        "mujoco/default/joint@damping", "mujoco/default/geom@density", "joint[a]@armature",
        "geom[light]@mass", "geom[light]@pos[2]", "mujoco/option@gravity[2]",
    } <= addresses  # fmt: skip
    assert not addresses & {"mujoco/option@timestep", "mujoco/default/geom@rgba[0]"}
    assert not [one for one in addresses if "friction" in one]
    before = numbers.tree({})
    for address in ("mujoco/default/joint@damping", "geom[light]@mass"):
        index = indices[address]
        changed = numbers.tree({index: 0.4})
        assert not same(changed, before)
        other = tmp_path / address.split("[")[0].replace("/", "_")
        other.mkdir()
        for path, text in numbers.texts({index: 0.4}).items():
            (other / path.name).write_bytes(text)
        assert same(changed, read_robot(other / "r.xml").tree)
        assert (tmp_path / "limbs.xml").read_text() == LIMBS


def chain(compiler: str, joint_attributes: str) -> str:
    bodies = ""
    for k in reversed(range(5)):
        extra = joint_attributes if k == 1 else 'damping="0.2"'
        bodies = (
            f'<body name="b{k}" pos="0 0.{k} 0.3"><joint name="j{k}" axis="0 1 0.{k}" {extra}/>'
            f'<inertial pos="0 0.01 0.1" mass="1.{k}" diaginertia="0.01 0.02 0.025"/>'
            f"{bodies}</body>"
        )
    return f"<mujoco><compiler {compiler}/><worldbody>{bodies}</worldbody></mujoco>"


@pytest.mark.parametrize(
    ("compiler", "joint_attributes", "share"),
    [("", "", 0.7), ('settotalmass="7"', "", 2.0), ("", 'springdamper="0.3 1"', 2.0)],
    ids=["bodies alone", "total mass", "spring of the whole inertia"],
)
def test_only_independent_numbers_of_bodies_are_compiled_together(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    compiler: str,
    joint_attributes: str,
    share: float,
) -> None:
    """Catch a number that changes other bodies too, and a compilation for each number."""
    pytest.importorskip("mujoco")
    file = written(tmp_path, "r.xml", chain(compiler, joint_attributes))
    single, together = robot_numbers(file, {}), robot_numbers(file, {})
    compiled, count = CompiledNumbers._compile, list[int]()

    def counted(self: CompiledNumbers, values: Mapping[int, float]) -> CompiledTree | None:
        count.append(len(values))
        return compiled(self, values)

    monkeypatch.setattr(CompiledNumbers, "_compile", counted)
    numbers = together.relevant_numbers
    assert len(numbers) > 40
    assert len(count) < share * len(numbers)
    for i in numbers:
        value = single.numerals[i].value + NUDGE * single.numerals[i].scale
        assert same(together.tree({i: value}), single.tree({i: value}))
