"""A small cache: consecutive cases share most results."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")

KEPT = 4
"""Size of a worker's cache."""


class RecentValues(Generic[Value]):
    """The last few results, by their inputs."""

    def __init__(self) -> None:
        self._values: OrderedDict[Hashable, Value] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return a cached result, or make it."""
        if key not in self._values:
            self._values[key] = make()
            while len(self._values) > KEPT:
                self._values.popitem(last=False)
        return self._values[key]
