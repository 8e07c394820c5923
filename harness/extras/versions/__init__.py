"""The same models under several versions of an engine."""
