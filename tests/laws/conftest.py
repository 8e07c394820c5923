"""A fixture that draws few states, since each shows most of a scene's rows."""

from collections.abc import Iterator
from typing import Any

import pytest

from physics_crosscheck.harness.checks import law_states
from physics_crosscheck.harness.checks.law_states import STATES, drawn_states
from physics_crosscheck.reference.laws.step import LawModel

FEW_STATES = 6
"""States for convex laws, two of each kind; laws of impulses need more."""


@pytest.fixture
def few_states(monkeypatch: pytest.MonkeyPatch) -> None:
    def draw_few(comparison: Any) -> Iterator[Any]:
        return drawn_states(
            comparison, FEW_STATES if isinstance(comparison.laws, LawModel) else STATES
        )

    monkeypatch.setattr(law_states, "drawn_states", draw_few)
