"""MJX is MuJoCo in JAX: the same file is the same model, to the last digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.engines.conformance import CHECKS, conform
from physics_crosscheck.harness.engines.protocol import (
    EngineError,
    LoadedModel,
    ModelSpec,
    StateForce,
)
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import need

MODELS = Path(__file__).parents[2] / "models"


def load(path: Path, engine: str = "mjx", **settings: object) -> LoadedModel:
    need("mjx")
    return engines()[engine].load(ModelSpec(path, settings=settings))


def test_the_adapter_keeps_the_protocol(tmp_path: Path) -> None:
    need("mjx")
    sample = engines()["mjx"].samples()[0]
    path = tmp_path / sample.file
    path.write_text(sample.text)
    checks = conform(engines()["mjx"], ModelSpec(path))
    assert len(checks) == len(CHECKS)
    assert [str(check) for check in checks if not check.passed] == []


@pytest.mark.parametrize(("bits", "apart"), [(64, 1e-13), (32, 1e-4)])
def test_motions_are_mujocos_to_the_digits_that_it_has(bits: int, apart: float) -> None:
    path = MODELS / "free_pair" / "mujoco.xml"
    model, other = load(path, bits=bits), load(path, "mujoco")
    assert model.epsilon == np.finfo(f"float{bits}").eps
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=(2, 3, 2))
    push = rng.normal(size=(3, 700, 2))
    ends = model.rollout(q, v, 1e-3, 700, push, 350)
    for end, known in zip(ends, other.rollout(q, v, 1e-3, 700, push, 350), strict=True):
        assert np.max(np.abs(end - known)) < apart
    assert np.max(np.abs(ends[0][:, 1] - q)) > 0.1
    by_state = model.rollout(q, v, 1e-3, 20, StateForce(push[:, :20], lambda z, u: u), 20)
    numbers = model.rollout(q, v, 1e-3, 20, push[:, :20], 20)
    assert np.array_equal(by_state[0], numbers[0])


def test_what_mjx_has_not_or_reads_over_is_refused(tmp_path: Path) -> None:
    path = MODELS / "free_pair" / "mujoco.xml"
    with pytest.raises(EngineError, match="mjINT_IMPLICIT"):
        load(path, integrator="implicit")
    with pytest.raises(EngineError, match="expected 32 or 64"):
        load(path, bits=16)
    bent = tmp_path / "bent.xml"
    text = (MODELS / "mass_spring_damper" / "mujoco.xml").read_text()
    assert 'damping="0.9"' in text
    bent.write_text(text.replace('damping="0.9"', 'damping="0.9 0.2"'))
    with pytest.raises(EngineError, match="a polynomial of dof_damping, which MJX ignores"):
        load(bent)
