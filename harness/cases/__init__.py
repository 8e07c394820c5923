"""One case: a folder prepared, a model run in one scenario, and judged."""
