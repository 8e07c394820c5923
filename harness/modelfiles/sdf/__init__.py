"""SDFormat files as trees of bodies."""
