"""Two literals wrong at once, drawn by `campaigns.random_pairs`."""

import pytest

from campaigns.random_pairs import campaign


@pytest.mark.slow
def test_both_of_two_faults_are_named() -> None:
    trials = campaign(3, seed=11)
    assert all(t.named and t.explained for t in trials), [t for t in trials if not t.named]
