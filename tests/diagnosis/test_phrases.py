"""The phrase of every cause, as reports show it."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.diagnosis.hypotheses import everything
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.variants import variants

PHRASES: dict[str, dict[str, list[str]]] = json.loads(
    (Path(__file__).parent / "phrases.json").read_text()
)
"""Phrases by system and kind, of all models in all engines."""

MISSING_TERMS = {
    "inertia": "inertia on {}",
    "damping": "damping on {}",
    "quadratic damping": "quadratic damping on {}",
    "friction": "friction on {}",
    "spring": "spring on {}",
    "offset force": "offset force on {}",
}
"""Phrases of terms that the equations may lack, for each coordinate of a system."""


@pytest.mark.parametrize("name", PHRASES)
def test_every_hypothesis_of_a_builtin_system_has_its_phrase(name: str) -> None:
    system = load_system(builtin() / name)
    free = variants(derive(system), np.ones(2 * len(system.coordinates)))
    actual: dict[str, set[str]] = defaultdict(set)
    for sidecar in model_files(builtin() / name):
        assert isinstance(sidecar, Sidecar)
        for engine in (one for one in sidecar.engines if not engines()[one].extra):
            candidates = everything(system, sidecar, *load(system, sidecar, engine), free)
            names = [candidate.id for candidate in candidates]
            assert len(set(names)) == len(names)
            for identity in names:
                actual[identity.kind].add(str(identity))
    expected = {kind: set(phrases) for kind, phrases in PHRASES[name].items()}
    for kind, phrase in MISSING_TERMS.items():
        expected[kind] = {phrase.format(c.name) for c in system.coordinates}
    assert actual == expected
