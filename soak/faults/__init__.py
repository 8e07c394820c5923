"""What may happen while a run is on: signals, full disks, closed pipes, models that end or hang."""
