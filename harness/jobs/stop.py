"""Requests to stop: Ctrl-C, or a signal that terminates programs."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any, NoReturn

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


class Stopped(KeyboardInterrupt):
    """A signal that terminates the program; resources are closed while it propagates."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class Stop:
    """The state of a request to stop.

    Attributes:
        number: number of the signal; 0 without a request.
    """

    def __init__(self) -> None:
        self.number = 0

    @property
    def requested(self) -> bool:
        """True after a signal arrived."""
        return self.number != 0

    @property
    def name(self) -> str:
        """Name of the signal."""
        return signal.Signals(self.number).name


@contextlib.contextmanager
def raising() -> Iterator[None]:
    """Raise `Stopped` in the context for each of the signals, so that cleanup runs."""

    def stopped(number: int, _: FrameType | None) -> NoReturn:
        raise Stopped(number)

    with _handled(stopped):
        yield


@contextlib.contextmanager
def asking() -> Iterator[Stop]:
    """Treat the first signal in the context as a request to stop; a second one acts as usual."""
    stop = Stop()

    def request(number: int, _: FrameType | None) -> None:
        stop.number = number
        restore()

    with _handled(request) as restore:
        yield stop


@contextlib.contextmanager
def _handled(handler: Any) -> Iterator[Any]:
    """Install a handler for all signals that are not ignored; yield a function that removes it."""
    before = {}
    if threading.current_thread() is threading.main_thread():  # Python allows it in no other thread
        handled = [n for n in SIGNALS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
        before = {number: signal.signal(number, handler) for number in handled}

    def restore() -> None:
        while before:
            signal.signal(*before.popitem())

    try:
        yield restore
    finally:
        restore()
