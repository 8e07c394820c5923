"""The gate: comparison of every model with the accepted baseline."""
