"""The constants of a mechanism that is read from a file: names, sources, and their bindings."""

from __future__ import annotations

import keyword
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from physics_crosscheck.harness.modelfiles.locations import Location, LocationError, find_in
from physics_crosscheck.harness.scaffold.folder import NewError

_TAKEN = {
    "t", "pi", "sin", "cos", "ground", "system", "T", "V", "D", "Constant", "Coordinate",
    "Equilibrium", "Input", "Output", "Scenario", "System", "FILE",
}  # fmt: skip

_LONGEST = 60
"""Characters of an identifier: a line of system.py shall hold several."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A constant to declare."""

    name: str
    value: float
    unit: str
    description: str
    source: str


@dataclass
class Ledger:
    """Issues a constant for every number that a model file states, and binds it to its place.

    `number` returns what to write for it in a formula: `-rod_z`, or `0` where it is nothing. One
    number of the file may be several quantities: the damping that a class of joints has is a force
    for a slide and a torque for a hinge. Each unit has a constant then, since no formula could hold
    one number in two units. The place is bound to the first; `shared` has the others.
    """

    file: Path
    data: bytes
    rows: list[Row] = field(default_factory=list)
    bindings: dict[str, str] = field(default_factory=dict)
    names: set[str] = field(default_factory=lambda: set(_TAKEN))
    shared: dict[str, list[str]] = field(default_factory=dict)
    _issued: dict[tuple[str, str], str] = field(default_factory=dict)

    def name(self, *parts: str) -> str:
        """An identifier that nothing else has."""
        plain = re.sub(r"\W+", "_", "_".join(parts), flags=re.ASCII).strip("_")
        plain = plain[:_LONGEST].strip("_") or "x"
        if not plain.isidentifier() or keyword.iskeyword(plain):
            plain = f"x_{plain}"
        found, count = plain, 2
        while found in self.names or f"{found}_dot" in self.names:
            found, count = f"{plain}_{count}", count + 1
        self.names |= {found}
        return found

    def number(
        self,
        value: float,
        name: tuple[str, ...],
        unit: str,
        what: str,
        address: str | None,
        degrees: bool = False,
    ) -> str:
        """A formula for a number in SI units, which stands at `address` if that can be told.

        Raises:
            NewError: for what is no finite number.
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
        own = self.name(*name)
        source = (
            f"{self.file.name}, as compiled"
            if place is None
            else (f"{place.file.name}:{place.line}")
        )
        self.rows.append(
            Row(name=own, value=abs(value), unit=unit, description=what, source=source)
        )
        if address is not None:
            self._issued[address, unit] = own
        self._bind(address, f"{sign}{own}", degrees)
        return f"{sign}{own}"

    def _bind(self, address: str | None, formula: str, degrees: bool) -> None:
        """Say what the number at a place stands for, where it has a place."""
        if address is None:
            return
        within = f"({formula})" if " " in formula else formula
        full = f"{within} * 180 / pi" if degrees else formula
        others = self.shared.setdefault(address, [])
        if self.bindings.setdefault(address, full) != full and full not in others:
            others.append(full)

    def _place(self, address: str, value: float, degrees: bool) -> Location | None:
        """Where the number stands, if what stands there is it."""
        try:
            place = find_in(self.data, self.file, [address])[address]
        except LocationError:
            return None
        written = math.radians(place.value) if degrees else place.value
        return place if math.isclose(written, value, rel_tol=4e-16, abs_tol=0.0) else None


def finite(text: str) -> float:
    """A number as text has it.

    Raises:
        ValueError: for what is none, or not finite.
    """
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


def quarter(angle: float) -> str | None:
    """`pi / 2` and its like, for the double nearest to some quarter turns."""
    turns = round(angle * 2 / math.pi)
    if turns == 0 or abs(angle - turns * math.pi / 2) > 2 * math.ulp(angle):
        return None
    whole, half = divmod(abs(turns), 2)
    over = abs(turns) if half else whole
    text = ("" if over == 1 else f"{over} * ") + ("pi / 2" if half else "pi")
    return f"-{text}" if angle < 0 else text
