"""The Drake adapter and the plants that it steps."""

from physics_crosscheck.harness.engines.drake.adapter import DrakeEngine

__all__ = ["DrakeEngine"]
