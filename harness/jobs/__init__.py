"""The job graph, worker processes, limits, and records of what code reads."""
