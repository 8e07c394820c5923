"""What an adapter of an engine is made of; `docs/engines.md` tells how to write one."""

from harness.engines.compiled import CompiledTree
from harness.engines.conformance import Check, conform, conform_samples
from harness.engines.mistake import DefaultLeftOn, LeftOut
from harness.engines.protocol import (
    Array,
    Engine,
    EngineError,
    Force,
    Model,
    ModelSpec,
    Sample,
    Spring,
    StateForce,
)
from harness.engines.remark import Remark

__all__ = [
    "Array", "Check", "CompiledTree", "DefaultLeftOn", "Engine", "EngineError", "Force", "LeftOut",
    "Model", "ModelSpec", "Remark", "Sample", "Spring", "StateForce", "conform", "conform_samples",
]  # fmt: skip
