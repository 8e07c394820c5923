"""PyBullet, on URDF."""

from .adapter import PybulletEngine, PybulletModel

__all__ = ["PybulletEngine", "PybulletModel"]
