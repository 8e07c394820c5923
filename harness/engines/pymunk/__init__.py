"""pymunk (Munk2D), on Python files that build a Space."""

from physics_crosscheck.harness.engines.pymunk.adapter import PymunkEngine, PymunkModel

__all__ = ["PymunkEngine", "PymunkModel"]
