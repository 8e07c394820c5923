"""No false alarm: sound models at random constants."""

import pytest

from harness.verdict import Outcome
from tests.diagnosis.random_draws import campaign, pairings


@pytest.mark.parametrize("seed", [11, 12])
def test_no_model_differs_at_random_constants(seed):
    results = campaign(27, seed)
    assert len(pairings()) == 27  # each seed goes once over all of them
    for verdict, what in results:
        assert verdict.outcome in (Outcome.AGREES, Outcome.UNRESOLVED), (what, verdict.reason)
        if verdict.outcome is Outcome.UNRESOLVED:
            assert verdict.discrepancy <= verdict.uncertainty, what
    agree = sum(verdict.outcome is Outcome.AGREES for verdict, _ in results)
    assert agree >= 24
