"""Where a baseline lies, unless another place is told."""

from __future__ import annotations

from pathlib import Path

DEFAULT = Path("reports/baseline")
