"""From a discrepancy to its cause: evidence, suspects, fits, and what is told of them."""
