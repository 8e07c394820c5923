"""Engines, checks, results and commands; `physics_crosscheck` is the package to import from."""

__version__ = "0.1.0"
