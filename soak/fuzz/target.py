"""A parser under attack, and its contract: a value, or an error that its documentation names."""

from __future__ import annotations

import resource
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

SECONDS = 2.0
"""Processor time that one input may take."""

MEMORY = 1 << 30
"""Bytes that one input may add to the address space."""

OWN = ("harness", "reference", "soak")


class SlowError(BaseException):
    """An input took longer than it may; no `except Exception` of a parser takes it for its own."""


class BrokenError(Exception):
    """A parser has returned a value that it must not."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """One parser.

    Attributes:
        name: by which it is chosen.
        parse: takes an input; what it raises beside `errors` is a find.
        errors: what its documentation names.
        seeds: sound inputs to begin from.
        words: pieces that mutations put in.
        share: of the time, relative to the others.
        bounded: whether the parser itself bounds what an input costs. What stands in `system.py`
            is a program's text and may compute for ever; there a run's own limits are the bound.
    """

    name: str
    parse: Callable[[bytes], object]
    errors: tuple[type[Exception], ...]
    seeds: Callable[[], Iterator[bytes]]
    words: tuple[str, ...]
    share: float = 1.0
    bounded: bool = True


@dataclass(frozen=True, kw_only=True)
class Find:
    """An input that broke a contract; two finds with one `place` are the same.

    Attributes:
        place: kind of what was raised, and the innermost line of this project's.
        told: the exception as one line.
        input: what was parsed.
    """

    target: str
    place: str
    told: str
    input: bytes


def attack(target: Target, data: bytes) -> Find | None:
    """Parse an input; None where the contract held."""
    try:
        with _limited():
            target.parse(data)
    except target.errors:
        return None
    except (Exception, SlowError) as error:
        if isinstance(error, SlowError | MemoryError) and not target.bounded:
            return None
        said = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        return Find(target=target.name, place=_place(error), told=said, input=data)
    return None


def _place(error: BaseException) -> str:
    kind = type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if set(OWN) & set(Path(f.filename).parts) and f.name != "attack"]
    # Where the clock ran out within a parser is another line each time; the parser is the same.
    if isinstance(error, SlowError) and own:
        return f"{kind} in {Path(own[1 if len(own) > 1 else 0].filename).name}"
    return f"{kind} at {Path(own[-1].filename).name}:{own[-1].name}" if own else kind


@contextmanager
def _limited() -> Iterator[None]:
    """Bound processor time and memory of what is done within."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise SlowError(f"more than {SECONDS:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_address_space() + MEMORY, hard))
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.signal(signal.SIGVTALRM, before)


def _address_space() -> int:
    pages = Path("/proc/self/statm").read_text("ascii").split()[0]
    return int(pages) * resource.getpagesize()
