"""Faults planted in models, to measure what a validation would catch."""
