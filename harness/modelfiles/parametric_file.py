"""A model file at other constants, again and again: its literals found and read once.

What `modelfiles.bindings.with_constants` does for one copy, prepared for thousands: where each
bound literal stands, and what it stands for as a function of the constants. A copy differs from the
user's files in the digits of those literals alone that a varied constant has a say in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mpmath as mp
import sympy as sp

from physics_crosscheck.harness.modelfiles.bindings import Binding, bindings, with_texts
from physics_crosscheck.harness.modelfiles.edits import reworded
from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.reference.mechanism.system import System

DIGITS = 40
"""With which expressions are evaluated, before they are rounded to doubles."""


class UnboundError(SidecarError):
    """A model file that can't follow a varied constant; the message names file and remedy."""


@dataclass(frozen=True, kw_only=True)
class Redrawn:
    """A model file whose literals follow some constants.

    Attributes:
        sidecar: of the user's model.
        names: of all constants, in the system's order.
        literals: those that follow, each with its value as a function of all constants, in source.
        texts: both files as they are.
    """

    sidecar: Sidecar
    names: tuple[str, ...]
    literals: tuple[tuple[Binding, sp.Expr], ...]
    symbols: tuple[sp.Symbol, ...]
    texts: Mapping[Path, bytes]

    @cached_property
    def _values(self) -> Callable[..., list[mp.mpf]]:
        expressions = [expression for _, expression in self.literals]
        found: Callable[..., list[mp.mpf]] = sp.lambdify(
            list(self.symbols), expressions, modules="mpmath"
        )
        return found

    def at(self, constants: Mapping[str, float], into: Path) -> Sidecar:
        """Write the model at values of all constants into an empty folder; returns its sidecar.

        Raises:
            SidecarError: where a literal would be no finite number.
        """
        if not self.literals:
            return self.sidecar
        with mp.workdps(DIGITS):
            values = self._values(*(mp.mpf(constants[name]) for name in self.names))
        words = [
            (binding.place, repr(self._number(binding, value)))
            for (binding, _), value in zip(self.literals, values, strict=True)
        ]
        return with_texts(self.sidecar, reworded(self.texts, words), into)

    def _number(self, binding: Binding, value: object) -> float:
        try:
            number = float(value)  # type: ignore[arg-type]  # mpmath's numbers have no types
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            where = self.sidecar.entry("bindings", binding.address)
            raise SidecarError(f"{where}: {binding.expression} is not a finite real number there")
        return number


def redrawn(
    system: System, sidecar: Sidecar, varied: Iterable[str], needed: Iterable[str]
) -> Redrawn:
    """Prepare a model file to follow some constants.

    Args:
        system: that declares them.
        sidecar: of the model.
        varied: names of the constants.
        needed: of those, the ones that the equations or the coordinates depend on.

    Raises:
        UnboundError: where no literal of the model follows a constant that is needed, or one that
            does is not now what its binding says.
        SidecarError, LocationError: as `harness.modelfiles.bindings.bindings`.
    """
    varied = frozenset(varied)
    symbols = {c.name: c.symbol for c in system.constants}
    literals = []
    followed: set[str] = set()
    for binding in bindings(system, sidecar):
        where = sidecar.entry("bindings", binding.address)
        expression = parse(binding.expression, symbols, where)
        own = {name for name in varied if symbols[name] in expression.free_symbols}
        if not own:
            continue
        if not (binding.exact or binding.rounded):
            raise UnboundError(
                f"{binding.place}: the file has {binding.place.text}, but its "
                f"binding {binding.expression!r} gives {binding.expected:.9g}; "
                "correct one of them (see `crosscheck audit`), or varied models "
                "would differ from this one"
            )
        followed |= own
        literals.append((binding, expression))
    for name in sorted(set(needed) & varied - followed):
        raise UnboundError(
            f"{sidecar.model}.toml: no number of {sidecar.model.name} is bound to "
            f"{name}, which varies and affects the equations; bind its numbers "
            "under [bindings], or leave the model out"
        )
    files = (sidecar.model, Path(f"{sidecar.model}.toml"))
    return Redrawn(
        sidecar=sidecar,
        names=tuple(symbols),
        literals=tuple(literals),
        symbols=tuple(symbols.values()),
        texts={file: file.read_bytes() for file in files},
    )
