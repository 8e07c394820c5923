"""Mechanisms as declared: coordinates, parameters, bodies, joints, forces and scenarios."""
