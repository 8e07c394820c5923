"""The console script."""

from __future__ import annotations


def main() -> int:
    """Run the command line; returns the exit code."""
    # Not before the names are bound, which importing this package has done.
    from harness.cli.main import program

    return program()
