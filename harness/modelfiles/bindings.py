"""The meaning of each number of a model file: literals as expressions of the constants.

Bindings serve the audit (do all literals agree with the constants?), sweeps, random draws and
mutation (copies of a model with other literals), and corrections in place. A copy differs from the
user's files in the digits of the literals only.
"""

import importlib.util
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from pathlib import Path

import mpmath as mp
import sympy as sp

from physics_crosscheck.harness.documents.elements import Number, replace_numbers
from physics_crosscheck.harness.documents.errors import LocationError, quote
from physics_crosscheck.harness.documents.reading import apply_edits
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.reference.mechanism.declaration import DeclarationError
from physics_crosscheck.reference.mechanism.system import System
from .expressions import parse
from .locations import find, find_in
from .sidecar import Sidecar, SidecarError, read_sidecar

SIDECAR = "sidecar:"
"""The prefix of addresses in the sidecar itself."""

MIN_ROUNDED_DIGITS = 6
"""A literal with this many significant digits or more may be a rounded value.

`%g` writes six digits, and a single-precision number holds them. With fewer, 0.02 would pass for
0.024.
"""


@dataclass(frozen=True, kw_only=True)
class Binding:
    """A literal of a model file, and its meaning.

    Attributes:
        address: of the literal, see `harness.modelfiles.locations`.
        expression: its meaning, in the system's constants.
        place: its bytes.
        expected: the expression's value for the constants' doubles, correctly rounded.
        rounding: the largest difference from `expected` by rounding of the constants and of the
            literal to doubles.
    """

    address: str
    expression: str
    place: Number
    expected: float
    rounding: float

    @property
    def value(self) -> float:
        """The file's value."""
        return self.place.value

    @property
    def error(self) -> float:
        """(value - expected) / |expected|, or the plain difference if 0 is expected."""
        return (self.value - self.expected) / (abs(self.expected) or 1.0)

    @property
    def exact(self) -> bool:
        """True if the literal equals the expression's value, up to rounding of doubles."""
        return abs(self.value - self.expected) <= self.rounding

    @property
    def rounded(self) -> bool:
        """True if it is not exact but correctly rounded to its digits, six or more."""
        _, digits, exponent = Decimal(self.place.text.replace("_", "")).as_tuple()
        assert isinstance(exponent, int)  # a literal is finite
        half = float(Decimal(5).scaleb(exponent - 1))
        near = abs(self.value - self.expected) <= half + self.rounding
        return near and not self.exact and len(digits) >= MIN_ROUNDED_DIGITS

    @property
    def correction(self) -> float:
        """The number to write: the shortest decimal that is exact."""
        for digits in range(1, 17):
            short = float(f"{self.expected:.{digits}g}")
            if abs(short - self.expected) <= self.rounding:
                return short
        return self.expected


def bindings(system: System, sidecar: Sidecar) -> tuple[Binding, ...]:
    """Resolve and evaluate every binding of a sidecar, in its order.

    Raises:
        SidecarError, LocationError: naming file, address and remedy.
    """
    places = locate(sidecar, sidecar.bindings)
    used: dict[tuple[Path, int], str] = {}
    result = []
    for address, expression in sidecar.bindings.items():
        where = sidecar.entry("bindings", address)
        place = places[address]
        other = used.setdefault((place.file, place.start), address)
        if other != address:
            raise SidecarError(
                f"{where} is the same number as {quote(other)} ({place}); keep one of them"
            )
        expected, rounding = _evaluate(system, expression, where)
        result.append(
            Binding(
                address=address,
                expression=expression,
                place=place,
                expected=expected,
                rounding=rounding,
            )
        )
    return tuple(result)


def mismatches(bound: Iterable[Binding]) -> tuple[Binding, ...]:
    """Return the bindings whose literal is neither the expression's value nor a correct
    rounding.
    """
    return tuple(b for b in bound if not b.exact and not b.rounded)


def locate(sidecar: Sidecar, addresses: Iterable[str]) -> dict[str, Number]:
    """Return the literals in the model file or its sidecar at these addresses.

    Raises:
        LocationError: naming file, line and remedy.
    """
    places: dict[str, Number] = {}
    for file, within in _by_file(sidecar, addresses).items():
        located = find(file, within.values())
        places |= {address: located[inner] for address, inner in within.items()}
    return places


def at_constants(system: System, constants: Mapping[str, float]) -> System:
    """Return the system with some constants changed: the reference of a model with the same
    changes.

    Raises:
        DeclarationError: for an unknown constant, or a change between positive and not positive:
            the equations were simplified with the declared sign.
    """
    by_name = {c.name: c for c in system.constants}
    for name, value in constants.items():
        if name not in by_name:
            names = ", ".join(by_name) or "none"
            raise DeclarationError(f"{system.name} has no constant {name!r}; it has {names}")
        if not math.isfinite(value) or (value > 0) != (by_name[name].value > 0):
            sign = "positive" if by_name[name].value > 0 else "not positive"
            raise DeclarationError(
                f"{system.name}: {name} is declared {sign} and can't be varied to "
                f"{value!r}; declare it with the sign of that value"
            )
    values = {name: float(value) for name, value in constants.items()}
    changed = (replace(c, value=values.get(c.name, c.value)) for c in system.constants)
    return replace(system, constants=tuple(changed))


def with_literals(sidecar: Sidecar, literals: Mapping[str, float], into: Path) -> Sidecar:
    """Copy a model file and its sidecar into another folder with literals replaced, by address.

    Any number with an address is accepted, bound or not. All other bytes stay, and so do settings
    that were added to the sidecar since it was read. Links to the other files of the folder
    (meshes, included files) keep relative paths valid.

    Raises:
        LocationError: naming file, line and remedy.
        ValueError: for a value that is not finite, or the model's own folder.
    """
    if into.resolve() == sidecar.model.parent.resolve():
        raise ValueError(
            f"{into}: is the folder of {sidecar.model.name}; choose another folder for the copies"
        )
    return with_texts(sidecar, _replaced(sidecar, literals), into)


def with_texts(sidecar: Sidecar, texts: Mapping[Path, bytes], into: Path) -> Sidecar:
    """Copy a model file and its sidecar into another folder with other texts, by path.

    Included files must be in the model's folder, or below it.
    """
    into.mkdir(parents=True, exist_ok=True)
    _link_neighbours(sidecar, into)
    for file, data in texts.items():
        below = file.relative_to(sidecar.model.parent)
        _unlink_folders(into, below)
        _write_copy(into / below, data)
    sidecar_file = _file(sidecar)
    if texts.get(sidecar_file) == sidecar_file.read_bytes():
        return replace(sidecar, model=into / sidecar.model.name)
    return _as_set(read_sidecar(into / sidecar_file.name), sidecar)


def _as_set(copy: Sidecar, sidecar: Sidecar) -> Sidecar:
    """Return a copy with the engines' settings that have changed since the sidecar was read."""
    if not sidecar.engine_settings:
        return copy
    read = read_sidecar(_file(sidecar)).engine_settings
    settings = {engine: dict(given) for engine, given in copy.engine_settings.items()}
    for engine, given in sidecar.engine_settings.items():
        before = read.get(engine, {})
        changed = {k: v for k, v in given.items() if k not in before or before[k] != v}
        if changed:
            settings[engine] = {**settings.get(engine, {}), **changed}
    return replace(copy, engine_settings=settings)


def rewrite(sidecar: Sidecar, literals: Mapping[str, float]) -> None:
    """Replace literals in the user's own files, by address; only on explicit request.

    Each file is written atomically, after all were checked. To correct mismatches:
    `rewrite(sidecar, {b.address: b.correction for b in mismatches(bound)})`.

    Raises:
        LocationError, ValueError: as `with_literals`.
    """
    for file, data in _replaced(sidecar, literals).items():
        if data != file.read_bytes():
            write_whole(file, data)
            _forget_bytecode(file.resolve())


def _file(sidecar: Sidecar) -> Path:
    return Path(f"{sidecar.model}.toml")


def _by_file(sidecar: Sidecar, addresses: Iterable[str]) -> dict[Path, dict[str, str]]:
    """Return addresses by their file, each with its form in that file."""
    files: dict[Path, dict[str, str]] = {}
    for address in addresses:
        in_sidecar = address.startswith(SIDECAR)
        file = _file(sidecar) if in_sidecar else sidecar.model
        files.setdefault(file, {})[address] = address.removeprefix(SIDECAR)
    return files


def _replaced(sidecar: Sidecar, literals: Mapping[str, float]) -> dict[Path, bytes]:
    """Return both files with literals replaced, after checking the result."""
    texts = {file: file.read_bytes() for file in (sidecar.model, _file(sidecar))}
    for file, within in _by_file(sidecar, literals).items():
        data, wanted = texts[file], {inner: float(literals[a]) for a, inner in within.items()}
        for inner, value in wanted.items():
            if not math.isfinite(value):
                raise ValueError(f"{file}: {inner!r} can't be {value!r}")
        places = find_in(data, file, wanted)
        data = apply_edits(
            data,
            (
                # The shortest decimal that reads back as the same double.
                (place.start, place.end, repr(wanted[inner]).encode())
                for inner, place in places.items()
                if wanted[inner] != place.value
            ),
        )
        for inner, place in find_in(data, file, wanted).items():
            if place.value != wanted[inner]:
                raise LocationError(
                    f"{place}: {quote(inner)} is the same number as one that is set already"
                )
        texts[file] = data
    return texts


def _evaluate(system: System, text: str, where: object) -> tuple[float, float]:
    """Return the value of an expression of the constants, and its largest change by rounding."""
    symbols = {c.name: c.symbol for c in system.constants}
    expression = parse(text, symbols, where)
    values = system.values
    try:
        expected = _number(expression.xreplace(values))
        # The constants are decimals in the source: half a unit in the last place each.
        moved = sum(
            abs(_number(expression.diff(c.symbol).xreplace(values))) * math.ulp(c.value) / 2
            for c in system.constants
        )
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise SidecarError(f"{where}: {quote(text)} is not a finite real number") from None
    # Half a unit for the literal's own rounding, half for that of the expected value.
    return expected, moved + math.ulp(expected)


def _number(expression: sp.Expr) -> float:
    if not isinstance(expression, sp.Rational):
        expression = sp.N(expression, 40)
    number = float(expression)
    if not math.isfinite(number):
        raise ValueError(number)
    return number


def _link_neighbours(sidecar: Sidecar, into: Path) -> None:
    """Link to all files of the folder that a model file may refer to, except its physics and
    sidecar.
    """
    folder = sidecar.model.parent.resolve()
    excluded = {sidecar.model.name, _file(sidecar).name, "system.py", "__pycache__"}
    for name in {*os.listdir(folder)} - excluded - {*os.listdir(into)}:
        if not name.startswith(".") and not into.resolve().is_relative_to(folder / name):
            (into / name).symlink_to(folder / name)


def _unlink_folders(into: Path, below: Path) -> None:
    """Replace linked folders on the path of a copy by real ones, with links to their content.

    Writing through a link would change the user's files.
    """
    for folder in (into / parent for parent in reversed(below.parents[:-1])):
        if folder.is_symlink():
            real = folder.resolve()
            folder.unlink()
            folder.mkdir()
            for entry in real.iterdir():
                (folder / entry.name).symlink_to(entry)


def _write_copy(path: Path, data: bytes) -> None:
    """Write a copy that no other process reads yet; identical content stays untouched."""
    try:
        if path.read_bytes() == data:
            return
    except FileNotFoundError:
        pass
    if path.is_symlink():
        path.unlink()
    path.write_bytes(data)
    _forget_bytecode(path)


def _forget_bytecode(path: Path) -> None:
    """Delete bytecode: Python detects stale bytecode by second and size, which a new literal may
    keep.
    """
    if path.suffix == ".py":
        Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)


DIGITS = 40
"""Digits with which expressions are evaluated before they are rounded to doubles."""


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
        SidecarError: if no literal of the model follows a needed constant, or a following literal
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
            raise SidecarError(
                f"{binding.place}: the file has {binding.place.text}, but its "
                f"binding {binding.expression!r} gives {binding.expected:.9g}; "
                "correct one of them (see `crosscheck audit`), or varied models "
                "would differ from this one"
            )
        followed |= dependencies
        literals.append((binding, expression))
    for name in sorted(set(needed) & varied - followed):
        raise SidecarError(
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
