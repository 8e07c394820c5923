"""Notebook functions: trajectories, tables, plots, and comparisons of two models."""
