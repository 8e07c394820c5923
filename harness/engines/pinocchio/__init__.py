"""Pinocchio: its adapter, and what it reads."""

from harness.engines.pinocchio.adapter import PinocchioEngine

__all__ = ["PinocchioEngine"]
