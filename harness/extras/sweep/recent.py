"""A small cache: consecutive cases share most results."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")

KEPT = 4
"""Size of a worker's cache."""


class Recent(Generic[Value]):
    """The last few results, by their inputs."""

    def __init__(self) -> None:
        self._made: OrderedDict[Hashable, Value] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return a cached result, or make it."""
        if key not in self._made:
            self._made[key] = make()
            while len(self._made) > KEPT:
                self._made.popitem(last=False)
        return self._made[key]
