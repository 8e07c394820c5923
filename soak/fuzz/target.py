"""A parser under attack, and its contract: it returns a value or raises a documented error."""

from __future__ import annotations

import resource
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

LIMIT_SECONDS = 2.0
"""Limit of the processor time of one input."""

LIMIT_BYTES = 1 << 30
"""Limit of the address space that one input may add."""

PROJECT_FOLDERS = ("harness", "reference", "soak")


class SlowError(BaseException):
    """An input exceeded the time limit. A parser's `except Exception` does not catch this error."""


class ContractError(Exception):
    """A parser returned a value that its contract forbids."""


@dataclass(frozen=True, kw_only=True)
class FuzzTarget:
    """One parser and its contract.

    Attributes:
        name: name for `--only`.
        parse: parses an input. Any exception other than `errors` is a find.
        errors: the documented exceptions.
        seeds: valid inputs from which mutations start.
        words: texts that mutations insert.
        share: share of the time, relative to other parsers.
        bounded: true if the parser itself bounds the cost of an input. Code in `system.py` may
            compute forever, and only the limits of a run bound it.
    """

    name: str
    parse: Callable[[bytes], object]
    errors: tuple[type[Exception], ...]
    seeds: Callable[[], Iterator[bytes]]
    words: tuple[str, ...]
    share: float = 1.0
    bounded: bool = True


@dataclass(frozen=True, kw_only=True)
class FuzzFinding:
    """An input that broke a contract. Two finds with one `location` count as the same.

    Attributes:
        location: type of the exception, and the innermost function of this project.
        message: the exception as one line.
        input: the parsed bytes.
    """

    target: str
    location: str
    message: str
    input: bytes


def attack(target: FuzzTarget, data: bytes) -> FuzzFinding | None:
    """Parse an input, and return a find, or None if the parser met its contract."""
    try:
        with _limit_resources():
            target.parse(data)
    except target.errors:
        return None
    except (Exception, SlowError) as error:
        if isinstance(error, SlowError | MemoryError) and not target.bounded:
            return None
        message = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        return FuzzFinding(
            target=target.name, location=_location(error), message=message, input=data
        )
    return None


def _location(error: BaseException) -> str:
    kind = type(error).__name__
    inside = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if set(PROJECT_FOLDERS) & set(Path(frame.filename).parts) and frame.name != "attack"
    ]
    # A timeout hits another line each time, so the file of the parser identifies the find.
    if isinstance(error, SlowError) and inside:
        return f"{kind} in {Path(inside[1 if len(inside) > 1 else 0].filename).name}"
    return f"{kind} at {Path(inside[-1].filename).name}:{inside[-1].name}" if inside else kind


@contextmanager
def _limit_resources() -> Iterator[None]:
    """Limit processor time and memory of the enclosed code."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise SlowError(f"more than {LIMIT_SECONDS:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_address_space() + LIMIT_BYTES, hard))
    signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        signal.signal(signal.SIGVTALRM, before)


def _address_space() -> int:
    pages = Path("/proc/self/statm").read_text("ascii").split()[0]
    return int(pages) * resource.getpagesize()
