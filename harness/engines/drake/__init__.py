"""The Drake adapter and the plants that it steps."""

from .adapter import DrakeEngine

__all__ = ["DrakeEngine"]
