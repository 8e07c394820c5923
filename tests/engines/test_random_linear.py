"""The uncertainty bounds the true error on random linear systems with known limits."""

import numpy as np
import pytest

from tests.engines.random_linear import PAIRINGS, summary, sweep

COUNT = 3
"""Systems per pairing; `python -m tests.engines.random_linear --count N` draws more."""

SEED = 2025


@pytest.mark.slow
@pytest.mark.parametrize("pairing", PAIRINGS)
def test_true_error_of_random_linear_systems_is_within_the_uncertainty(
    pairing: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip(pairing.split()[0])
    results = list(sweep(SEED, COUNT, pairing))
    with capsys.disabled():
        print(f"\n{pairing}: {summary(results)}")
    wrong = [str(f) for f in results if f.misses or f.outcome == "DIFFERS"]
    assert not wrong, "\n".join(wrong)
    alarms = [str(f) for f in results if not f.order_confirmed]
    assert not alarms, "\n".join(alarms)
    unresolved = [str(f) for f in results if f.outcome != "AGREES"]
    assert not unresolved, "\n".join(unresolved)
    # A huge uncertainty would pass the checks above without being useful.
    assert max(f.uncertainty for f in results) < 1e-9
    assert np.median([f.ratio for f in results]) < 1000
