"""Commands and functions beyond a run: sweeps, engine versions, notebooks."""
