"""The PhysX adapter, the layer that it writes over a stage, and the stage in PhysX."""

from .adapter import PhysxEngine

__all__ = ["PhysxEngine"]
