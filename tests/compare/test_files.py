"""Files that are compared: their edits, properties, and refusals."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck import CompareError
from physics_crosscheck.harness.commands.compare.candidate import (
    Candidate,
    FailureError,
    NotInstalledError,
    candidate,
)
from physics_crosscheck.harness.commands.compare.diff import applied, edits
from physics_crosscheck.harness.commands.compare.match import declared, match, pairs_of
from physics_crosscheck.harness.commands.compare.prepared import prepare
from physics_crosscheck.harness.commands.compare.properties import properties
from physics_crosscheck.harness.commands.compare.side import Difference, ModelSide, model_side
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.assemble import tree_system
from tests.compare.arm import MJCF, URDF
from tests.compare.asking import changed, compared, model
from tests.models import written


def between(
    folder: Path, suffix: str, a: str, b: str
) -> tuple[list[tuple[str, int | None, int | None, str, str]], str]:
    """Return differences as (label, line in A, line in B, old, new), and A with B's edits."""
    files = written(folder, f"a{suffix}", a), written(folder, f"b{suffix}", b)
    sides = [
        Candidate(
            "A",
            Sidecar(
                model=f,
                engines=("any",),
                settings={},
                engine_settings={},
                coordinates={},
                readback={},
                springs=(),
            ),
            "any",
        )
        for f in files
    ]
    differences = edits(*sides)
    rows = [
        (e.what, e.where_a.line, e.where_b.line, e.a, e.b)
        for e in (edit.record for edit in differences)
    ]
    return rows, applied(a.encode(), differences).decode()


def test_number_of_a_vector_is_one_difference(tmp_path: Path) -> None:
    rows, patched = between(
        tmp_path,
        ".xml",
        '<m>\n<b name="rod" pos="0 1\n 2"/></m>',
        '<m><b name="rod" pos="0  1.0 2.5"/></m>',
    )
    assert rows == [("b[rod]@pos[2]", 2, 1, "2", "2.5")]
    assert patched == '<m>\n<b name="rod" pos="0 1\n 2.5"/></m>'


@pytest.mark.parametrize(("a", "b"), [
    ('<m><b x="1"/></m>', '<m><b   x = \'1.0\'></b></m>'),
    ("<m><b>1</b></m>", "<m><!-- new -->\n<b> 1e0 <!-- old --></b></m>"),
    ('<m><b name="one"/><b name="two"/></m>', '<m><b name="two"/><b name="one"/></m>'),
    ('<m a="1" b="2"/>', '<m b="2" a="1"/>'),
])  # fmt: skip
def test_other_notation_is_no_difference(tmp_path: Path, a: str, b: str) -> None:
    assert between(tmp_path, ".xml", a, b)[0] == []


@pytest.mark.parametrize(("a", "b", "expected"), [
    ('<m><b n="1"/></m>', '<m><b n="1" k="2"/></m>', ("b@k", "nothing", "2")),
    ('<m><b n="1" k="2"/></m>', '<m><b n="1"/></m>', ("b@k", "2", "nothing")),
    ('<m><b n="1 2"/></m>', '<m><b n="1 2 3"/></m>', ("b@n", "1 2", "1 2 3")),
    ('<m><b t="hinge"/></m>', '<m><b t="slide"/></m>', ("b@t", "hinge", "slide")),
    ("<m><b>3</b></m>", "<m><b>4</b></m>", ("b", "3", "4")),
    ("<m><b/></m>", '<m><b/><c k="1"/></m>', ("c", "nothing", '<c k="1"/>')),
    ('<m><b/><c k="1"><d/></c></m>', "<m><b/></m>", ("c", '<c k="1"><d/></c>', "nothing")),
    ('<m><j name="a"/></m>', '<m><j name="b"/></m>', ("j[a]@name", "a", "b")),
])  # fmt: skip
def test_every_kind_of_difference_can_be_applied(
    tmp_path: Path, a: str, b: str, expected: tuple[str, ...]
) -> None:
    rows, patched = between(tmp_path, ".xml", a, b)
    assert [(label, old, new) for label, _, _, old, new in rows] == [expected]
    assert between(tmp_path, ".xml", patched, b)[0] == []


def test_numbers_in_python_are_labelled_by_name_or_line(tmp_path: Path) -> None:
    a = "MASS = 2.0  # kg\n\ndef build():\n    '''Old.'''\n    return MASS, -0.5, 7\n"
    b = "\nMASS = 2.5\ndef build():\n    'New.'\n    return MASS, +0.5, 7.0\n"
    rows, patched = between(tmp_path, ".py", a, b)
    assert rows == [("MASS", 1, 2, "2.0", "2.5"), ("number", 5, 5, "-0.5", "+0.5")]
    assert "MASS = 2.5  # kg" in patched
    assert "return MASS, +0.5, 7" in patched


def test_changed_code_is_one_difference_at_its_first_line(tmp_path: Path) -> None:
    a, b = "a = 1\nb = a\n", "a = 1\nb = a * 2\n"
    rows, patched = between(tmp_path, ".py", a, b)
    assert [entry[:3] for entry in rows] == [("code", 2, 2)]
    assert patched == b


@pytest.mark.parametrize(("suffix", "text", "sentence"), [
    (".xml", "<m><b></m>", r"b.xml:1: not XML"),
    (".xml", "<!DOCTYPE m [<!ENTITY a 'b'>]><m/>", "entities or a DTD"),
    (".py", "a = (", r"b.py:1: no Python"),
])  # fmt: skip
def test_unreadable_file_is_named_with_its_line(
    tmp_path: Path, suffix: str, text: str, sentence: str
) -> None:
    with pytest.raises(LocationError, match=sentence):
        between(tmp_path, suffix, {".xml": "<m/>", ".py": "a = 1"}[suffix], text)


EFFECTS = (
    ("mass", 'mass="0.9"', 'mass="0.95"'),
    ("centre", 'pos="0 0.03 -0.19"', 'pos="0 0.04 -0.19"'),
    ("inertia", "0.017 0.016", "0.018 0.016"),
    ("damping", 'damping="1.3"', 'damping="1.5"'),
    ("stiffness", 'stiffness="2.5"', 'stiffness="2.7"'),
    ("rest", 'springref="0.4"', 'springref="0.5"'),
    ("armature", 'name="elbow"', 'name="elbow" armature="0.01"'),
    ("gravity", "0 0 -9.81", "0 0.1 -9.81"),
    ("axis", 'euler="0.3 0 0"', 'euler="0.31 0 0"'),
    ("anchor", 'pos="0.01 0.05 -0.45"', 'pos="0.01 0.05 -0.47"'),
    ("zero", 'pos="0 0 -0.4"', 'pos="0 0 -0.41"'),
    ("zero", 'name="upper" pos="0 0 1.2"', 'name="upper" pos="0 0 1.2" xyaxes="1 0 0.1 0 1 0"'),
)  # fmt: skip


def sides(folder: Path, base: str, *changes: tuple[str, str]) -> tuple[list[Difference], ModelSide]:
    """Return the differences of an arm in MJCF from a changed copy, and the changed side."""
    pair = [
        written(folder / label, "arm.xml", base, *some)
        for label, some in (("a", ()), ("b", changes))
    ]
    a, b = (candidate(label, path, None) for label, path in zip("AB", pair, strict=True))
    prepared = prepare(InThisProcess(), a, b, ({}, {}), include_constraints=False)
    here, there = (model_side(facts, np.array([0.2, -0.3, 0.05])) for facts in prepared.facts)
    assert here is not None
    assert there is not None
    pairs = pairs_of(prepared.match, prepared.facts[0].coordinates)
    return properties(here, there, pairs)[0], there


def test_rotation_of_a_symmetric_body_is_that_of_its_axis(tmp_path: Path) -> None:
    """Ignore the angle of axes in the plane of equal moments of inertia: all are principal."""
    old = 'diaginertia="0.0008 0.0008 0.0005"'
    base = MJCF.replace('diaginertia="0.0008 0.0009 0.0005"', old)
    ((row, _),), _ = sides(tmp_path, base, (old, f'{old} euler="0.1 0 0.7"'))
    assert row.message.endswith("turned by 0.1 rad")


@pytest.mark.parametrize(("kind", "old", "new"), EFFECTS)
def test_difference_applied_to_the_tree_of_a_gives_that_of_b(
    tmp_path: Path, kind: str, old: str, new: str
) -> None:
    """Check the effect of a difference: both trees must have equal accelerations."""
    base = MJCF.replace(' euler="0.3 0 0"', "") if "xyaxes" in new else MJCF
    differences, there = sides(tmp_path, base, (old, new))
    ((row, tree),) = [one for one in differences if one[0].moves]
    assert row.kind == kind
    assert tree is not None
    q, v = np.array([[0.4, -0.7, 0.1]]), np.array([[1.0, -2.0, 0.3]])
    mine, its = (
        TreeEquations(tree_system(name="arm", title="", source="", tree=one)).pushed_acceleration(
            q, v, np.zeros((1, 3))
        )
        for one in (tree, there.tree)
    )
    np.testing.assert_allclose(mine, its, rtol=1e-8)


NONE: tuple[dict[str, str], dict[str, str]] = ({}, {})


def test_renamed_joint_is_rejected_with_a_remedy(tmp_path: Path) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    other = changed(tmp_path, path, ('joint name="theta"', 'joint name="theta_2"'))
    # A Space has no tree to match joints by geometry.
    with pytest.raises(CompareError) as error:
        compared(model("drum_pendulum", "space.py"), other)
    assert "no match for joint" in str(error.value)
    assert "name the pairs, for instance --joints" in str(error.value)
    assert "none was found by name, order or geometry, and none can be held" in str(error.value)


def test_joint_locked_in_the_other_model_is_rejected_if_it_cannot_be_held(tmp_path: Path) -> None:
    a = written(tmp_path, "arm.xml", MJCF)
    # Coordinates of a sidecar may depend on other joints.
    written(tmp_path, "arm.xml.toml", 'engines = ["mujoco"]\n')
    b = written(
        tmp_path,
        "arm.urdf",
        URDF,
        ('"reach" type="prismatic"', '"reach" type="fixed"'),
        ("<springStiffness>300</springStiffness>", ""),
    )
    with pytest.raises(CompareError, match="joint reach of A moves on its own and has no match"):
        compared(a, b, engine_b="mujoco")


@pytest.mark.parametrize(("joints", "sentence"), [
    ("theta", "'theta' is not a pair such as"),
    ("hip=theta", "the map names 'hip'; the joints of A are x, theta"),
    ("theta=hip", "hip is neither a coordinate nor a constant; the joints of B are x, theta"),
    ("theta=2+", "can't read '2\\+'"),
])  # fmt: skip
def test_unreadable_map_is_rejected(joints: str, sentence: str) -> None:
    with pytest.raises(CompareError, match=sentence):
        match(("x", "theta"), ("x", "theta"), declared(joints, None), NONE)


@pytest.mark.parametrize(("text", "sentence"), [
    ("[joints", "map.toml: can't be read"),
    ("[coordinates]\na = 'b'", "it needs one table, \\[joints\\]"),
])  # fmt: skip
def test_unreadable_map_file_is_rejected(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(CompareError, match=sentence):
        declared("", written(tmp_path, "map.toml", text))


def test_map_may_scale_reverse_and_shift(tmp_path: Path) -> None:
    z, w = [[0.4, 0.7]], [[2.0, 3.0]]
    pairs = declared("a=2*q-1, b=-r", None)
    table = written(tmp_path, "map.toml", '[joints]\nq = "(a + 1) / 2"\nr = "-b"\n')
    for given in (pairs, declared("", table)):
        mapping = match(("a", "b"), ("q", "r"), given, NONE)
        assert mapping.source == "A"
        states = mapping.convert(np.hstack([z, w]))
        assert np.allclose(states, [[0.7, -0.7, 1.0, -3.0]], atol=1e-15)


def test_mapped_joint_is_not_matched_again() -> None:
    with pytest.raises(CompareError, match="no match for joint b of A and joint a of B"):
        match(("a", "b"), ("a", "c"), declared("a=c", None), NONE)


def test_start_of_an_unknown_joint_is_rejected() -> None:
    path = model("simple_pendulum", "mujoco.xml")
    with pytest.raises(CompareError, match=r"--start: 'phi' is not a joint, .* are theta"):
        compared(path, path, starts=({"phi": 1.0},))


@pytest.mark.parametrize(("name", "engine", "sentence"), [
    ("nothing.xml", None, "nothing.xml: there is no such file"),
    ("mujoco.xml", "havok", "no engine 'havok' is known; known are"),
    ("mujoco.xml", "pybullet", "pybullet reads .urdf files alone; choose another with --engine-b"),
    ("system.py.toml", None, "no engine reads it; they read"),
])  # fmt: skip
def test_unusable_path_or_engine_is_rejected(
    tmp_path: Path, name: str, engine: str | None, sentence: str
) -> None:
    changed(tmp_path, model("simple_pendulum", "mujoco.xml"))
    (tmp_path / "system.py.toml").write_text("")
    with pytest.raises(CompareError, match=sentence):
        candidate("B", tmp_path / name, engine)


def test_missing_engine_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from physics_crosscheck.harness.engines.pymunk import PymunkEngine

    monkeypatch.setattr(PymunkEngine, "version", lambda _: None)
    with pytest.raises(
        NotInstalledError,
        match="no engine that reads it is installed: pymunk: not installed; pip install",
    ):
        candidate("A", model("simple_pendulum", "space.py"), None)


def test_urdf_runs_in_the_first_installed_engine_of_its_sidecar(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from physics_crosscheck.harness.engines.pybullet import PybulletEngine

    path = model("simple_pendulum", "robot.urdf")
    other = changed(tmp_path, path, ('["pybullet", "mujoco"]', '["mujoco"]'))
    assert (candidate("A", path, None).engine, candidate("A", other, None).engine) == (
        "pybullet",
        "mujoco",
    )
    monkeypatch.setattr(PybulletEngine, "version", lambda _: None)
    assert candidate("A", path, None).engine == "mujoco"


def test_unreadable_sidecar_is_named(tmp_path: Path) -> None:
    path = changed(tmp_path, model("simple_pendulum", "robot.urdf"), ("[settings]", "[settings"))
    with pytest.raises(SidecarError, match=r"robot.urdf.toml: "):
        candidate("A", path, None)


def test_model_that_fails_to_load_is_named_with_its_engine(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    other = changed(tmp_path, path, ('mass="0.45"', 'mass="-0.45"'))
    with pytest.raises(FailureError, match=r"mujoco.xml:34: MuJoCo can't load it"):
        compared(path, other)
