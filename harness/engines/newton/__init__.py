"""The Newton adapter, its parsers and the worlds that it steps."""

from .adapter import NewtonEngine

__all__ = ["NewtonEngine"]
