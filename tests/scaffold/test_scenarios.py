"""The motions that `crosscheck new` writes: every joint moves, within its limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.run import Options, Selection, run
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.solve import solve

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'


def chain(first: str, second: str = "") -> str:
    """Return an MJCF with one joint or two."""
    inner = (
        f'<body name="b" pos="0.6 0 0"><joint name="two" {second}/>'
        '<inertial pos="0.3 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>'
    )
    return (
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>'
        f'<body name="a"><joint name="one" {first}/>'
        '<inertial pos="0.3 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>'
        f"{inner * bool(second)}</body></worldbody></mujoco>"
    )


SPRUNG_URDF = f"""<robot name="r">
<link name="g"><inertial><mass value="1"/>{INERTIA}</inertial></link>
<link name="a"><inertial><mass value="2"/>{INERTIA}</inertial></link>
<joint name="one" type="prismatic"><parent link="g"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.5" effort="100" velocity="100"/><dynamics damping="0.5"/></joint>
<gazebo reference="one"><springStiffness>100</springStiffness></gazebo></robot>
"""

SPRING_AT_LIMIT = chain(
    'type="slide" axis="1 0 0" limited="true" range="0 0.5" stiffness="100" damping="1"'
)
SPRING_BEYOND_LIMIT = chain(
    'axis="0 1 0" limited="true" range="0.2 1.4" stiffness="20" springref="-0.4" damping="0.1"'
)


def write_folder(tmp_path: Path, text: str, suffix: str = ".xml") -> Path:
    """Write the folder of a model file."""
    model = tmp_path / f"m{suffix}"
    model.write_text(text)
    from_model(model, tmp_path / "read")
    return tmp_path / "read"


def position_ranges(system: System) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the lowest and highest position of each coordinate, (n,) each, by scenario."""
    equations, n = derive(system), len(system.q)
    ranges = {}
    for scenario in system.scenarios:
        nodes = solve(equations, scenario).nodes.reshape(-1, 2 * n)[:, :n]
        ranges[scenario.name] = nodes.min(axis=0), nodes.max(axis=0)
    return ranges


@pytest.mark.slow
@pytest.mark.parametrize(("text", "suffix", "limits"), [
    # Gravity has no effect about a vertical axis.
    (chain('axis="0 0 1" damping="0.1"', 'axis="0 0 1" limited="true" range="-2 2"'), ".xml",
     [(-np.inf, np.inf), (-2, 2)]),
    (chain('axis="0 0 1" damping="10"'), ".xml", [(-np.inf, np.inf)]),
    (chain('type="slide" axis="1 0 0"', 'type="slide" axis="0 1 0" limited="true" range="0 1"'),
     ".xml", [(-np.inf, np.inf), (0, 1)]),
    # A spring holds the joint at its limit, or pulls beyond it.
    (SPRING_AT_LIMIT, ".xml", [(0, 0.5)]),
    (SPRUNG_URDF, ".urdf", [(0, 0.5)]),
    (SPRING_BEYOND_LIMIT, ".xml", [(0.2, 1.4)]),
])  # fmt: skip
def test_every_joint_moves_within_its_limits_and_the_model_agrees(
    tmp_path: Path, text: str, suffix: str, limits: list[tuple[float, float]]
) -> None:
    folder = write_folder(tmp_path, text, suffix)
    lower, upper = np.array(limits).T
    for low, high in position_ranges(load_system(folder)).values():
        assert np.all(high - low > 1e-3)
        assert np.all((low > lower) & (high < upper))
    cases = Options(jobs=1, selection=Selection(models=None))
    results = run([folder], cases, lambda *_: None).results
    assert {case.outcome for case in results.cases} == {"AGREES"}
    assert not any(model.findings or model.failures for model in results.models)


def test_skipped_linearization_at_a_limit_is_reported(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, SPRING_AT_LIMIT)
    results = run([folder], Options(jobs=1), lambda *_: None).results
    assert [model.linearizations for model in results.models] == [()]
    (model,) = audits([folder])
    (note,) = (one for one in model.findings if one.kind == "unresolved")
    assert note.message.startswith(
        "a joint limit holds one in equilibrium 'rest': no linearization is compared there, and"
        " terms are compared where one = 0.2"
    )


def test_wrong_spring_at_a_limit_is_reported_with_its_position(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, SPRING_AT_LIMIT)
    model = folder / "m.xml"
    model.write_text(model.read_text().replace('damping="1"', 'damping="1" springref="0.01"'))
    (audit,) = audits([folder])
    (wrong,) = (one for one in audit.findings if one.kind == "rest")
    assert "at rest where one = 0.2" in wrong.message
    assert wrong.message.endswith(", but the equations have another force")
    assert wrong.actual is not None
    assert wrong.expected is not None
    assert wrong.actual - wrong.expected == pytest.approx(100 * 0.01, rel=1e-6)
