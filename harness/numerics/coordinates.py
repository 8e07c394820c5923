"""Maps between a system's coordinates q and an engine's z, for positions, velocities and forces.

z = Z(q) and q = R(z) are declared. Velocities use their Jacobians. Generalized forces use the
transpose (virtual work): dR/dz^T Q acts on z as Q acts on q. z - Z(R(z)) is the constraint drift.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp

from physics_crosscheck.harness.engines.protocol import Force, StateForce
from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, compile_function
from physics_crosscheck.reference.mechanism.system import System


@dataclass(frozen=True, kw_only=True)
class CoordinateMap:
    """Compiled maps for one model in one engine; n coordinates q, nz engine coordinates z.

    Attributes:
        forward: Z(q), (..., n) -> (..., nz).
        forward_slope: dZ/dq, flattened, (..., nz * n).
        back: R(z), (..., nz) -> (..., n).
        back_slope: dR/dz, flattened, (..., n * nz).
        push: dR/dz^T times the generalized forces of the inputs, of (z, u), (..., nz).
        push_matrix: the same as a constant nz x inputs matrix; None if it depends on z.
        periodic: which q are angles read back modulo 2 pi (by atan2).
    """

    forward: NumericFunction
    forward_slope: NumericFunction
    back: NumericFunction
    back_slope: NumericFunction
    push: NumericFunction
    push_matrix: Array | None
    periodic: tuple[bool, ...]

    def to_engine(self, states: Array) -> tuple[Array, Array]:
        """Return states (q, v), (B, 2n), as engine positions and velocities, each (B, nz)."""
        n = self.back.size
        q, v = states[:, :n], states[:, n:]
        slope = self.forward_slope(q).reshape(len(q), -1, n)
        return self.forward(q), np.einsum("bzn,bn->bz", slope, v)

    def from_engine(self, z: Array, w: Array, near: Array) -> Array:
        """Return engine positions and velocities (B, nz) as states (B, 2n), close to `near`."""
        q = self.back(z)
        n = q.shape[1]
        for i, periodic in enumerate(self.periodic):
            if periodic:
                q[:, i] += 2 * np.pi * np.round((near[:, i] - q[:, i]) / (2 * np.pi))
        slope = self.back_slope(z).reshape(len(z), n, -1)
        return np.concatenate([q, np.einsum("bnz,bz->bn", slope, w)], axis=1)

    def follow(self, z: Array, w: Array, start: Array) -> Array:
        """Return states (S, 2n) along one run, with angles continuous from `start`, (2n,)."""
        states = self.from_engine(z, w, np.broadcast_to(start, (len(z), len(start))))
        for i, periodic in enumerate(self.periodic):
            if periodic:
                states[:, i] = np.unwrap(states[:, i])
        return states

    @property
    def redundant(self) -> bool:
        """True if there are more engine coordinates than system coordinates.

        Otherwise the map is one to one, and has no residual.
        """
        return self.forward.size > self.back.size

    def residual(self, z: Array, w: Array, states: Array) -> Array:
        """Return the residual of z and w at the states (B, 2n) read from them: (B, 2nz).

        It is zero as long as the engine satisfies the constraints that the equations assume.
        """
        mapped_z, mapped_w = self.to_engine(states)
        return np.concatenate([z - mapped_z, w - mapped_w], axis=1)

    def residual_rounding_scale(self, z: Array, w: Array) -> Array:
        """Return the change of each residual per unit of relative rounding in z and w, (2nz,)."""
        n = self.back.size
        there = np.abs(self.forward_slope(self.back(z))).reshape(len(z), -1, n)
        back = np.abs(self.back_slope(z)).reshape(len(z), n, -1)
        sizes = [np.abs(a) for a in (z, w)]
        moved = [a + np.einsum("bzn,bny,by->bz", there, back, a) for a in sizes]
        return np.concatenate([np.max(a, axis=0) for a in moved])

    def drift(self, z: Array) -> float:
        """Return the largest |z - Z(R(z))|, the drift of the engine's constraints."""
        return float(np.max(np.abs(z - self.forward(self.back(z))), initial=0.0))

    def rounding_scale(self, z: Array, w: Array) -> Array:
        """Return the change of each component per unit of relative rounding in z, (2n,)."""
        n = self.back.size
        slope = np.abs(self.back_slope(z)).reshape(len(z), n, -1)
        moved = [np.max(np.einsum("bnz,bz->bn", slope, np.abs(a)), axis=0) for a in (z, w)]
        return np.concatenate(moved)

    def pushes(self, z: Array, inputs: Array) -> Array:
        """Return inputs (B, inputs) as engine forces at positions z, (B, nz)."""
        if self.push_matrix is None:
            return self.push(z, inputs)
        forces: Array = inputs @ self.push_matrix.T
        return forces

    def force(self, inputs: Array) -> Force:
        """Return inputs (B, n, inputs), constant over each step, as engine forces."""
        if inputs.shape[-1] == 0 or not inputs.any():
            return None
        if self.push_matrix is not None:
            force: Array = inputs @ self.push_matrix.T
            return force
        scalar = self.push.scalar

        def state_force(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
            return scalar(*z, *u)

        return StateForce(inputs, state_force)


def coordinate_map(system: System, sidecar: Sidecar, names: Sequence[str]) -> CoordinateMap:
    """Compile the map between a system and the coordinates `names` of a loaded model.

    Without declarations in the sidecar, every engine coordinate must have the name of a system
    coordinate.

    Raises:
        SidecarError: with the coordinate that is missing, unknown or not read back.
    """
    forward, back, z = _declared(system, sidecar, names)
    values = {symbol: sp.Float(value, 17) for symbol, value in system.values.items()}
    plain = (
        tuple(sp.sympify(e).xreplace(values) for e in each)
        for each in (forward, back, system.forces())
    )
    return _compiled_map(*plain, (tuple(system.q), tuple(system.u), tuple(z)))


@lru_cache(maxsize=64)  # each case of a model has the same map
def _compiled_map(
    forward: tuple[sp.Expr, ...],
    back: tuple[sp.Expr, ...],
    forces: tuple[sp.Expr, ...],
    variables: tuple[tuple[sp.Symbol, ...], ...],
) -> CoordinateMap:
    """Compile a map, without constants, and its slopes; the variables are q, u and z."""
    q, u, z = variables
    back_slope = sp.Matrix(back).jacobian(z)
    engine_forces = back_slope.T * sp.Matrix(forces)
    matrix = _pushes(engine_forces, u, z)
    constants = None if matrix is None else np.array(matrix.tolist(), dtype=float)
    return CoordinateMap(
        forward=compile_function(forward, q),
        forward_slope=compile_function(list(sp.Matrix(forward).jacobian(q)), q),
        back=compile_function(back, z),
        back_slope=compile_function(list(back_slope), z),
        push=compile_function(list(engine_forces), z, u),
        push_matrix=None if constants is None else constants.reshape(len(z), len(u)),
        periodic=_periodic(back),
    )


@dataclass(frozen=True, kw_only=True)
class CoordinateFamily:
    """The maps of one model in one engine for any values of the constants, compiled once.

    Attributes:
        forward, forward_slope, back, back_slope, push: as in `CoordinateMap`, with the constants,
            in the system's order, as last argument group.
        pushes: the push matrix as a function of the constants, in row-major order; None if it
            depends on z.
        periodic: as in `CoordinateMap`.
        constants: names of the constants that a map uses.
    """

    forward: NumericFunction
    forward_slope: NumericFunction
    back: NumericFunction
    back_slope: NumericFunction
    push: NumericFunction
    pushes: NumericFunction | None
    periodic: tuple[bool, ...]
    constants: frozenset[str]

    def with_constants(self, values: Sequence[float]) -> CoordinateMap:
        """Return the map at values of all constants, in the system's order."""
        matrix = None if self.pushes is None else self.pushes(np.asarray(values, dtype=float))
        return CoordinateMap(
            forward=self.forward.bind(values),
            forward_slope=self.forward_slope.bind(values),
            back=self.back.bind(values),
            back_slope=self.back_slope.bind(values),
            push=self.push.bind(values),
            push_matrix=None if matrix is None else matrix.reshape(self.forward.size, -1),
            periodic=self.periodic,
        )


def coordinate_family(system: System, sidecar: Sidecar, names: Sequence[str]) -> CoordinateFamily:
    """Compile the maps between a system and the coordinates `names` of its model.

    Raises:
        SidecarError: as `coordinate_map`, with checks at the declared values.
    """
    forward, back, z = _declared(system, sidecar, names)
    back_slope = sp.Matrix(back).jacobian(z)
    engine_forces = back_slope.T * sp.Matrix([sp.sympify(f) for f in system.forces()])
    matrix = _pushes(engine_forces, system.u, z)
    symbols = [c.symbol for c in system.constants]
    used = set[sp.Basic]().union(*(e.free_symbols for e in (*map(sp.sympify, forward), *back)))
    return CoordinateFamily(
        forward=compile_function(forward, system.q, symbols),
        forward_slope=compile_function(
            list(sp.Matrix(forward).jacobian(system.q)), system.q, symbols
        ),
        back=compile_function(back, z, symbols),
        back_slope=compile_function(list(back_slope), z, symbols),
        push=compile_function(list(engine_forces), z, system.u, symbols),
        pushes=None if matrix is None else compile_function(list(matrix), symbols),
        periodic=_periodic(back),
        constants=frozenset(c.name for c in system.constants if c.symbol in used),
    )


def _declared(
    system: System, sidecar: Sidecar, names: Sequence[str]
) -> tuple[list[sp.Expr], list[sp.Expr], list[sp.Symbol]]:
    """Return the sidecar's forward and back maps, checked at the constants' values, and z."""
    where = f"{sidecar.model}.toml"
    z = [sp.Symbol(f"z{i}_", real=True) for i in range(len(names))]
    forward = _forward(system, sidecar, names, where)
    back = _back(system, sidecar, names, z, where)
    _check_inverse(system, forward, back, z, names, where)
    return forward, back, z


def _periodic(back: Sequence[sp.Expr]) -> tuple[bool, ...]:
    return tuple(bool(expression.has(sp.atan2)) for expression in back)


def _pushes(
    engine_forces: sp.Matrix, u: Sequence[sp.Symbol], z: Sequence[sp.Symbol]
) -> sp.Matrix | None:
    """Return the force of each unit input on each engine coordinate, nz x inputs, if constant."""
    if not u:
        return sp.zeros(len(z), 0)
    matrix = engine_forces.jacobian(u)
    return None if matrix.free_symbols & {*z, *u} else matrix


def _forward(system: System, sidecar: Sidecar, names: Sequence[str], where: str) -> list[sp.Expr]:
    symbols = {c.name: c.q for c in system.coordinates} | {
        c.name: c.symbol for c in system.constants
    }
    for name in sidecar.coordinates:
        if name not in names:
            raise SidecarError(
                f"{where}: [coordinates] {name}: the model has no such coordinate; it has"
                f" {', '.join(names)}"
            )
    forward = []
    positions = {c.name: c.q for c in system.coordinates}
    for name in names:
        place = f"{where}: [coordinates] {name}"
        if name in sidecar.coordinates:
            entry = sidecar.entry("coordinates", name)
            forward.append(parse(sidecar.coordinates[name], symbols, entry))
        elif name in positions:
            forward.append(positions[name])
        else:
            raise SidecarError(
                f"{place}: is not a coordinate of {system.name}; define it as an "
                f"expression of {', '.join(positions)}"
            )
    return forward


def _back(
    system: System, sidecar: Sidecar, names: Sequence[str], z: Sequence[sp.Symbol], where: str
) -> list[sp.Expr]:
    symbols = dict(zip(names, z, strict=True)) | {c.name: c.symbol for c in system.constants}
    names_of_system = {c.name for c in system.coordinates}
    for name in sidecar.readback:
        if name not in names_of_system:
            raise SidecarError(f"{where}: [readback] {name} is not a coordinate of {system.name}")
    back = []
    for coordinate in system.coordinates:
        place = f"{where}: [readback] {coordinate.name}"
        if coordinate.name in sidecar.readback:
            entry = sidecar.entry("readback", coordinate.name)
            back.append(parse(sidecar.readback[coordinate.name], symbols, entry))
        elif coordinate.name in names:
            back.append(symbols[coordinate.name])
        else:
            raise SidecarError(
                f"{place}: no joint has this name; define how to compute it from {', '.join(names)}"
            )
    return back


def _check_inverse(
    system: System,
    forward: list[sp.Expr],
    back: list[sp.Expr],
    z: Sequence[sp.Symbol],
    names: Sequence[str],
    where: str,
) -> None:
    values = {symbol: sp.Float(value, 17) for symbol, value in system.values.items()}
    place = {c.q: sp.Float(0.1 + 0.07 * i) for i, c in enumerate(system.coordinates)}
    values_of_z = {
        symbol: e.xreplace(values).subs(place) for symbol, e in zip(z, forward, strict=True)
    }
    for coordinate, expression in zip(system.coordinates, back, strict=True):
        miss = abs(
            float(expression.xreplace(values).subs(values_of_z)) - float(place[coordinate.q])
        )
        if not miss < 1e-9:
            raise SidecarError(
                f"{where}: [readback] {coordinate.name} is not the inverse of "
                f"[coordinates] ({', '.join(names)}): {float(place[coordinate.q])} "
                f"comes back with an error of {miss:g}"
            )


def linear(matrix: Array, offset: Array, kept: Sequence[int]) -> CoordinateMap:
    """Return the map of z = G q + c, where the coordinates `kept` of z are q itself.

    Generalized forces act on these coordinates.

    Args:
        matrix: G, (nz, n).
        offset: c, (nz,).
        kept: index of each q in z, (n,).
    """
    size, n = matrix.shape
    z = [sp.Symbol(f"z{i}_", real=True) for i in range(size)]
    q = [sp.Symbol(f"q{i}_", real=True) for i in range(n)]
    rows = [[sp.Float(x, 17) for x in row] for row in matrix.tolist()]
    forward = [
        sp.Float(c, 17) + sum(x * at for x, at in zip(row, q, strict=True) if x)
        for row, c in zip(rows, offset.tolist(), strict=True)
    ]
    select = np.zeros((n, size))
    select[range(n), list(kept)] = 1.0
    return CoordinateMap(
        forward=compile_function(forward, q),
        forward_slope=compile_function([x for row in rows for x in row], q),
        back=compile_function([z[i] for i in kept], z),
        back_slope=compile_function([sp.Integer(int(x)) for x in select.ravel()], z),
        push=compile_function([sp.Integer(0)] * size, z, q),
        push_matrix=select.T,
        periodic=(False,) * n,
    )


@lru_cache(maxsize=8)
def identity(size: int) -> CoordinateMap:
    """Return the identity map, to measure a model in its own coordinates."""
    z = [sp.Symbol(f"z{i}_", real=True) for i in range(size)]
    same, unit = compile_function(z, z), compile_function(list(sp.eye(size)), z)
    return CoordinateMap(
        forward=same,
        forward_slope=unit,
        back=same,
        back_slope=unit,
        push=compile_function([sp.Integer(0)] * size, z, []),
        push_matrix=np.zeros((size, 0)),
        periodic=(False,) * size,
    )
