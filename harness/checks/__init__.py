"""Checks: one question each to an engine, from its load to its verdict."""
