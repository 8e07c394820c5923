"""`crosscheck sweep`: many cases of drawn constants, steps, integrators and engines."""
