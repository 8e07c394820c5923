"""PyBullet, on URDF."""

from physics_crosscheck.harness.engines.pybullet.adapter import PybulletEngine, PybulletModel

__all__ = ["PybulletEngine", "PybulletModel"]
