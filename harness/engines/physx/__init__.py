"""The PhysX adapter, the layer that it writes over a stage, and the stage in PhysX."""

from physics_crosscheck.harness.engines.physx.adapter import PhysxEngine

__all__ = ["PhysxEngine"]
