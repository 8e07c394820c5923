"""Hostile inputs over every format and command, made on the spot, and what must hold of each."""
