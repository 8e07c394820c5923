"""What was accepted of a case, what it is now, and what has become of it in between."""
