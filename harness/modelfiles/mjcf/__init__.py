"""MJCF files as trees of bodies: read from what an engine compiles."""
