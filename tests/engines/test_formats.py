"""Formats of other engines: numbers have addresses; files without sidecars are reported."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.diagnosis.hypotheses import everything
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.known_answer import KnownEngine
from physics_crosscheck.harness.engines.mujoco.urdf import spring_terms
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.locations import find, line_of, numbers
from physics_crosscheck.harness.modelfiles.model_files import UnreadModel, model_files
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from tests.faults.known_folder import known_folder

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
    model, coordinates = load(physics.system, sidecar, "known")
    tried = everything(physics.system, sidecar, model, coordinates, physics.variants)
    names = {str(candidate.hypothesis.id) for candidate in tried}
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
    model, coordinates = load(physics.system, sidecar, "known")
    tried = everything(physics.system, sidecar, model, coordinates, physics.variants)
    assert not any("literal" in candidate.hypothesis.id.kind for candidate in tried)
    assert np.all([candidate.hypothesis.size > 0 for candidate in tried])


def test_model_file_without_a_sidecar_is_reported(folder: Path) -> None:
    (folder / "forgotten.known").write_text((folder / "good.known").read_text())
    unread = [one for one in model_files(folder) if isinstance(one, UnreadModel)]
    assert [one.model for one in unread] == ["forgotten.known"]
    assert 'engines = ["known"]' in unread[0].reason
    assert folder_files(folder).broken == (f"{folder / 'forgotten.known'}: has no sidecar",)


def test_spring_is_a_number_or_a_polynomial() -> None:
    assert spring_terms(5.0, 0.0) == 5.0
    assert spring_terms(5.0, np.zeros(3)) == [5.0, 0.0, 0.0]
