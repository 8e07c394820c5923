"""The baseline in this repository."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.baseline.stale import location
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import system_folders
from physics_crosscheck.records import CaseId

ROOT = Path(__file__).parents[2]


def test_committed_baseline_matches_the_models() -> None:
    place = ROOT / "reports" / "baseline"
    baseline = read_baseline(place)
    folders = system_folders([])
    assert set(baseline) == {folder.name for folder in folders}
    for folder in folders:
        accepted, scan = baseline[folder.name], folder_files(folder)
        assert accepted.declared.folder == location(folder, place)
        assert accepted.declared.declared == scan.system
        wanted = {
            CaseId(system=folder.name, model=model.model, scenario=scenario, engine=engine): (
                model.hashes
            )
            for model in scan.models
            for engine in model.engines
            for scenario in accepted.declared.scenarios
        }
        present = {
            case: entry.files
            for case, entry in accepted.cases.items()
            if engines()[case.engine].version() is not None  # only installed extras
        }
        assert present == wanted
        assert {entry.outcome for entry in accepted.cases.values()} == {"AGREES"}
