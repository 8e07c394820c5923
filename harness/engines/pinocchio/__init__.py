"""The Pinocchio adapter and its parsers."""

from physics_crosscheck.harness.engines.pinocchio.adapter import PinocchioEngine

__all__ = ["PinocchioEngine"]
