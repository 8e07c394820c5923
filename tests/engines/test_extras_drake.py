"""Whole steps of Drake's discrete plants: limits and contacts by the law of SAP, and faults."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.acting import urdf_quantities
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.law_comparison import LawEngine
from physics_crosscheck.harness.diagnosis.law_problem import diagnose_laws
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel, near_rigid_softness
from physics_crosscheck.reference.mechanism.laws import NearRigidRules
from tests.compare.asking import laws
from tests.conftest import _run_next, _wait
from tests.engines.extras import need
from tests.engines.whole_steps import checked, problem_of
from tests.gate.conftest import ignore_progress
from tests.laws.scenes import URDF_ARM, URDF_LEG
from tests.models import written

FAULTS = {
    "upper limit": ('upper=".7"', 'upper=".7000007"'),
    "lower limit": ('lower="-1"', 'lower="-1.000001"'),
    "lost limit": ('lower="-1" upper=".7"', 'lower="-9" upper="9"'),
    "limit of a continuous joint": ('upper=".4"', 'upper=".4000004"'),
    "damping": ('damping=".2"', 'damping=".2000002"'),
}


SURFACES = {
    "friction": ('mu_dynamic value="0.53"', 'mu_dynamic value="0.5300005"'),
    "static friction": ('mu_static value="0.71"', 'mu_static value="0.5300005"'),
    "stiffness": ('stiffness value="200000.0"', 'stiffness value="200000.2"'),
    "dissipation": ('dissipation value="7"', 'dissipation value="7.00001"'),
}


def test_joint_limits_follow_the_law_of_sap(tmp_path: Path) -> None:
    """Catch a wrong regularization, dissipation or damper."""
    check = checked("drake", tmp_path)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert check.record.next_state
    assert not check.record.uncovered
    assert {term.name for term in check.record.acted} == {"limits"}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_of_limits_are_detected(tmp_path: Path, fault: str) -> None:
    """Catch a number of a limit that whole steps do not depend on."""
    right, wrong = FAULTS[fault]
    assert URDF_ARM.count(right) == 1
    check = checked("drake", tmp_path, URDF_ARM, URDF_ARM.replace(right, wrong))
    assert check.record.outcome is Outcome.DIFFERS


def test_contacts_follow_the_law_of_sap(tmp_path: Path) -> None:
    """Catch another spring, damper, friction or mixing of surfaces, and an error of the solver."""
    check = checked("drake", tmp_path, URDF_LEG, floating=True)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert check.record.states == 24
    assert not check.record.next_state
    assert {term.name for term in check.record.acted} == {"contacts", "limits"}
    assert check.record.covered == ("limits of position", "collision geometry (2)")
    meshed = URDF_LEG.replace('sphere radius=".1"', 'mesh filename="no.obj"')
    assert checked("drake", tmp_path, meshed, floating=True).record.uncovered == (
        "contacts of meshes",
    )


@pytest.mark.parametrize("fault", SURFACES)
def test_planted_faults_of_surfaces_are_detected(tmp_path: Path, fault: str) -> None:
    """Catch a number of a surface that the law does not depend on, or one that does not act."""
    right, wrong = SURFACES[fault]
    assert URDF_LEG.count(right) == 1
    text = URDF_LEG.replace(right, wrong)
    outcome = checked("drake", tmp_path, URDF_LEG, text, floating=True).record.outcome
    acts = fault != "static friction"  # the dynamic one replaces it
    assert outcome is (Outcome.DIFFERS if acts else Outcome.AGREES)


def test_surface_with_a_word_is_refused_by_line(tmp_path: Path) -> None:
    """Catch Drake's message, which has no line."""
    text = URDF_LEG.replace('dissipation value="7"', 'dissipation value="7 s/m"')
    (reason,) = checked("drake", tmp_path, text, floating=True).record.uncovered
    line = text[: text.index("7 s/m")].count("\n") + 1
    assert f".urdf:{line}: value of <drake:hunt_crossley_dissipation> is '7 s/m'" in reason


BALL = """<robot name="ball" xmlns:drake="http://drake.mit.edu"><link name="body"><inertial>
<mass value="2"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius=".1"/></geometry><drake:proximity_properties>
<drake:mu_dynamic value=".5"/><drake:point_contact_stiffness value="3000"/>
</drake:proximity_properties></collision></link></robot>"""


def test_numbers_act_as_stated(tmp_path: Path) -> None:
    """Catch a rest depth that Drake does not have, and another mixing of frictions."""
    need("drake")
    (tmp_path / "ball.urdf").write_text(BALL)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": True}
    spec = ModelSpec(tmp_path / "ball.urdf", settings=settings)
    rows = {row.quantity: row.value for row in urdf_quantities(spec, "drake")}
    model = engines()["drake"].load_whole(spec)
    assert model is not None
    (start,) = model.starts
    rest = model.moved(start, 6000)
    assert rows["rest depth"] == pytest.approx(start.z[2] - rest.z[2], rel=1e-6)
    assert rows["friction"] == pytest.approx(2 / 3)
    (tmp_path / "leg.urdf").write_text(URDF_LEG)
    legs = urdf_quantities(ModelSpec(tmp_path / "leg.urdf", settings=settings), "drake")
    contacts = {row.subject for row in legs if row.quantity == "friction"}
    assert contacts == {"ground with body#1", "ground with body#2", "ground with shin"}


def test_numbers_of_two_files_are_compared(tmp_path: Path) -> None:
    """Catch a limit or a surface that no row has, or that changes no step."""
    need("drake")
    for name, text in (("a", URDF_LEG), ("b", URDF_LEG.replace(*SURFACES["friction"]))):
        (tmp_path / f"{name}.urdf").write_text(text)
    changed = (tmp_path / "b.urdf").read_text().replace('upper="1"', 'upper="1.001"')
    (tmp_path / "b.urdf").write_text(changed)
    rows = laws(tmp_path / "a.urdf", tmp_path / "b.urdf", "drake", "drake", floating=True)
    effects = {(row.about, row.where_a and row.where_a.line): row.effect or 0.0 for row in rows}
    assert set(effects) == {("joint hip", 14), ("shape 1 of link body", 4)}
    assert min(effects.values()) > 1e-8


def test_link_world_has_no_center_of_mass(tmp_path: Path) -> None:
    """Catch a NaN that a file with a link `world` differs by, and a root that can't float."""
    need("drake")
    file = written(tmp_path, "robot.urdf", URDF_ARM.replace('"base"', '"world"'))
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": True}
    model = engines()["drake"].load(ModelSpec(file, settings=settings))
    assert model.coordinates == ("shoulder", "elbow")
    assert "link:world" in model.places
    assert np.isfinite(model.poses(model.places, np.zeros((1, 2)))[0]).all()


@pytest.mark.parametrize(
    ("smooth", "words"),
    [(False, "elbow is continuous, but Drake applies its limits: [-0.4, 0.4]"),
     (True, "the limits [-0.4, 0.4] of elbow have no effect: it is continuous")],
)  # fmt: skip
def test_limits_of_a_continuous_joint_are_stated(tmp_path: Path, smooth: bool, words: str) -> None:
    """Catch a remark that Drake ignores limits which stop its joint, or the reverse."""
    need("drake")
    file = written(tmp_path, "arm.urdf", URDF_ARM)
    settings = {**SETTINGS, "floating": False, "step": 0.002, "smooth": smooth}
    model = engines()["drake"].load(ModelSpec(file, settings=settings))
    start = np.zeros((1, len(model.coordinates)))
    assert words in [one.message for one in model.remarks(start, start)]
    bounds = model.limits[model.coordinates.index("elbow")].tolist()
    assert bounds == ([-np.inf, np.inf] if smooth else [-0.4, 0.4])


_Rules = Callable[[NearRigidRules], NearRigidRules]


@pytest.mark.parametrize(
    ("text", "change"),
    [
        pytest.param(URDF_ARM, lambda rules: replace(rules, share=0.01), id="share"),
        pytest.param(URDF_ARM, lambda rules: replace(rules, dissipation=0.003), id="dissipation"),
        pytest.param(URDF_ARM, lambda rules: replace(rules, stiffness=1e4), id="stiffness"),
        pytest.param(URDF_LEG, lambda rules: replace(rules, slip=1.00001e-3), id="slip"),
        pytest.param(URDF_LEG, lambda rules: replace(rules, slowest=1.00001e-4), id="slowest"),
    ],
)
def test_other_rules_are_detected(tmp_path: Path, text: str, change: _Rules) -> None:
    """Catch a setting of SAP that the law does not depend on."""
    problem = problem_of("drake", tmp_path, text, floating=text == URDF_LEG)
    laws = problem.comparison.laws
    assert isinstance(laws, NearRigidModel)
    rules = change(laws.rules)
    softness = near_rigid_softness(rules)
    limits = tuple(replace(limit, softness=softness) for limit in laws.laws.limits)
    other = replace(laws, rules=rules, laws=replace(laws.laws, limits=limits))
    assert problem.of_model(problem.comparison.model).judge(1e-9).outcome is Outcome.AGREES
    engine = LawEngine(problem.comparison.under(other))
    assert problem.of_model(engine).judge(1e-9).outcome is Outcome.DIFFERS


def test_wrong_limit_is_named_with_its_line(tmp_path: Path) -> None:
    """Catch a diagnosis that does not try the numbers of near-rigid limits."""
    problem = problem_of("drake", tmp_path)
    wrong = written(tmp_path, "wrong.urdf", URDF_ARM.replace('upper=".7"', 'upper=".7000007"'))
    ranking = diagnose_laws(problem.in_engine(replace(problem.spec, path=wrong)))
    assert ranking.explained
    (cause,) = ranking.fits[0].causes
    assert "limit@upper" in str(cause)


def test_wrong_surface_is_named_with_its_line(tmp_path: Path) -> None:
    """Catch a diagnosis that does not try the numbers of surfaces."""
    problem = problem_of("drake", tmp_path, URDF_LEG, floating=True)
    right, wrong = SURFACES["friction"]
    copy = written(tmp_path, "wrong.urdf", URDF_LEG.replace(right, wrong))
    ranking = diagnose_laws(problem.in_engine(replace(problem.spec, path=copy)))
    assert ranking.explained
    (cause,) = ranking.fits[0].causes
    assert "drake:mu_dynamic@value" in str(cause)
    name = "frictions of two shapes are averaged"
    ranking = diagnose_laws(problem.mistaken(name))
    assert ranking.explained
    assert [str(cause) for cause in ranking.fits[0].causes] == [name]


def test_lost_limit_is_named(tmp_path: Path) -> None:
    """Catch a diagnosis without the mistakes of near-rigid limits."""
    problem = problem_of("drake", tmp_path)
    name = "the limit of joint shoulder is ignored"
    ranking = diagnose_laws(problem.mistaken(name))
    assert ranking.explained
    assert name in [cause.subject[0] for fit in ranking.fits[:1] for cause in fit.causes]


GRIPPER = """<robot name="fingers"><link name="palm"/>
<link name="a"><inertial><mass value="0.05"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0"
 ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="0.07"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0"
 ixz="0" iyz="0"/></inertial></link>
<joint name="left" type="prismatic"><parent link="palm"/><child link="a"/><axis xyz="0 1 0"/>
 <limit lower="0" upper="0.04" effort="20" velocity="0.2"/></joint>
<joint name="right" type="prismatic"><parent link="palm"/><child link="b"/><axis xyz="0 -1 0"/>
 <limit lower="0" upper="0.04" effort="20" velocity="0.2"/><mimic joint="left"/></joint></robot>"""


@pytest.mark.parametrize(("edit", "outcome"), [("", "AGREES"), (' multiplier="1.001"', "DIFFERS")])
def test_followers_are_held_exactly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edit: str, outcome: str
) -> None:
    """Catch motions left unresolved by soft couplers, and a multiplier that only Drake has."""
    need("drake")
    from physics_crosscheck.harness.engines.drake.model import DrakeModel

    take = DrakeModel.take

    def misread(self: DrakeModel, text: str, *rest: Any) -> None:
        take(self, text.replace('<mimic joint="left"', f'<mimic joint="left"{edit}'), *rest)

    monkeypatch.setattr(DrakeModel, "take", misread)
    monkeypatch.setattr(Workers, "begin", _wait)
    monkeypatch.setattr(Workers, "turn", _run_next)
    path = written(tmp_path, "fingers.urdf", GRIPPER)
    options = Options(engines=("drake",), jobs=1, thorough=True)
    (case,) = run([], options, ignore_progress, robots=[path]).results.cases
    assert case.outcome == outcome, case.reason
