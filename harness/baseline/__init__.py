"""Comparison of cases with their accepted results."""
