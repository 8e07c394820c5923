"""MuJoCo, on MJCF and on URDF."""

from harness.engines.mujoco.adapter import MujocoEngine, MujocoModel

__all__ = ["MujocoEngine", "MujocoModel"]
