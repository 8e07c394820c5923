"""URDF files as trees of bodies."""
