"""The sidecar's mapping of the system's frames to bodies and sites, and between the worlds.

    [frames]
    world = { axes = ["x", "z", "-y"], origin = [0, 0, 1] }
    drum = "body:drum"
    tip = { is = "body:rod", at = [0, 0, "-l"] }

For the world, `axes` are the engine's x, y and z in the system's world, and `origin` is the
system's origin in the engine's world. For a frame, `at` is its position in the axes of the body or
site, m, and `axes` are that body's x, y and z in the frame's axes; by default these are named as in
the world.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp

from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.reference.mechanism.declaration import WORLD
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from .expressions import parse
from .locations import line_of
from .sidecar import Sidecar, SidecarError

_RIGHT = 1e-12
"""The largest deviation of numeric axes from orthonormal ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameTarget:
    """One of the system's frames in a model file.

    Attributes:
        name: of the frame.
        place: its body or site, as engines name it: `body:rod`.
        offset: position in the place's axes, m.
        axes: row i is the place's axis i in the frame's own axes.
        where: the start of messages about it.
    """

    name: str
    place: str
    offset: Array
    axes: Array
    where: str


@dataclass(frozen=True, kw_only=True, eq=False)
class SidecarFrames:
    """The content of `[frames]`.

    Attributes:
        targets: in the order of the sidecar.
        axes: row i is the engine's axis i in the system's world.
        origin: of the system's world, in the engine's, m.
    """

    targets: tuple[FrameTarget, ...]
    axes: Array
    origin: Array


def sidecar_frames(system: System, sidecar: Sidecar) -> SidecarFrames:
    """Read `[frames]` with the system's constants.

    Raises:
        SidecarError: naming file, line, entry and remedy.
    """
    file = Path(f"{sidecar.model}.toml")
    declared = [frame.name for frame in system.frames]
    reader = _FrameEntryReader(file, {c.name: c.symbol for c in system.constants}, system.values)
    axes, origin = np.eye(3), np.zeros(3)
    if WORLD in sidecar.frames:
        axes, origin = reader.world(sidecar.frames[WORLD], reader.where(WORLD))
    targets = []
    for name, entry in sidecar.frames.items():
        where = reader.where(name)
        if name not in (*declared, WORLD):
            names = ", ".join(declared) or "none"
            raise SidecarError(f"{where} is not a frame of {system.name}; it declares {names}")
        if name != WORLD:
            targets.append(reader.target(name, entry, where, axes))
    return SidecarFrames(targets=tuple(targets), axes=axes, origin=origin)


@dataclass(frozen=True)
class _FrameEntryReader:
    """A reader of the entries of one sidecar."""

    file: Path
    symbols: Mapping[str, sp.Symbol]
    values: Mapping[sp.Symbol, sp.Rational]

    def where(self, name: str) -> str:
        """Return the start of messages about an entry."""
        line = line_of(self.file, f"frames.{json.dumps(name)}")
        return f"{self.file}{'' if line is None else f':{line}'}: [frames] {name}"

    def world(self, entry: object, where: str) -> tuple[Array, Array]:
        """Return axes and origin."""
        if not isinstance(entry, dict) or not entry or not set(entry) <= {"axes", "origin"}:
            raise SidecarError(
                f"{where} must be a table with axes, origin or both, as in {{ axes = "
                '["x", "z", "-y"], origin = [0, 0, 1] }'
            )
        axes = self._axes(entry.get("axes"), where, np.eye(3))
        return axes, self._three(entry.get("origin"), where, "origin")

    def target(self, name: str, entry: object, where: str, world: Array) -> FrameTarget:
        """Return the target of a frame."""
        table = {"is": entry} if isinstance(entry, str) else entry
        if not isinstance(table, dict) or not set(table) <= {"is", "at", "axes"}:
            raise SidecarError(f'{where} must name the frame in the file, as in "body:rod"')
        place = table.get("is")
        if not isinstance(place, str):
            raise SidecarError(f'{where} must name the frame in the file: {{ is = "body:rod" }}')
        return FrameTarget(
            name=name,
            place=place,
            offset=self._three(table.get("at"), where, "at"),
            axes=self._axes(table.get("axes"), where, world),
            where=where,
        )

    def _three(self, value: object, where: str, what: str) -> Array:
        if value is None:
            return np.zeros(3)
        if not isinstance(value, list) or len(value) != 3:
            raise SidecarError(f"{where}: {what} is {quote(value)}; expected three lengths")
        return np.array([self._number(one, f"{where}: {what}") for one in value])

    def _axes(self, value: object, where: str, default: Array) -> Array:
        if value is None:
            return default
        if not isinstance(value, list) or len(value) != 3:
            raise SidecarError(f'{where}: expected three axes, as in ["x", "z", "-y"]')
        axes = np.array([self._axis(one, where) for one in value])
        if np.max(np.abs(axes @ axes.T - np.eye(3))) > _RIGHT or np.linalg.det(axes) < 0:
            raise SidecarError(
                f"{where}: axes {quote(value)} are not three orthogonal, "
                "right-handed axes of length 1; remove the mirror or correct the "
                "axes"
            )
        return axes

    def _axis(self, value: object, where: str) -> Array:
        if isinstance(value, str) and value.lstrip("+-") in ("x", "y", "z") and len(value) <= 2:
            axis = np.zeros(3)
            axis["xyz".index(value[-1])] = -1.0 if value[0] == "-" else 1.0
            return axis
        return self._three(value, where, "an axis")

    def _number(self, value: object, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (str, int, float)):
            raise SidecarError(f"{where} has {quote(value)}; expected a number or an expression")
        try:
            number = float(parse(str(value), self.symbols, where).xreplace(self.values))
        except (TypeError, ValueError, OverflowError, ZeroDivisionError) as error:
            if isinstance(error, SidecarError):
                raise
            raise SidecarError(f"{where}: {quote(value)} is not a finite real number") from None
        if not np.isfinite(number):
            raise SidecarError(f"{where}: {quote(value)} is not a finite real number")
        return number
