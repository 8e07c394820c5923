"""Faults while a run is in progress: signals, full disks, closed pipes, models that end or hang."""
