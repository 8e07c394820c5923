"""MuJoCo, on MJCF and on URDF, in C and in JAX."""

from harness.engines.mujoco.adapter import MujocoEngine, MujocoModel
from harness.engines.mujoco.mjx import MjxEngine

__all__ = ["MjxEngine", "MujocoEngine", "MujocoModel"]
