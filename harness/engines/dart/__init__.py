"""DART: its adapter, and the worlds that it steps."""

from harness.engines.dart.adapter import DartEngine

__all__ = ["DartEngine"]
