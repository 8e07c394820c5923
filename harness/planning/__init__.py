"""Plans of runs: the jobs of every target, and what is reused of earlier runs."""
