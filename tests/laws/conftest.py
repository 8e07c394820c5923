"""Few states of each scene, since here every one shows most of the scene's rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from physics_crosscheck.harness.checks import law_states
from physics_crosscheck.harness.checks.law_comparison import LawComparison
from physics_crosscheck.harness.checks.law_states import STATES, drawn_states

FEW = 6
"""States by convex laws: two of each kind that is drawn. Impulses show less in each."""


@pytest.fixture
def few_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw few states of each scene."""

    def few(comparison: Any) -> Iterator[Any]:
        return drawn_states(comparison, FEW if type(comparison) is LawComparison else STATES)

    monkeypatch.setattr(law_states, "drawn_states", few)
