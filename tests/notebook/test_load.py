"""`load` and `compare`: a robot's numbers and matrices; causes, advice and page of a check."""

import json
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from physics_crosscheck import (
    CompareError,
    Comparison,
    MotionError,
    check,
    compare,
    load,
    simulate,
    solve,
)
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records import comparison
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Outcome
from tests.compare.asking import changed
from tests.standing import shorten_scenarios, without

PENDULUM = """<robot name="pendulum">
  <link name="base"/>
  <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="50" velocity="1"/></joint>
</robot>
"""


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    file = tmp_path / "pendulum.urdf"
    file.write_text(PENDULUM)
    return file


def test_robot_has_joints_masses_and_total_inertia(pendulum: Path) -> None:
    robot = load(pendulum)
    (joint,) = robot.joints
    assert (joint.name, joint.kind, joint.link, joint.limits) == ("hinge", "hinge", "rod", (-1, 2))
    assert robot.masses == {"base": 0.0, "rod": 2.0}
    assert robot.mass == 2.0
    np.testing.assert_allclose(robot.inertia.center, [0, 0, -0.5])
    np.testing.assert_allclose(np.diag(robot.inertia.inertia), [0.1, 0.1, 0.01])
    np.testing.assert_allclose(robot.gravity, [0, 0, -9.81])
    assert "1 joint, 2 links, 2 kg" in repr(robot)
    assert "<td" in robot._repr_html_()


def test_matrices_equal_those_of_a_pendulum(pendulum: Path) -> None:
    robot = load(pendulum)
    np.testing.assert_allclose(robot.mass_matrix(), [[0.1 + 2 * 0.5**2]])
    for q in ({"hinge": 0.7}, [0.7]):
        held = robot.gravity_forces(q)
        np.testing.assert_allclose(held, [2 * 9.81 * 0.5 * np.sin(0.7)], rtol=1e-12)


def test_positions_with_wrong_names_or_sizes_are_rejected(pendulum: Path) -> None:
    robot = load(pendulum)
    with pytest.raises(MotionError, match="no coordinate 'elbow'; there are hinge"):
        robot.mass_matrix({"elbow": 1.0})
    with pytest.raises(MotionError, match="1 positions expected"):
        robot.mass_matrix([0.1, 0.2])


def test_folder_of_energies_has_no_bodies() -> None:
    with pytest.raises(MotionError, match="declares energies, not bodies"):
        load("simple_pendulum")


def test_file_and_folder_give_the_same_results(pendulum: Path) -> None:
    """Accept a name in a system folder wherever a file is accepted."""
    start = {"hinge": 0.3}
    for run, exact in (
        (
            simulate(pendulum, start, duration=0.2, engine="mujoco"),
            solve(pendulum, start, duration=0.2),
        ),
        (
            simulate("simple_pendulum/robot.urdf", "free", duration=1, engine="mujoco"),
            solve("simple_pendulum", "free", duration=1),
        ),
    ):
        name = exact.names[0]
        assert run.names[0] == name
        assert abs((run - exact)[name]).max() < 0.05
        assert exact.uncertainty_of(name).max() < 1e-9
    model = builtin() / "simple_pendulum" / "robot.urdf"
    for a, b in ((pendulum, pendulum), (model, "simple_pendulum/mujoco.xml")):
        assert compare(a, b, engine="mujoco").agree


BODIES = """from physics_crosscheck import Joint, MultibodySystem, RigidBody

hinge = Joint(name="hinge", kind="hinge", axis=(0, 1, 0), limits=(-1, 2))
system = MultibodySystem(
    name="arm", title="a rod", source="a data sheet", gravity=(0, 0, -9.81),
    bodies=(
        RigidBody(name="base", parent=None),
        RigidBody(name="rod", parent="base", joints=(hinge,), mass=2.0, center=(0, 0, -0.5),
                  inertia=(0.1, 0.1, 0.01, 0, 0, 0)),
    ),
)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Create a folder with the pendulum's bodies and a file whose mass differs."""
    place = tmp_path / "arm"
    place.mkdir()
    (place / "system.py").write_text(BODIES)
    heavier = PENDULUM.replace('<mass value="2"/>', '<mass value="2.5"/>')
    (place / "pendulum.urdf").write_text(heavier)
    (place / "pendulum.urdf.toml").write_text('engines = ["mujoco"]\n[settings]\nstep = 0.002\n')
    return place


def test_folder_with_bodies_loads_its_declaration(folder: Path, pendulum: Path) -> None:
    declared, stated = load(folder), load(pendulum)
    assert declared.masses == stated.masses
    assert declared.coordinates == stated.coordinates
    assert [one.limits for one in declared.joints] == [one.limits for one in stated.joints]
    for q in ({}, {"hinge": 0.7}):
        np.testing.assert_allclose(declared.mass_matrix(q), stated.mass_matrix(q))
        np.testing.assert_allclose(declared.gravity_forces(q), stated.gravity_forces(q))
    np.testing.assert_allclose(declared.inertia.inertia, stated.inertia.inertia)


def test_file_in_folder_loads_its_own_numbers(folder: Path) -> None:
    """Load the mass of the file, which differs from the folder's."""
    assert (load(folder / "pendulum.urdf").mass, load(folder).mass) == (2.5, 2.0)
    assert load("simple_pendulum/robot.urdf").mass == pytest.approx(1.45)


def test_folder_with_one_file_is_simulated_from_that_file(folder: Path, pendulum: Path) -> None:
    start = {"hinge": 0.3}
    runs = [simulate(one, start, 0.01, duration=0.1, engine="mujoco") for one in (folder, pendulum)]
    assert abs((runs[0] - runs[1])["hinge"]).max() > 1e-9
    assert not compare(folder, pendulum, engine="mujoco").agree
    for ask in (lambda: simulate("simple_pendulum", "free"), lambda: compare(builtin(), pendulum)):
        with pytest.raises(ValueError, match="is a folder; name a model file in it"):
            ask()


@pytest.mark.parametrize("name", ["missing.urdf", "missing.py", "place/missing.txt"])
def test_missing_file_is_reported(name: str) -> None:
    for ask in (load, check, lambda path: solve(path, "free"), lambda path: simulate(path, "free")):
        with pytest.raises(ValueError, match=f"^{name}: there is no such file"):
            ask(name)


def test_causes_name_wrong_number_and_line(tmp_path: Path) -> None:
    folder = tmp_path / "pendulum"
    shutil.copytree(builtin() / "simple_pendulum", folder)
    for name in ("mujoco.xml", "robot.sdf", "space.py"):
        (folder / name).unlink()
        (folder / f"{name}.toml").unlink()
    without(folder, "free", "large", "chirp")
    shorten_scenarios(folder, 8)
    file = folder / "robot.urdf"
    text = file.read_text()
    assert text.count('<mass value="0.45"/>') == 1
    file.write_text(text.replace('<mass value="0.45"/>', '<mass value="0.46"/>'))
    results = check(folder, engines=["mujoco"])
    assert not results.agree
    (cause,) = results.causes
    line = text[: text.index('<mass value="0.45"/>')].count("\n") + 1
    assert [place.line for place in cause.locations] == [line]
    assert cause.nominal == 0.46
    assert cause.estimate == pytest.approx(0.45, rel=1e-6)
    assert f"robot.urdf:{line}" in results.summary()
    page = results.show()
    assert f"robot.urdf:{line}" in page.html
    assert "<iframe" in page._repr_html_()
    page.write(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text() == page.html


KNEE = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="knee" axis="0 1 0"
 limited="true" range="{} 2"/><geom size="0.1" pos="0 0 -0.5"/></body></worldbody></mujoco>"""


def test_advice_stays_accepted_until_its_number_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pendulum = tmp_path / "pendulum.xml"
    monkeypatch.delenv("CI", raising=False)
    pendulum.write_text(KNEE.format(0.5))
    before = check("pendulum.xml", engines=["mujoco"], baseline="accepted")
    assert [one.kind for one in before.advice] == ["rest outside limits"]
    assert before.agree, "advice changes no verdict"
    words = ["accept", "pendulum.xml", "--engine", "mujoco", "--baseline", "accepted"]
    assert main([*words, "--reason", "the rod hangs on a hook"]) == 0, capsys.readouterr().err
    after = check("pendulum.xml", engines=["mujoco"], baseline="accepted")
    assert after.advice == ()
    (model,) = after.models
    reasons = {one.accepted for one in model.audit or () if one.severity == "advice"}
    assert reasons == {"the rod hangs on a hook"}
    pendulum.write_text(KNEE.format(0.6))
    changed = check("pendulum.xml", engines=["mujoco"], baseline="accepted")
    assert [one.kind for one in changed.advice] == ["rest outside limits"]


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


def test_text_equals_terminal_output_and_record_equals_json_output(differing: Comparison) -> None:
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
