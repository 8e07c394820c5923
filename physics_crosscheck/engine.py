"""Building blocks of an engine adapter; `docs/engines/adapter.md` shows how to write one."""

from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.conformance import Check, conform, conform_samples
from physics_crosscheck.harness.engines.protocol import (
    Array,
    DefaultLeftOn,
    Engine,
    EngineError,
    Force,
    LeftOut,
    LoadedModel,
    ModelSpec,
    Sample,
    Spring,
    StateForce,
)
from physics_crosscheck.harness.engines.remark import Remark

__all__ = [
    "Array", "Check", "CompiledTree", "DefaultLeftOn", "Engine", "EngineError", "Force", "LeftOut",
    "LoadedModel", "ModelSpec", "Remark", "Sample", "Spring", "StateForce", "conform",
    "conform_samples",
]  # fmt: skip
