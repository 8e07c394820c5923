"""What a sidecar says of the system's frames: which body or site each is, and how worlds differ.

    [frames]
    world = { axes = ["x", "z", "-y"], origin = [0, 0, 1] }
    drum = "body:drum"
    tip = { is = "body:rod", at = [0, 0, "-l"] }

`axes` tells what the engine's x, y and z are in the system's world, `origin` where the system's
origin lies in the engine's. Of a frame, `at` is where it is in the axes of the body or site, m, and
`axes` what that one's x, y and z are in the frame's own; where nothing is said, they are named as
the world's are.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp

from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.pose import WORLD
from physics_crosscheck.reference.mechanism.system import System

_RIGHT = 1e-12
"""How far from orthonormal axes may be that are told by numbers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameTarget:
    """What one of the system's frames is in a model file.

    Attributes:
        name: of the frame.
        place: of the file, as engines call it: `body:rod`.
        at: in the place's axes, m.
        axes: row i is the place's axis i in the frame's own axes.
        where: what a message about it begins with.
    """

    name: str
    place: str
    at: Array
    axes: Array
    where: str


@dataclass(frozen=True, kw_only=True, eq=False)
class SidecarFrames:
    """All that `[frames]` says.

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
    reader = _Reader(file, {c.name: c.symbol for c in system.constants}, system.values)
    axes, origin = np.eye(3), np.zeros(3)
    if WORLD in sidecar.frames:
        axes, origin = reader.world(sidecar.frames[WORLD], reader.where(WORLD))
    targets = []
    for name, said in sidecar.frames.items():
        where = reader.where(name)
        if name not in (*declared, WORLD):
            known = ", ".join(declared) or "none"
            raise SidecarError(f"{where} is not a frame of {system.name}; it declares {known}")
        if name != WORLD:
            targets.append(reader.target(name, said, where, axes))
    return SidecarFrames(targets=tuple(targets), axes=axes, origin=origin)


@dataclass(frozen=True)
class _Reader:
    """Entries of one sidecar."""

    file: Path
    symbols: Mapping[str, sp.Symbol]
    values: Mapping[sp.Symbol, sp.Rational]

    def where(self, name: str) -> str:
        """What a message about an entry begins with."""
        line = line_of(self.file, f"frames.{json.dumps(name)}")
        return f"{self.file}{'' if line is None else f':{line}'}: [frames] {name}"

    def world(self, said: object, where: str) -> tuple[Array, Array]:
        """Axes and origin."""
        if not isinstance(said, dict) or not said or not set(said) <= {"axes", "origin"}:
            raise SidecarError(
                f"{where} must be a table with axes, origin or both, as in {{ axes = "
                '["x", "z", "-y"], origin = [0, 0, 1] }'
            )
        axes = self._axes(said.get("axes"), where, np.eye(3))
        return axes, self._three(said.get("origin"), where, "origin")

    def target(self, name: str, said: object, where: str, world: Array) -> FrameTarget:
        """What a frame is."""
        table = {"is": said} if isinstance(said, str) else said
        if not isinstance(table, dict) or not set(table) <= {"is", "at", "axes"}:
            raise SidecarError(f'{where} must name the frame in the file, as in "body:rod"')
        place = table.get("is")
        if not isinstance(place, str):
            raise SidecarError(f'{where} must name the frame in the file: {{ is = "body:rod" }}')
        return FrameTarget(
            name=name,
            place=place,
            at=self._three(table.get("at"), where, "at"),
            axes=self._axes(table.get("axes"), where, world),
            where=where,
        )

    def _three(self, said: object, where: str, what: str) -> Array:
        if said is None:
            return np.zeros(3)
        if not isinstance(said, list) or len(said) != 3:
            raise SidecarError(f"{where}: {what} is {brief(said)}; expected three lengths")
        return np.array([self._number(one, f"{where}: {what}") for one in said])

    def _axes(self, said: object, where: str, unsaid: Array) -> Array:
        if said is None:
            return unsaid
        if not isinstance(said, list) or len(said) != 3:
            raise SidecarError(f'{where}: expected three axes, as in ["x", "z", "-y"]')
        found = np.array([self._axis(one, where) for one in said])
        if np.max(np.abs(found @ found.T - np.eye(3))) > _RIGHT or np.linalg.det(found) < 0:
            raise SidecarError(
                f"{where}: axes {brief(said)} are not three orthogonal, "
                "right-handed axes of length 1; remove the mirror or correct the "
                "axes"
            )
        return found

    def _axis(self, said: object, where: str) -> Array:
        if isinstance(said, str) and said.lstrip("+-") in ("x", "y", "z") and len(said) <= 2:
            axis = np.zeros(3)
            axis["xyz".index(said[-1])] = -1.0 if said[0] == "-" else 1.0
            return axis
        return self._three(said, where, "an axis")

    def _number(self, said: object, where: str) -> float:
        if isinstance(said, bool) or not isinstance(said, (str, int, float)):
            raise SidecarError(f"{where} has {brief(said)}; expected a number or an expression")
        try:
            number = float(parse(str(said), self.symbols, where).xreplace(self.values))
        except (TypeError, ValueError, OverflowError, ZeroDivisionError) as error:
            if isinstance(error, SidecarError):
                raise
            raise SidecarError(f"{where}: {brief(said)} is not a finite real number") from None
        if not np.isfinite(number):
            raise SidecarError(f"{where}: {brief(said)} is not a finite real number")
        return number
