"""Robots that people have, read and checked."""
