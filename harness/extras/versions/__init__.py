"""Run the same models under several versions of an engine."""
