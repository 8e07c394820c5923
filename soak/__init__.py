"""Attacks on this project: hostile inputs, faults while running, and fuzzing of its parsers."""
