"""What travels through the house and is written to files: frozen, typed, and nothing else."""
