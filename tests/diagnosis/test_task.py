"""The record of a diagnosis, from a wrong file to the reported sentences."""

import shutil
from pathlib import Path

import msgspec
import pytest

from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.diagnosis.task import diagnose_model
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.results.causes import cause_sentences
from physics_crosscheck.records import CauseId, Diagnosis, SourceLine
from tests.physics import physics

MASS = "body[nut and bolt]/inertial@mass"

pytestmark = pytest.mark.skipif(
    engines()["mujoco"].version() is None, reason="mujoco is not installed"
)


def make_task(tmp_path: Path, mass: str) -> SystemTask:
    """Return a task of the mass on a spring whose body is called `nut and bolt`."""
    folder = tmp_path / "mass_spring_damper"
    shutil.copytree(builtin() / "mass_spring_damper", folder)
    for name, old, new in (
        ("mujoco.xml", '<body name="mass"', '<body name="nut and bolt"'),
        ("mujoco.xml", 'mass="1.3"', f'mass="{mass}"'),
        ("mujoco.xml.toml", "body[mass]", "body[nut and bolt]"),
    ):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    prepared = physics("mass_spring_damper")
    task = model_task(prepared, "mujoco", read_sidecar(folder / "mujoco.xml.toml"))
    motions = dict(list(prepared.motions.items())[:2])  # free and forced
    return task.with_target(motions=motions)


def test_body_with_and_in_its_name_is_one_cause(tmp_path: Path) -> None:
    task = make_task(tmp_path, "1.313")
    diagnosis = diagnose_model(task)
    assert diagnosis.explained
    assert not diagnosis.failure
    first = diagnosis.explanations[0]
    (cause,) = first.causes
    assert cause.id == CauseId(kind="literal", subject=(MASS,))
    text = task.declared.model.read_text()
    line = text[: text.index('mass="1.313"')].count("\n") + 1
    start = text.encode().index(b'mass="1.313"') + len(b'mass="')
    where = SourceLine(file="mujoco.xml", line=line, span=(start, start + 5), text="1.313")
    assert cause.locations == (where,)
    assert cause.replacement == "1.3"
    assert cause.estimate == pytest.approx(1.3, rel=1e-6)
    sentence, residual = cause_sentences(first)
    assert sentence.startswith(f"{MASS} (mujoco.xml:{line}) is 1.313; the motion implies 1.3")
    assert residual.startswith("residual ")
    assert diagnosis.corrected is not None
    assert len(diagnosis.corrected.causes) == 1
    assert msgspec.json.decode(msgspec.json.encode(diagnosis), type=Diagnosis) == diagnosis
