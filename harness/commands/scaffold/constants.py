"""Constants of a mechanism that is read from a file: names, sources and bindings."""

from __future__ import annotations

import keyword
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import Location
from physics_crosscheck.harness.modelfiles.locations import find_in

_RESERVED = {
    "t", "pi", "sin", "cos", "ground", "system", "T", "V", "D", "Constant", "Coordinate",
    "Equilibrium", "Input", "Output", "Scenario", "System", "FILE",
}  # fmt: skip

_LONGEST = 60
"""Maximum length of an identifier in characters: a line of system.py must hold several."""


@dataclass(frozen=True, kw_only=True)
class ConstantRow:
    """A constant to declare."""

    name: str
    value: float
    unit: str
    description: str
    source: str


@dataclass
class Ledger:
    """Declares a constant for each number of a model file and binds it to its place.

    `number` returns the text for a formula: `-rod_z`, or `0` for a number without effect. One
    number of the file can be several quantities: the damping of a class of joints is a force for a
    slide and a torque for a hinge. Each unit then has its own constant, since a formula can't use
    one number in two units. The place is bound to the first constant; `shared` lists the others.
    """

    file: Path
    data: bytes
    rows: list[ConstantRow] = field(default_factory=list)
    bindings: dict[str, str] = field(default_factory=dict)
    names: set[str] = field(default_factory=lambda: set(_RESERVED))
    shared: dict[str, list[str]] = field(default_factory=dict)
    _issued: dict[tuple[str, str], str] = field(default_factory=dict)

    def name(self, *parts: str) -> str:
        """Return a unique identifier."""
        plain = re.sub(r"\W+", "_", "_".join(parts), flags=re.ASCII).strip("_")
        plain = plain[:_LONGEST].strip("_") or "x"
        if not plain.isidentifier() or keyword.iskeyword(plain):
            plain = f"x_{plain}"
        unique, count = plain, 2
        while unique in self.names or f"{unique}_dot" in self.names:
            unique, count = f"{plain}_{count}", count + 1
        self.names |= {unique}
        return unique

    def number(
        self,
        value: float,
        name: tuple[str, ...],
        unit: str,
        what: str,
        address: str | None,
        degrees: bool = False,
    ) -> str:
        """Return a formula for a number in SI units, which is stated at `address` if that is known.

        Raises:
            NewError: if the number is not finite.
        """
        if not math.isfinite(value):
            raise NewError(f"{self.file}: {what} is {value}; expected a finite number")
        if value == 0:
            return "0"
        sign = "-" if value < 0 else ""
        place = None if address is None else self._place(address, value, degrees)
        if place is None:
            address = None
        elif address is not None and (address, unit) in self._issued:
            return f"{sign}{self._issued[address, unit]}"
        if unit == "rad" and (turn := quarter(value)) is not None:
            self._bind(address, turn, degrees)
            return turn
        identifier = self.name(*name)
        source = (
            f"{self.file.name}, as compiled"
            if place is None
            else (f"{place.file.name}:{place.line}")
        )
        self.rows.append(
            ConstantRow(
                name=identifier, value=abs(value), unit=unit, description=what, source=source
            )
        )
        if address is not None:
            self._issued[address, unit] = identifier
        self._bind(address, f"{sign}{identifier}", degrees)
        return f"{sign}{identifier}"

    def _bind(self, address: str | None, formula: str, degrees: bool) -> None:
        """Bind the number at a place to a formula, if the place is known."""
        if address is None:
            return
        within = f"({formula})" if " " in formula else formula
        full = f"{within} * 180 / pi" if degrees else formula
        others = self.shared.setdefault(address, [])
        if self.bindings.setdefault(address, full) != full and full not in others:
            others.append(full)

    def _place(self, address: str, value: float, degrees: bool) -> Location | None:
        """Return the location of a number if the file states the same value there."""
        try:
            place = find_in(self.data, self.file, [address])[address]
        except LocationError:
            return None
        written = math.radians(place.value) if degrees else place.value
        return place if math.isclose(written, value, rel_tol=4e-16, abs_tol=0.0) else None


def finite(text: str) -> float:
    """Parse a finite number.

    Raises:
        ValueError: if the text is not a number or the number is not finite.
    """
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


def quarter(angle: float) -> str | None:
    """Return a formula such as `pi / 2` for the double nearest to a multiple of a quarter turn."""
    turns = round(angle * 2 / math.pi)
    if turns == 0 or abs(angle - turns * math.pi / 2) > 2 * math.ulp(angle):
        return None
    whole, half = divmod(abs(turns), 2)
    over = abs(turns) if half else whole
    text = ("" if over == 1 else f"{over} * ") + ("pi / 2" if half else "pi")
    return f"-{text}" if angle < 0 else text
