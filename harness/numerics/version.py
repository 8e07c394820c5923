"""Version of everything between a file and its verdict."""

VERSION = 7
"""Version of the adapters, segments, ladder, uncertainty and reference.

It increases whenever a change of this package may change a number of an unchanged case.

1: rounding is measured for the verdict alone. 2: rounding is measured for every limit. 3: every U
includes rounding shared by all runs; the reference's bound includes the rounding of times and
inputs; the map's residual and the run at the file's own time step are judged. 4: rungs as far as
the resolution needs; coarser full runs for a tiny error. 5: full runs of twice and half the step,
where these suffice. 6: the error of velocities; steps for 1 %, 0.1 % and 0.01 % apply to both. 7:
single steps decide where they leave no doubt; linearizations by differences of accelerations.
"""
