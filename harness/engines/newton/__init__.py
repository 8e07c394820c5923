"""Newton: its adapter, what it reads, and the worlds that it steps."""

from physics_crosscheck.harness.engines.newton.adapter import NewtonEngine

__all__ = ["NewtonEngine"]
