"""What an engine does as h -> 0, and what its step costs."""
