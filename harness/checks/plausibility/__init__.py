"""Plausibility of a robot's file: advice about numbers that real robots do not have."""
