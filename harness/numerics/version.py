"""Version of everything between a file and its verdict."""

VERSION = 2
"""Of the adapters, segments, ladder, uncertainty and reference. Raised whenever a change of this
package may move a figure of an unchanged case.

1: rounding measured for the verdict alone. 2: rounding measured wherever a limit is taken.
"""
