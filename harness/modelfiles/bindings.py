"""What each number of a model file stands for: its literals as expressions of the constants.

Bindings serve the audit (does every literal say what the constants say?), sweeps, random draws and
mutation (copies of a model with other literals), and corrections in place. A copy differs from the
user's files in the digits of the literals alone.
"""

from __future__ import annotations

import importlib.util
import math
import os
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import sympy as sp

from physics_crosscheck.harness.modelfiles.edits import spliced
from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.locations import Location, LocationError, find, find_in
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError, read_sidecar
from physics_crosscheck.reference.mechanism.declaration import DeclarationError
from physics_crosscheck.reference.mechanism.system import System

SIDECAR = "sidecar:"
"""What an address begins with that leads into the sidecar itself."""

ENOUGH_DIGITS = 6
"""From so many significant digits on, a literal may be a rounded value: what `%g` writes and a
single-precision number holds. With fewer, 0.02 would pass for 0.024."""


@dataclass(frozen=True, kw_only=True)
class Binding:
    """A literal of a model file, and what it stands for.

    Attributes:
        address: where it is, see `harness.modelfiles.locations`.
        expression: what it stands for, of the system's constants.
        place: its bytes.
        expected: the expression's value for the constants' doubles, correctly rounded.
        rounding: how far the roundings of the constants and of the literal to doubles may bring
            its value from `expected`.
    """

    address: str
    expression: str
    place: Location
    expected: float
    rounding: float

    @property
    def value(self) -> float:
        """What the file says."""
        return self.place.value

    @property
    def error(self) -> float:
        """(value - expected) / |expected|; the mere difference where 0 is expected."""
        return (self.value - self.expected) / (abs(self.expected) or 1.0)

    @property
    def exact(self) -> bool:
        """Whether the literal is the expression's value, to the roundings of doubles."""
        return abs(self.value - self.expected) <= self.rounding

    @property
    def rounded(self) -> bool:
        """Whether it is not exact but correctly rounded, to the six digits or more it has."""
        _, digits, exponent = Decimal(self.place.text.replace("_", "")).as_tuple()
        assert isinstance(exponent, int)  # a literal is finite
        half = float(Decimal(5).scaleb(exponent - 1))
        near = abs(self.value - self.expected) <= half + self.rounding
        return near and not self.exact and len(digits) >= ENOUGH_DIGITS

    @property
    def correction(self) -> float:
        """The number to write: the shortest decimal that is exact."""
        for digits in range(1, 17):
            short = float(f"{self.expected:.{digits}g}")
            if abs(short - self.expected) <= self.rounding:
                return short
        return self.expected


def bindings(system: System, sidecar: Sidecar) -> tuple[Binding, ...]:
    """Resolve and evaluate every binding that a sidecar declares, in its order.

    Raises:
        SidecarError, LocationError: naming file, address and remedy.
    """
    places = locate(sidecar, sidecar.bindings)
    taken: dict[tuple[Path, int], str] = {}
    found = []
    for address, expression in sidecar.bindings.items():
        where = sidecar.entry("bindings", address)
        place = places[address]
        other = taken.setdefault((place.file, place.start), address)
        if other != address:
            raise SidecarError(
                f"{where} is the same number as {brief(other)} ({place}); keep one of them"
            )
        expected, rounding = _evaluate(system, expression, where)
        found.append(
            Binding(
                address=address,
                expression=expression,
                place=place,
                expected=expected,
                rounding=rounding,
            )
        )
    return tuple(found)


def mismatches(found: Iterable[Binding]) -> tuple[Binding, ...]:
    """Those whose literal is not what its expression says, nor that correctly rounded."""
    return tuple(b for b in found if not b.exact and not b.rounded)


def locate(sidecar: Sidecar, addresses: Iterable[str]) -> dict[str, Location]:
    """Where the literals are, in the model file or its sidecar, that addresses mean.

    Raises:
        LocationError: naming file, line and remedy.
    """
    places: dict[str, Location] = {}
    for file, within in _by_file(sidecar, addresses).items():
        found = find(file, within.values())
        places |= {address: found[own] for address, own in within.items()}
    return places


def at_constants(system: System, constants: Mapping[str, float]) -> System:
    """The system with some constants changed, by name: the reference of a model changed alike.

    Raises:
        DeclarationError: for a name that is no constant, or a value that is not positive where the
            declared one is, or the other way round: the equations were simplified with that.
    """
    known = {c.name: c for c in system.constants}
    for name, value in constants.items():
        if name not in known:
            names = ", ".join(known) or "none"
            raise DeclarationError(f"{system.name} has no constant {name!r}; it has {names}")
        if not math.isfinite(value) or (value > 0) != (known[name].value > 0):
            sign = "positive" if known[name].value > 0 else "not positive"
            raise DeclarationError(
                f"{system.name}: {name} is declared {sign} and can't be varied to "
                f"{value!r}; declare it with the sign of that value"
            )
    values = {name: float(value) for name, value in constants.items()}
    changed = (replace(c, value=values.get(c.name, c.value)) for c in system.constants)
    return replace(system, constants=tuple(changed))


def with_constants(
    system: System, sidecar: Sidecar, constants: Mapping[str, float], into: Path
) -> Sidecar:
    """Copy a model into another folder with every bound literal at changed constants.

    The constants not named keep their values. A literal that says what it should is left as it is
    written; one that doesn't is set right. Its reference is that of `at_constants`.

    Raises:
        DeclarationError, SidecarError, LocationError: naming what is wrong and where.
    """
    found = bindings(at_constants(system, constants), sidecar)
    return with_literals(sidecar, {b.address: b.expected for b in found if not b.exact}, into)


def with_literals(sidecar: Sidecar, literals: Mapping[str, float], into: Path) -> Sidecar:
    """Copy a model file and its sidecar into another folder with literals replaced, by address.

    Any number with an address will do, bound or not. All else stays, byte for byte, and so do
    settings that the sidecar was given since it was read. What lies beside the model file (meshes,
    included files) is linked to, so that its relative paths hold.

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
    """Copy a model file and its sidecar into another folder with other texts, by their paths.

    Files that the model includes stand in its folder, or below it.
    """
    into.mkdir(parents=True, exist_ok=True)
    _link_neighbours(sidecar, into)
    for file, data in texts.items():
        below = file.relative_to(sidecar.model.parent)
        _unlink_folders(into, below)
        _write_copy(into / below, data)
    own = _file(sidecar)
    if texts.get(own) == own.read_bytes():
        return replace(sidecar, model=into / sidecar.model.name)
    return _as_set(read_sidecar(into / own.name), sidecar)


def _as_set(copy: Sidecar, sidecar: Sidecar) -> Sidecar:
    """A copy with the engines' settings that were changed since the sidecar was read."""
    read = read_sidecar(_file(sidecar)).engine_settings
    settings = {engine: dict(own) for engine, own in copy.engine_settings.items()}
    for engine, own in sidecar.engine_settings.items():
        before = read.get(engine, {})
        changed = {k: v for k, v in own.items() if k not in before or before[k] != v}
        if changed:
            settings[engine] = {**settings.get(engine, {}), **changed}
    return replace(copy, engine_settings=settings)


def rewrite(sidecar: Sidecar, literals: Mapping[str, float]) -> None:
    """Replace literals in the user's own files, by address; on demand alone.

    Each file is written whole or not at all, after all were found sound. To set right what
    disagrees: `rewrite(sidecar, {b.address: b.correction for b in mismatches(found)})`.

    Raises:
        LocationError, ValueError: as `with_literals`.
    """
    for file, data in _replaced(sidecar, literals).items():
        if data != file.read_bytes():
            # Through a link, the file that it leads to.
            _write_whole(file.resolve(), data)


def _file(sidecar: Sidecar) -> Path:
    return Path(f"{sidecar.model}.toml")


def _by_file(sidecar: Sidecar, addresses: Iterable[str]) -> dict[Path, dict[str, str]]:
    """Addresses by the file they lead into, each with what it is called there."""
    files: dict[Path, dict[str, str]] = {}
    for address in addresses:
        own = address.startswith(SIDECAR)
        file = _file(sidecar) if own else sidecar.model
        files.setdefault(file, {})[address] = address.removeprefix(SIDECAR)
    return files


def _replaced(sidecar: Sidecar, literals: Mapping[str, float]) -> dict[Path, bytes]:
    """Both files with literals replaced, checked to say what they should."""
    texts = {file: file.read_bytes() for file in (sidecar.model, _file(sidecar))}
    for file, within in _by_file(sidecar, literals).items():
        data, wanted = texts[file], {own: float(literals[a]) for a, own in within.items()}
        for own, value in wanted.items():
            if not math.isfinite(value):
                raise ValueError(f"{file}: {own!r} can't be {value!r}")
        places = find_in(data, file, wanted)
        data = spliced(
            data,
            (
                # The shortest decimal that reads back as the same double.
                (place.start, place.end, repr(wanted[own]).encode())
                for own, place in places.items()
                if wanted[own] != place.value
            ),
        )
        for own, place in find_in(data, file, wanted).items():
            if place.value != wanted[own]:
                raise LocationError(
                    f"{place}: {brief(own)} is the same number as one that is set already"
                )
        texts[file] = data
    return texts


def _evaluate(system: System, text: str, where: object) -> tuple[float, float]:
    """The value of an expression of the constants, and how far roundings may move it."""
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
        raise SidecarError(f"{where}: {brief(text)} is not a finite real number") from None
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
    """Links to what a model file may refer to: all beside it but its physics and its sidecar."""
    folder = sidecar.model.parent.resolve()
    own = {sidecar.model.name, _file(sidecar).name, "system.py", "__pycache__"}
    for entry in folder.iterdir():
        link = into / entry.name
        if entry.name in own or entry.name.startswith(".") or os.path.lexists(link):
            continue
        if not into.resolve().is_relative_to(entry):
            link.symlink_to(entry)


def _unlink_folders(into: Path, below: Path) -> None:
    """Make the folders that lead to a copy the copy's own, with links to what is in each.

    What is written through a link would be the user's.
    """
    for folder in (into / parent for parent in reversed(below.parents[:-1])):
        if folder.is_symlink():
            real = folder.resolve()
            folder.unlink()
            folder.mkdir()
            for entry in real.iterdir():
                (folder / entry.name).symlink_to(entry)


def _write_whole(path: Path, data: bytes) -> None:
    """Write a file whole or not at all: a temporary file beside it, then a rename."""
    mode = path.stat().st_mode & 0o7777 if path.is_file() else 0o644
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(temporary, mode)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
    _forget_bytecode(path)


def _write_copy(path: Path, data: bytes) -> None:
    """Write a copy that nobody else knows of; what is there already is left as it is."""
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
    """Bytecode is told stale by second and size; a literal changes within both."""
    if path.suffix == ".py":
        Path(importlib.util.cache_from_source(str(path))).unlink(missing_ok=True)
