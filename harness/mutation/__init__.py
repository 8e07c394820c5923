"""Models made wrong on purpose: what a validation would catch."""
