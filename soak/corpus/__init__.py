"""Hostile inputs for every format and command, with the required result of each."""
