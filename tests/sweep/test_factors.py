from __future__ import annotations

import pytest

from harness.sweep.draws import Design, draws
from harness.sweep.factors import SweepError, factor, factors


def test_a_range_a_logarithmic_one_and_a_list_are_read() -> None:
    assert factor("k=10:30").value(0.25) == 15.0
    assert factor("k=10:1000:log").value(0.5) == pytest.approx(100.0)
    listed = factor("k=1,2,4")
    assert [listed.value(share) for share in (0.0, 0.34, 0.99, 1.0)] == [1.0, 2.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("k", "say NAME=LOW:HIGH"),
        ("k=", "say NAME=LOW:HIGH"),
        ("k=3:2", "3 is not below 2"),
        ("k=0:2:log", "values above zero"),
        ("k=1:2:lin", "only `:log`"),
        ("k=1:2:3:4", "only `:log`"),
        ("k=a:2", "'a' is no number"),
        ("k=1,nan", "'nan' is no finite number"),
        ("k=1,1", "twice"),
    ],
)
def test_what_is_no_range_is_refused_with_what_it_should_be(text: str, said: str) -> None:
    with pytest.raises(SweepError, match=f"--vary {text}.*{said}"):
        factor(text)


def test_a_constant_is_varied_once() -> None:
    with pytest.raises(SweepError, match="k: it is varied twice"):
        factors(["k=1:2", "k=3,4"])


def test_a_range_needs_a_number_of_draws() -> None:
    with pytest.raises(SweepError, match=r"--vary k: .*--draws N"):
        draws(factors(["m=1,2", "k=1:2"]), Design.LATIN, None, 0)
