"""Results for people: in a terminal, and as an HTML report."""
