"""Equations of motion: from energies, or by recursion over a tree of bodies."""
