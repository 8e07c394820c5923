"""Version of everything between a file and its verdict."""

VERSION = 6
"""Of the adapters, segments, ladder, uncertainty and reference. Raised whenever a change of this
package may move a figure of an unchanged case.

1: rounding measured for the verdict alone. 2: rounding measured wherever a limit is taken. 3: what
is rounded alike in every run is in every U; the reference's bound has the rounding of times and of
inputs; the map's residual and the shipped run are judged. 4: rungs as far as the resolution needs;
coarser full runs where the shipped one's error is tiny. 5: full runs of twice and half the step,
where these suffice. 6: the error of velocities; steps for 1 %, 0.1 % and 0.01 % hold for both.
"""
