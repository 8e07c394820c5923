"""Default folder of the baseline."""

from __future__ import annotations

from pathlib import Path

DEFAULT = Path("reports/baseline")
