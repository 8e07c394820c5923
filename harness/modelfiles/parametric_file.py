"""A model file at many values of its constants: its literals are located and parsed once.

It is prepared for thousands of copies: it keeps the place of each bound literal, and its value as
a function of the constants. A copy differs from the user's files only in the digits of literals
that depend on a varied constant. Its reference is that of `modelfiles.bindings.at_constants`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mpmath as mp
import sympy as sp

from physics_crosscheck.harness.documents.number import replace_numbers
from physics_crosscheck.reference.mechanism.system import System
from .bindings import Binding, bindings, with_texts
from .expressions import parse
from .sidecar import Sidecar, SidecarError

DIGITS = 40
"""Digits with which expressions are evaluated before they are rounded to doubles."""


class UnboundError(SidecarError):
    """A model file that can't follow a varied constant; the message names file and remedy."""


@dataclass(frozen=True, kw_only=True)
class ParametricModelFile:
    """A model file whose literals follow some constants.

    Attributes:
        sidecar: of the user's model.
        names: of all constants, in the system's order.
        literals: the literals that follow, each with its value as an expression of all constants.
        texts: both files, unchanged.
    """

    sidecar: Sidecar
    names: tuple[str, ...]
    literals: tuple[tuple[Binding, sp.Expr], ...]
    symbols: tuple[sp.Symbol, ...]
    texts: Mapping[Path, bytes]

    @cached_property
    def _values(self) -> Callable[..., list[mp.mpf]]:
        expressions = [expression for _, expression in self.literals]
        function: Callable[..., list[mp.mpf]] = sp.lambdify(
            list(self.symbols), expressions, modules="mpmath"
        )
        return function

    def write(self, constants: Mapping[str, float], into: Path) -> Sidecar:
        """Write the model at values of all constants into an empty folder, and return its sidecar.

        Raises:
            SidecarError: if a literal would not be a finite number.
        """
        if not self.literals:
            return self.sidecar
        with mp.workdps(DIGITS):
            values = self._values(*(mp.mpf(constants[name]) for name in self.names))
        words = [
            (binding.place, repr(self._number(binding, value)))
            for (binding, _), value in zip(self.literals, values, strict=True)
        ]
        return with_texts(self.sidecar, replace_numbers(self.texts, words), into)

    def _number(self, binding: Binding, value: object) -> float:
        try:
            number = float(value)  # type: ignore[arg-type]  # mpmath's numbers have no types
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            where = self.sidecar.entry("bindings", binding.address)
            raise SidecarError(f"{where}: {binding.expression} is not a finite real number there")
        return number


def parametric_model_file(
    system: System, sidecar: Sidecar, varied: Iterable[str], needed: Iterable[str]
) -> ParametricModelFile:
    """Prepare a model file to follow some constants.

    Args:
        system: that declares them.
        sidecar: of the model.
        varied: names of the constants.
        needed: those that the equations or the coordinates depend on.

    Raises:
        UnboundError: if no literal of the model follows a needed constant, or a following literal
            now contradicts its binding.
        SidecarError, LocationError: as `harness.modelfiles.bindings.bindings`.
    """
    varied = frozenset(varied)
    symbols = {c.name: c.symbol for c in system.constants}
    literals = []
    followed: set[str] = set()
    for binding in bindings(system, sidecar):
        where = sidecar.entry("bindings", binding.address)
        expression = parse(binding.expression, symbols, where)
        dependencies = {name for name in varied if symbols[name] in expression.free_symbols}
        if not dependencies:
            continue
        if not (binding.exact or binding.rounded):
            raise UnboundError(
                f"{binding.place}: the file has {binding.place.text}, but its "
                f"binding {binding.expression!r} gives {binding.expected:.9g}; "
                "correct one of them (see `crosscheck audit`), or varied models "
                "would differ from this one"
            )
        followed |= dependencies
        literals.append((binding, expression))
    for name in sorted(set(needed) & varied - followed):
        raise UnboundError(
            f"{sidecar.model}.toml: no number of {sidecar.model.name} is bound to "
            f"{name}, which varies and affects the equations; bind its numbers "
            "under [bindings], or leave the model out"
        )
    files = (sidecar.model, Path(f"{sidecar.model}.toml"))
    return ParametricModelFile(
        sidecar=sidecar,
        names=tuple(symbols),
        literals=tuple(literals),
        symbols=tuple(symbols.values()),
        texts={file: file.read_bytes() for file in files},
    )
