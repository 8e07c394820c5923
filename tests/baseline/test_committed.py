"""The baseline in this repository."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.baseline.stale import location
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.harness.records.case import CaseId

ROOT = Path(__file__).parents[2]


def test_the_committed_baseline_is_of_the_models_as_they_are() -> None:
    place = ROOT / "reports" / "baseline"
    baseline = read_baseline(place)
    folders = system_folders([])
    assert set(baseline) == {folder.name for folder in folders}
    for folder in folders:
        one, scan = baseline[folder.name], folder_files(folder)
        assert one.declared.folder == location(folder, place)
        assert one.declared.declared == scan.system
        wanted = {
            CaseId(system=folder.name, model=model.model, scenario=scenario, engine=engine): (
                model.hashes
            )
            for model in scan.models
            for engine in model.engines
            for scenario in one.declared.scenarios
        }
        there = {
            case: entry.files
            for case, entry in one.cases.items()
            if engines()[case.engine].version() is not None  # of extras, those that are there
        }
        assert there == wanted
        assert {entry.outcome for entry in one.cases.values()} == {"AGREES"}
