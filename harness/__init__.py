"""Hold physics models against their equations, to nine digits, in every engine that runs them.

`physics_crosscheck` is the name to import from; what lies here may move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.api import check

__all__ = ["check"]


def __getattr__(name: str) -> object:
    # Not imported before it is asked for: pytest imports this package in every project.
    if name == "check":
        from harness.api import check

        return check
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
