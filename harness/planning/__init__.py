"""Plans of runs: the jobs of every target, and the reused results of earlier runs."""
