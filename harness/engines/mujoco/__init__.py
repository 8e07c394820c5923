"""MuJoCo, on MJCF and URDF, in C and in JAX."""

from .adapter import MujocoEngine, MujocoModel
from .mjx import MjxEngine

__all__ = ["MjxEngine", "MujocoEngine", "MujocoModel"]
