"""The DART adapter and the worlds that it steps."""

from .adapter import DartEngine

__all__ = ["DartEngine"]
