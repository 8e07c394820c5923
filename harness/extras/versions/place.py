"""Default folder of environments."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.modelfiles.code_reads import user_cache


def cache() -> Path:
    """Return the user's cache folder."""
    return user_cache() / "physics-crosscheck" / "environments"
