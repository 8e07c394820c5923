"""MJCF files as trees of bodies, from the numbers that an engine compiles."""
