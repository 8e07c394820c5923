"""The DART adapter and the worlds that it steps."""

from physics_crosscheck.harness.engines.dart.adapter import DartEngine

__all__ = ["DartEngine"]
