"""What was accepted of every model, and what moved since: the baseline and its gate."""
