"""What the commands end with."""

from __future__ import annotations

AGREE, DIFFER, USAGE, FAIL = 0, 1, 2, 3
"""Exit codes: all agree; a difference or nothing certain; wrong usage; something could not run."""

SIGNALLED = 128
"""With the number of a signal added: stopped by it, as shells have it; 130 is Ctrl-C."""
