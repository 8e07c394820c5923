"""The job graph, worker processes, limits, and records of the files that code reads."""
