"""`python -m physics_crosscheck` is `crosscheck`, beside any folder."""

import sys

from physics_crosscheck.main import main

if __name__ == "__main__":
    sys.exit(main())
