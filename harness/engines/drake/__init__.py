"""Drake: its adapter, and the plants that it steps."""

from harness.engines.drake.adapter import DrakeEngine

__all__ = ["DrakeEngine"]
