"""The surroundings that every test starts from."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="session")
def outside_ci() -> Iterator[None]:
    """`accept` is refused in CI, where this suite runs too: a test of that sets the variable."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("CI", "GITHUB_ACTIONS"):
            patch.delenv(name, raising=False)
        yield
