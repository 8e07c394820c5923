"""`python -m harness` is `crosscheck`, where no other package of that name is before it."""

import sys

import physics_crosscheck

if __name__ == "__main__":
    # A user's own package `reference` in the working folder would be found first.
    physics_crosscheck.claim()
    from harness.cli.main import program

    sys.exit(program())
