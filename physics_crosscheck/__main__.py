"""`python -m physics_crosscheck` is `crosscheck`, beside any folder."""

import sys

from physics_crosscheck.harness.interfaces.cli.main import program

if __name__ == "__main__":
    sys.exit(program())
