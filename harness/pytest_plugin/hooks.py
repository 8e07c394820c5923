"""The hook of the plugin, for a project's conftest.py."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any


def pytest_crosscheck_case(record: Mapping[str, Any]) -> Iterable[str] | None:
    """Demand more of a case than that it agrees, such as a raw error below one per cent.

    Called with the record of each case that passes, as in results.json; it fails with the
    sentences returned. Hooks of a conftest.py apply to the system folders below it.
    """
