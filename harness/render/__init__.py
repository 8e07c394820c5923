"""Results for a terminal and as an HTML report."""
