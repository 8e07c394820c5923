"""Worker processes, and the order of the work."""
