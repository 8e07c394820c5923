"""PyBullet, on URDF."""

from harness.engines.pybullet.adapter import PybulletEngine, PybulletModel

__all__ = ["PybulletEngine", "PybulletModel"]
