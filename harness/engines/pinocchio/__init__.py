"""The Pinocchio adapter and its parsers."""

from .adapter import PinocchioEngine

__all__ = ["PinocchioEngine"]
