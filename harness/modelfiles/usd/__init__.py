"""USD stages as trees of bodies."""

from .read import UsdNumbers
from .read import read_usd_robot as read

numbers = UsdNumbers

__all__ = ["numbers", "read"]
