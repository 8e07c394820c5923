"""Numbers and mistakes of robot files, and the output of a mutation."""

import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare, prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.commands.mutation import trees
from physics_crosscheck.harness.commands.mutation.mutate import faults_of, mutate, mutated
from physics_crosscheck.harness.commands.mutation.survey import FAULTS, MutationError, PlantedFault
from physics_crosscheck.harness.commands.mutation.text import mutation_lines, summary
from physics_crosscheck.harness.commands.mutation.trees import law_mistakes
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.run import Options
from physics_crosscheck.records import Mutation, Mutations
from tests.models import written
from tests.recorded import recorded
from tests.records.made import case
from tests.robots.files import ARM, TIPPED

SYSTEM = """from physics_crosscheck import Joint, MultibodySystem, RigidBody

arm = RigidBody(
    name="arm", parent=None, position=(0.0, 0.0, 1.0), mass=2.0, center=(0.3, 0.0, 0.0),
    inertia=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
    joints=(Joint(name="swing", kind="hinge", axis=(0.0, 1.0, 0.0), damping=0.1),),
)
system = MultibodySystem(
    name="swing", title="an arm", source="a test", gravity=(0.0, 0.0, -9.81), bodies=(arm,)
)
"""
MODEL = """<mujoco><option timestep="0.002"/><worldbody><body name="arm" pos="0 0 1">
<joint name="swing" type="hinge" axis="0 1 0" damping="0.1"/>
<inertial mass="2.0" pos="0.3 0 0" diaginertia="0.1 0.2 0.3"/></body></worldbody></mujoco>
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "system.py").write_text(SYSTEM)
    (tmp_path / "m.xml").write_text(MODEL)
    (tmp_path / "m.xml.toml").write_text('engines = ["mujoco"]\n\n[settings]\nsmooth = true\n')
    return tmp_path


def faults_by_key(folder: Path) -> dict[tuple[str, str], PlantedFault[Any]]:
    prepared = prepare(folder)
    assert isinstance(prepared, PreparedTree)
    task = model_task(prepared, "mujoco", read_sidecar(folder / "m.xml.toml"))
    return {(one.mistake.location, one.mistake.name): one for one in faults_of(task)}


def test_wrong_number_is_named_or_has_no_effect(folder: Path) -> None:
    faults = faults_by_key(folder)
    named = mutated(faults["joint[swing]@damping", "1e-3"])
    assert (named.verdict, named.name) == (FaultVerdict.NAMED, "1e-3")
    assert named.estimate_error is not None
    assert named.estimate_error < 1e-3
    assert named.first_caught is not None
    assert named.first_caught < 1e-6
    height = mutated(faults["body[arm]@pos[2]", "5 %"])
    assert (height.verdict, height.first_caught) == (FaultVerdict.UNTESTED, None)
    assert any("detected from" in line for line in mutation_lines([named, height]))


def test_folder_that_differs_is_refused(folder: Path) -> None:
    (folder / "m.xml").write_text(MODEL.replace('mass="2.0"', 'mass="2.1"'))
    with pytest.raises(MutationError, match=r"m\.xml: it does not agree with its equations"):
        mutate([folder], Options(jobs=1), lambda *_: None)


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    file = written(tmp_path, "arm.urdf", ARM)
    return file


def test_second_order_effect_is_judged_by_its_size(
    arm: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tilt an axis out of the plane of motion, with an engine that detects nothing."""
    faults = faults_of(model_task(prepare_tree(arm, states=8), "mujoco"))
    monkeypatch.setattr(trees, "run_case", lambda _: case())
    verdicts = {}
    for fault in faults:
        address = fault.mistake.location
        if fault.size is not None and address in (
            "joint[hinge]/axis@xyz[2]",
            "link[rod]/inertial/mass@value",
        ):
            verdicts[address[:4], fault.mistake.name] = mutated(fault).verdict
    untested = [key for key, verdict in verdicts.items() if verdict is FaultVerdict.UNTESTED]
    assert untested == [("join", "1e-6")]
    assert set(verdicts.values()) == {FaultVerdict.UNTESTED, FaultVerdict.MISSED}


def mass_fault(task: TreeTask) -> tuple[PlantedFault[Any], ...]:
    return tuple(
        one
        for one in faults_of(task)
        if (one.mistake.location, one.mistake.name) == ("link[rod]/inertial/mass@value", "1e-6")
    )


@pytest.mark.skipif(engines()["pinocchio"].version() is None, reason="needs Pinocchio")
def test_engine_that_disagrees_is_skipped_if_another_agrees(
    arm: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm.write_text(TIPPED)  # MuJoCo drops an inertia
    monkeypatch.setattr("physics_crosscheck.harness.commands.mutation.mutate.faults_of", mass_fault)
    warned = list[str]()
    options = Options(engines=("mujoco", "pinocchio"), jobs=1)
    rows = mutate([arm], options, lambda *_: None, warned.append)
    assert {row.engine for row in rows} == {"pinocchio"}
    assert {row.system for row in rows} == {"swing"}
    numbers = [row for row in rows if row.kind is FaultKind.LITERAL]
    assert [row.verdict for row in numbers] == [FaultVerdict.NAMED]
    (sentence,) = warned
    assert "arm.urdf: it does not agree with its equations in mujoco" in sentence


SWING = """<robot name="swing"><link name="base"/><link name="rod">
<inertial><origin xyz="0.1 0.02 -0.3"/><mass value="1.2"/>
<inertia ixx="0.03" iyy="0.02" izz="0.012" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/>
<axis xyz="0 0.6 0.8"/><dynamics damping="0.1"/></joint></robot>
"""


def test_typical_mistakes_are_planted_and_named(tmp_path: Path) -> None:
    """Cover mistakes that no single number explains: a reversed axis, exchanged moments."""
    file = written(tmp_path, "swing.urdf", SWING)
    task = model_task(prepare_tree(file, states=8), "mujoco")
    faults = [fault for fault in faults_of(task) if fault.size is None]
    assert [one.mistake.name for one in faults].count("grams for kilograms") == 1
    rows = [mutated(one) for one in faults if one.mistake.name != "grams for kilograms"]
    assert {(row.name, row.location): row.verdict for row in rows} == {
        ("axis flipped", "joint[hinge]/axis@xyz"): FaultVerdict.NAMED,
        ("moments exchanged", "link[rod]/inertial/inertia"): FaultVerdict.NAMED,
        ("centre of mass left out", "link[rod]/inertial/origin@xyz"): FaultVerdict.CAUGHT,
        # Nothing in this file needs a solver.
        ("the solver stops at its default tolerance", "settings.tolerance"): FaultVerdict.UNTESTED,
    }
    assert {row.kind for row in rows} == {FaultKind.MISTAKE}
    assert "axis of hinge reversed" in {row.message for row in rows}


@pytest.mark.skipif(engines()["pybullet"].version() is None, reason="needs PyBullet")
def test_engine_defaults_left_on_are_mistakes_of_a_robot(tmp_path: Path) -> None:
    file = written(tmp_path, "swing.urdf", SWING)
    task = model_task(prepare_tree(file, states=8), "pybullet")
    faults = [one for one in faults_of(task) if one.mistake.edit.settings]
    rows = {row.location: row for row in map(mutated, faults)}
    assert rows["settings.motors"].verdict is not FaultVerdict.UNTESTED
    flag = next(row for place, row in rows.items() if "inertia" in row.name)
    assert flag.verdict is FaultVerdict.NAMED


STOPPED = """<mujoco><option timestep="0.002"/><worldbody>
<body name="arm"><joint name="swing" axis="0 1 0" range="-40 30" frictionloss="0.2"/>
<inertial mass="1" pos=".15 0 0" diaginertia=".01 .02 .02"/>
<geom type="sphere" size=".05" pos=".3 0 0"/></body></worldbody></mujoco>"""


def test_numbers_and_mistakes_of_laws_are_planted_and_named(tmp_path: Path) -> None:
    """Catch numbers and mistakes of laws that are not planted or not named."""
    file = written(tmp_path, "arm.xml", STOPPED)
    task = model_task(prepare_tree(file, states=4), "mujoco")
    faults = {(one.mistake.location, one.mistake.name): one for one in faults_of(task)}
    chosen = [
        ("joint[swing]@range[1]", "1e-6"),
        (next(where for where, _ in faults if where.endswith("geom@size")), "1e-3"),
        ("law", "dry friction of joint swing is ignored"),
    ]
    rows = [mutated(fault) for key in chosen for fault in [faults[key]]]
    assert [row.verdict for row in rows] == [FaultVerdict.NAMED] * len(rows)
    assert rows[0].estimate_error == pytest.approx(0, abs=1e-3)
    assert rows[0].kind is FaultKind.LITERAL
    assert rows[2].message == "dry friction of joint swing is ignored"


SLIDING = """<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="3 3 .1"/>
<body pos="0 0 .05"><freejoint/><geom type="box" size=".1 .07 .05" mass="2"/></body>
</worldbody></mujoco>"""


def test_solver_that_stops_early_is_named(tmp_path: Path) -> None:
    """Catch an uncertainty without the solver's error, or silently dropped states."""
    file = written(tmp_path, "box.xml", SLIDING)
    task = model_task(prepare_tree(file, states=4), "mujoco")
    laws = trees.sound_laws(task)
    assert laws is not None
    (mistake,) = (one for one in law_mistakes(task, laws) if one.edit.settings)
    fault = PlantedFault(model=task, mistake=mistake)
    row = mutated(fault)
    assert row.verdict is FaultVerdict.NAMED
    assert row.message.startswith("the solver stops before it converges: error up to")
    assert row.location == "settings.tolerance"


LITERAL, MISTAKE, NONE = FaultKind
NAMED, CAUGHT, REFUSED, UNTESTED, MISSED, AGREES = FaultVerdict


def row(
    kind: FaultKind,
    name: str,
    verdict: FaultVerdict,
    location: str = "joint[x]@stiffness",
    message: str = "",
    first: float | None = 1e-9,
) -> Mutation:
    return Mutation(
        system="swing",
        model="mujoco.xml",
        engine="mujoco",
        kind=kind,
        name=name,
        location=location,
        verdict=verdict,
        discrepancy=0.1,
        message=message,
        estimate_error=None,
        first_caught=first,
    )


ROWS = (
    *(row(LITERAL, name, NAMED) for name in FAULTS),
    *(row(LITERAL, name, UNTESTED, "joint[x]@range[0]", first=None) for name in FAULTS),
    row(MISTAKE, "axis flipped", NAMED, "x"),
    row(MISTAKE, "axis flipped", CAUGHT, "y", "gravity along z"),
    row(MISTAKE, "gravity off", UNTESTED, "option@gravity[2]", first=None),
    row(MISTAKE, "friction left in", MISSED, "x"),
    row(MISTAKE, "motors", REFUSED, "settings.motors", "it won't"),
    row(NONE, "another time step", AGREES, "step 0.004 s", "error at dt 1.0 % -> 2.0 %"),
)


def test_output_of_a_mutation_is_as_recorded() -> None:
    wrong = row(NONE, "another time step", CAUGHT, "step 0.004 s", "damping on x")
    parts = [mutation_lines(ROWS, width) for width in (120, 80, 60)] + [mutation_lines([wrong], 80)]
    text = "\n".join([summary(ROWS), *itertools.chain(*parts), ""])
    assert max(map(len, parts[2])) <= 60
    assert text == recorded("mutation", text)


def test_json_has_every_row_and_no_infinity() -> None:
    text = encoded(Mutations(summary=summary(ROWS), rows=ROWS), indent=1)
    assert decoded(text.encode(), Mutations).rows == ROWS
    data = json.loads(text, parse_constant=pytest.fail)
    assert len(data["rows"]) == len(ROWS)
    untested = next(r for r in data["rows"] if r["location"] == "joint[x]@range[0]")
    assert untested["first_caught"] is None
    assert data["summary"] == summary(ROWS)


@pytest.mark.parametrize(
    ("rows", "code"),
    [
        (ROWS, 1),  # one was missed
        ([r for r in ROWS if r.verdict is not MISSED], 0),
        ([row(NONE, "another time step", CAUGHT, "step 0.004 s")], 1),
    ],
)
def test_command_writes_json_and_sets_the_exit_code(
    rows: Sequence[Mutation],
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(
        "physics_crosscheck.harness.interfaces.cli.mutate.mutate", lambda *_, **__: list(rows)
    )
    file = tmp_path / "new" / "mutations.json"
    assert main(["mutate", "mass_spring_damper", "--json", str(file)]) == code
    assert len(json.loads(file.read_text())["rows"]) == len(rows)
    assert capsys.readouterr().out.startswith("FAIL  " if code else "ok  ")


def test_folder_that_differs_is_an_error_and_writes_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise MutationError("mujoco.xml: it differs already")

    monkeypatch.setattr("physics_crosscheck.harness.interfaces.cli.mutate.mutate", refuse)
    file = tmp_path / "mutations.json"
    assert main(["mutate", "mass_spring_damper", "--json", str(file)]) == 3
    output = capsys.readouterr()
    assert output.err.splitlines()[-1] == "crosscheck: mujoco.xml: it differs already"
    assert not output.out
    assert not file.exists()
