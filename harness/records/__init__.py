"""Typed, frozen records that pass between folders and into files."""
