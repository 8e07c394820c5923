"""pymunk (Munk2D), on Python files that build a Space."""

from .adapter import PymunkEngine, PymunkModel

__all__ = ["PymunkEngine", "PymunkModel"]
