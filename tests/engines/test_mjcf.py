"""MuJoCo's own readings: of MJCF, of URDF with springs, and of soft contacts."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, LoadedModel, ModelSpec
from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import load as load_model
from physics_crosscheck.harness.diagnosis.hypotheses import everything
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.known_answer import KnownEngine
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.locations import find, line_of, numbers
from physics_crosscheck.harness.modelfiles.model_files import UnreadModel, model_files
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from tests.faults.known_folder import known_folder
from tests.models import written

INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
GOOD = """<mujoco>
<option timestep="0.002" gravity="0 0 -1.62"/>
<worldbody><body>
<joint name="q" type="slide" axis="1 0 0" stiffness="3"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
</body></worldbody>
</mujoco>
"""


@pytest.fixture(autouse=True)
def _no_log_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def load(folder: Path, *change: str, **settings: object) -> LoadedModel:
    path = written(folder, "model.xml", GOOD.replace(change[0], change[1], 1) if change else GOOD)
    return engines()["mujoco"].load(ModelSpec(path, settings=settings))


def messages(model: LoadedModel) -> list[str]:
    z = np.zeros((1, 1))
    return [remark.message for remark in model.remarks(z, z)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("0.002", "0"), ":2: the time step is 0 s"),
        (("0.002", "-0.1"), ":2: the time step is -0.1 s"),
        (("0.002", "nan"), ":2: the time step is nan s"),
        (("0.002", "inf"), ":2: the time step is inf s"),
        (("0.002", "1e-30"), ":2: the time step is 1e-30 s"),
        (("0.002", "1e999"), ":2: <option timestep> has '1e999'"),
        (('stiffness="3"', 'stiffness="nan"'), ":4: <joint stiffness> has 'nan'"),
        (('axis="1 0 0"', 'axis="1 0 nan"'), ":4: <joint axis> has 'nan'"),
        (("-1.62", "inf"), ":2: <option gravity> has 'inf'"),
        (('mass="1"', 'mass="inf"'), ":5: <inertial mass> has 'inf'"),
        (('mass="1"', 'mass="nan"'), ":5: <inertial mass> has 'nan'"),
        (('axis="1 0 0"', 'axis="1 a"'), ":4: MuJoCo can't load it: XML Error: bad format"),
        ((INERTIAL, '<geom size="1e200"/>'), ":5: <geom size> has '1e200'"),
        (("<mujoco>", "<!DOCTYPE mujoco>\n<mujoco>"), ":1: refused: it declares entities or a DTD"),
        (("</mujoco>", "</mujoco><mujoco/>"), ":7: not XML at column 10: junk after document"),
        (("</mujoco>", "<custom>" * 300), ":7: refused: more than 300 nested"),
    ],
)
def test_invalid_model_is_rejected_in_one_line(
    change: tuple[str, str], message: str, tmp_path: Path
) -> None:
    with pytest.raises(EngineError) as caught:
        load(tmp_path, *change)
    assert f"model.xml{message}" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert os.listdir(tmp_path) == ["model.xml"]


def test_dtd_or_a_pipe_in_an_include_is_rejected(tmp_path: Path) -> None:
    other = written(tmp_path, "other.txt", "<!DOCTYPE mujoco>\n<mujoco/>\n")
    change = ("<worldbody>", '<include file="other.txt"/>\n<worldbody>')
    with pytest.raises(EngineError, match=r"other.txt:1: refused"):
        load(tmp_path, *change)
    other.unlink()
    os.mkfifo(other)
    with pytest.raises(EngineError, match=r"model.xml:\d+: .*'other.txt', which is not a file"):
        load(tmp_path, *change)


def test_comments_that_only_mujoco_reads_are_accepted(tmp_path: Path) -> None:
    model = load(tmp_path, "<worldbody>", "<!-- -- <!DOCTYPE x> -- -->\n<worldbody>")
    assert model.coordinates == ("q",)
    assert not any("the file sets no gravity" in message for message in messages(model))


@pytest.mark.parametrize(
    ("key", "value", "shown"),
    [("gravity", [0, 0, -9.81], "gravity, 0 0 -1.62"), ("step", 0.001, "timestep, 0.002")],
)
def test_values_that_a_sidecar_overrides_are_reported(
    key: str, value: object, shown: str, tmp_path: Path
) -> None:
    (note,) = [m for m in messages(load(tmp_path, **{key: value})) if "overrides" in m]
    assert shown in note
    assert f"{key} = {value}" in note
    same = {"gravity": [0, 0, -1.62], "step": 0.002}[key]
    assert not any("overrides" in m for m in messages(load(tmp_path, **{key: same})))


def test_second_elements_and_crossed_ranges_are_reported(tmp_path: Path) -> None:
    model = load(tmp_path, "</mujoco>", '<option timestep="0.01"/></mujoco>')
    assert model.step == 0.01
    assert any("a second <option> at model.xml:7" in message for message in messages(model))
    crossed = load(tmp_path, 'stiffness="3"', 'range="1 -1"')
    assert any("the range [1, -1] of q has no effect" in message for message in messages(crossed))


def test_mujoco_warnings_are_recorded_without_a_log_file(tmp_path: Path) -> None:
    model = load(tmp_path, 'stiffness="3"', 'stiffness="1e308"')
    start = np.ones((1, 1))
    z, _ = model.rollout(start, start, 0.002, 5, None, 5)
    assert np.isnan(z).all()
    (warning,) = model.warnings
    assert "QACC" in warning
    assert any(f"MuJoCo warns: {warning}" == message for message in messages(model))
    assert os.listdir(tmp_path) == ["model.xml"]


def test_error_in_a_rollout_names_the_file(tmp_path: Path) -> None:
    start = np.ones((1, 1))
    with pytest.raises(EngineError, match=r"model.xml: MuJoCo raises ValueError"):
        load(tmp_path).rollout(start, start, 0.002, 5, np.ones((1, 7, 3)), 5)


SERVO = '<actuator><position name="servo" joint="q" kp="60" forcerange="-10 10"/></actuator>'
FILTER = """<actuator><general name="motor" joint="q" dyntype="filter" dynprm="0.1" gainprm="2"/>
</actuator>"""


def test_actuators_without_controls_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"it has actuators.*\[settings\] controls"):
        load(tmp_path, "</mujoco>", SERVO + "</mujoco>")


def test_actuator_pushes_at_its_control_up_to_its_limit(tmp_path: Path) -> None:
    model = load(tmp_path, "</mujoco>", SERVO + "</mujoco>", controls=[0.1])
    z = np.array([[0.0], [-0.5]])
    _, w = model.rollout(z, np.zeros_like(z), 1e-3, 1, None, 1)
    np.testing.assert_allclose(w[:, 0, 0], [6e-3, (10 + 3 * 0.5) * 1e-3], rtol=1e-14)


def test_state_of_an_actuator_is_the_velocity_of_a_coordinate(tmp_path: Path) -> None:
    model = load(tmp_path, "</mujoco>", FILTER + "</mujoco>", controls=[3.0])
    assert model.coordinates == ("q", "motor.act")
    h, n = 1e-3, 50
    z, w = model.rollout(np.zeros((1, 2)), np.array([[0.0, 1.0]]), h, n, None, 1)
    states = [1.0]
    for _ in range(n):
        states.append(states[-1] + h * (3.0 - states[-1]) / 0.1)
    np.testing.assert_allclose(w[0, :, 1], states[1:], rtol=1e-13)
    assert z[0, -1, 1] == pytest.approx(np.trapezoid(states, dx=h), rel=1e-13)
    assert w[0, 0, 0] == pytest.approx(2 * 1.0 * h, rel=1e-13)  # the state at the step's start


def test_force_on_the_state_of_an_actuator_is_rejected(tmp_path: Path) -> None:
    model = load(tmp_path, "</mujoco>", FILTER + "</mujoco>", controls=[3.0])
    zero = np.zeros((1, 2))
    with pytest.raises(EngineError, match=r"inputs can't act on motor\.act"):
        model.rollout(zero, zero, 1e-3, 1, np.array([[[0.0, 1.0]]]), 1)


STIFFNESS = "K[0][0]"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return known_folder(tmp_path / "oscillator", {"good": ""})


def test_engine_declares_the_syntax_of_its_format(folder: Path) -> None:
    file = folder / "good.known"
    (number,) = find(file, [STIFFNESS]).values()
    assert number.value == 47.0
    assert line_of(file, STIFFNESS) == number.line


def test_literals_of_a_declared_format_are_bound_moved_and_hypotheses(
    folder: Path, tmp_path: Path
) -> None:
    path = folder / "good.known.toml"
    path.write_text(path.read_text() + f'[bindings]\n"{STIFFNESS}" = "k"\n')
    sidecar, physics = read_sidecar(path), prepare_system(folder, described=False)
    (bound,) = bindings(physics.system, sidecar)
    assert bound.exact
    moved = with_literals(sidecar, {STIFFNESS: 48.0}, tmp_path / "copy")
    assert find(moved.model, [STIFFNESS])[STIFFNESS].value == 48.0
    model, coordinates = load_model(physics.system, sidecar, "known")
    tried = everything(physics.system, sidecar, model, coordinates, physics.variants)
    names = {str(candidate.id) for candidate in tried}
    assert {STIFFNESS, "damping on x"} <= names


def test_without_declared_syntax_only_equations_have_hypotheses(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    syntax: Mapping[str, str] = {}
    monkeypatch.setattr(KnownEngine, "syntax", syntax)
    sidecar, physics = (
        read_sidecar(folder / "good.known.toml"),
        prepare_system(folder, described=False),
    )
    with pytest.raises(LocationError, match="numbers can be located in"):
        numbers(sidecar.model, ".*")
    assert line_of(sidecar.model, STIFFNESS) is None
    model, coordinates = load_model(physics.system, sidecar, "known")
    tried = everything(physics.system, sidecar, model, coordinates, physics.variants)
    assert not any("literal" in candidate.id.kind for candidate in tried)
    assert np.all([candidate.size > 0 for candidate in tried])


def test_model_file_without_a_sidecar_is_reported(folder: Path) -> None:
    (folder / "forgotten.known").write_text((folder / "good.known").read_text())
    unread = [one for one in model_files(folder) if isinstance(one, UnreadModel)]
    assert [one.model for one in unread] == ["forgotten.known"]
    assert 'engines = ["known"]' in unread[0].reason
    assert folder_files(folder).broken == (f"{folder / 'forgotten.known'}: has no sidecar",)
