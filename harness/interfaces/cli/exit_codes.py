"""Exit codes of the commands."""

AGREE, DIFFER, USAGE, FAIL = 0, 1, 2, 3
"""All agree; a difference, or an unresolved case; wrong usage, as in argparse; a failure."""

SIGNALLED = 128
"""Base of the codes for signals, to which the signal's number is added; 130 is Ctrl-C."""
