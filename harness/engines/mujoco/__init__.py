"""MuJoCo, on MJCF and URDF, in C and in JAX."""

from physics_crosscheck.harness.engines.mujoco.adapter import MujocoEngine, MujocoModel
from physics_crosscheck.harness.engines.mujoco.mjx import MjxEngine

__all__ = ["MjxEngine", "MujocoEngine", "MujocoModel"]
