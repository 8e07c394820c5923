"""What a notebook asks for: trajectories, tables, plots, and two models held against each other."""
