"""Robots' files as trees of bodies: read whole, with all that is left out or in the way said."""
