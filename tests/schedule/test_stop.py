"""Signals that end programs: the first requests a stop, the second ends the program."""

from __future__ import annotations

import os
import signal

import pytest

from physics_crosscheck.harness.jobs.stop import SIGNALS, Stopped, asking, raising


@pytest.mark.parametrize("number", SIGNALS)
def test_first_signal_requests_a_stop_and_second_ends(number: signal.Signals) -> None:
    was = signal.signal(number, signal.SIG_DFL)  # under nohup SIGHUP is ignored
    try:
        with raising(), asking() as stop:
            before = [stop.requested]
            os.kill(os.getpid(), number)
            assert [*before, stop.requested] == [False, True]
            assert stop.name == number.name
            with pytest.raises(Stopped) as stopped:
                os.kill(os.getpid(), number)
            assert stopped.value.number == number
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, was)


def test_ignored_signal_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with asking() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop.requested
    finally:
        signal.signal(signal.SIGHUP, before)
