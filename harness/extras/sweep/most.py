"""The few largest items of a stream."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class Numbered(Protocol):
    """A row of a sweep, or a result made from rows."""

    @property
    def index(self) -> int:
        """Number in the plan."""
        ...


Item = TypeVar("Item", bound=Numbered)


class LargestItems(Generic[Item]):
    """The largest items up to a maximum number; of equal ones, those with the lowest numbers."""

    def __init__(self, size: Callable[[Item], float | None], count: int) -> None:
        self._size, self._count = size, count
        self._heap: list[tuple[float, int, Item]] = []

    def add(self, entry: Item) -> None:
        """Add an item, unless it has no size."""
        value = self._size(entry)
        if value is None or math.isnan(value):
            return
        item = value, -entry.index, entry
        if len(self._heap) < self._count:
            heapq.heappush(self._heap, item)
        elif item > self._heap[0]:
            heapq.heapreplace(self._heap, item)

    def items(self) -> list[Item]:
        """Return the items, largest first."""
        return [one for *_, one in sorted(self._heap, reverse=True)]
