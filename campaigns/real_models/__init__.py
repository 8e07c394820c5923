"""Checks of public robot files."""
