"""The uncertainty is honest on random linear systems, whose limits are known."""

import numpy as np
import pytest

from tests.engines.random_linear import PAIRINGS, summary, sweep

COUNT = 3
"""A pairing; `python -m tests.engines.random_linear` draws as many as are wanted."""

SEED = 2025


@pytest.mark.slow
@pytest.mark.parametrize("pairing", PAIRINGS)
def test_the_true_error_of_random_linear_systems_is_within_the_uncertainty(
    pairing: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip(pairing.split()[0])
    found = list(sweep(SEED, COUNT, pairing))
    with capsys.disabled():
        print(f"\n{pairing}: {summary(found)}")
    wrong = [str(f) for f in found if f.misses or f.outcome == "DIFFERS"]
    assert not wrong, "\n".join(wrong)
    alarms = [str(f) for f in found if not f.order_confirmed]
    assert not alarms, "\n".join(alarms)
    unresolved = [str(f) for f in found if f.outcome != "AGREES"]
    assert not unresolved, "\n".join(unresolved)
    # An uncertainty that is honest by being huge would say nothing.
    assert max(f.uncertainty for f in found) < 1e-9
    assert np.median([f.ratio for f in found]) < 1000
