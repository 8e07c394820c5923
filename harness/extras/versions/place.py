"""Where environments are kept, unless another place is told."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.modelfiles.code_reads import user_cache


def cache() -> Path:
    """The user's folder for what can be made again."""
    return user_cache() / "physics-crosscheck" / "environments"
