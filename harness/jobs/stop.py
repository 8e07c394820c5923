"""Being asked to stop: by Ctrl-C, or by a signal that ends programs."""

from __future__ import annotations

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
    """A signal that ends the program came; what is open is closed on the way out."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class Stop:
    """Whether someone asked for an end.

    Attributes:
        number: of the signal; 0 before one came.
    """

    def __init__(self) -> None:
        self.number = 0

    @property
    def asked(self) -> bool:
        """Whether one came."""
        return self.number != 0

    @property
    def name(self) -> str:
        """Of the signal."""
        return signal.Signals(self.number).name


@contextlib.contextmanager
def raising() -> Iterator[None]:
    """Meanwhile each of the signals raises `Stopped`, so that nothing stays behind."""

    def stopped(number: int, _: FrameType | None) -> NoReturn:
        raise Stopped(number)

    with _handled(stopped):
        yield


@contextlib.contextmanager
def asking() -> Iterator[Stop]:
    """Meanwhile the first of the signals asks to stop; a second one is as it was before."""
    stop = Stop()

    def asked(number: int, _: FrameType | None) -> None:
        stop.number = number
        restore()

    with _handled(asked) as restore:
        yield stop


@contextlib.contextmanager
def _handled(handler: Any) -> Iterator[Any]:
    """Meanwhile a handler has the signals that are not ignored; yields what ends that."""
    before = {}
    if threading.current_thread() is threading.main_thread():  # no other may
        taken = [n for n in SIGNALS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
        before = {number: signal.signal(number, handler) for number in taken}

    def restore() -> None:
        while before:
            signal.signal(*before.popitem())

    try:
        yield restore
    finally:
        restore()
