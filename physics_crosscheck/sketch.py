"""Parts of a sketch: shapes that show in the report how a mechanism looks."""

from physics_crosscheck.reference.mechanism.sketch import Angle, Body, Link

__all__ = ["Angle", "Body", "Link"]
