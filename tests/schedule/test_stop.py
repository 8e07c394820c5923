"""Signals that end programs: the first asks, the second is as it was before."""

from __future__ import annotations

import os
import signal

import pytest

from physics_crosscheck.harness.jobs.stop import SIGNALS, Stopped, asking, raising


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_signal_asks_and_the_second_ends(number: signal.Signals) -> None:
    was = signal.signal(number, signal.SIG_DFL)  # under nohup SIGHUP is ignored
    try:
        with raising(), asking() as stop:
            asked = [stop.requested]
            os.kill(os.getpid(), number)
            assert [*asked, stop.requested] == [False, True]
            assert stop.name == number.name
            with pytest.raises(Stopped) as stopped:
                os.kill(os.getpid(), number)
            assert stopped.value.number == number
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, was)


def test_a_signal_that_is_ignored_stays_so(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with asking() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop.requested
    finally:
        signal.signal(signal.SIGHUP, before)
