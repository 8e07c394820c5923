"""The Newton adapter, its parsers and the worlds that it steps."""

from physics_crosscheck.harness.engines.newton.adapter import NewtonEngine

__all__ = ["NewtonEngine"]
