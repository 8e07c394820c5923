"""Pinocchio: its adapter, and what it reads."""

from physics_crosscheck.harness.engines.pinocchio.adapter import PinocchioEngine

__all__ = ["PinocchioEngine"]
