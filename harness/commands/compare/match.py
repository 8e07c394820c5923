"""Pairs of joints of two files, and the map between their coordinates, states and forces."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
import sympy as sp

from physics_crosscheck.harness.documents.reading import (
    MAX_SIDECAR_BYTES,
    TomlError,
    read_regular,
    toml_document,
)
from physics_crosscheck.harness.modelfiles.expressions import parse
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, compile_function
from .alignment import PlacedTree
from .candidate import CompareError

MAX_AXIS_DISTANCE = 0.05
"""Maximum distance of paired axes: in radians, and in units of the mechanism's size."""

SAME_AXIS = 1e-6
"""Distance below which axes coincide."""

GEOMETRY_RATIO = 0.1
"""Ratio of distances of axes below which pairs by geometry are preferred to pairs by order."""

IMPOSSIBLE_COST = 1e6
"""Cost of an impossible pair."""

TIE_WEIGHT = 1e-3
"""Weight of body positions and depth, which distinguish joints on one line."""


K = TypeVar("K", str, int)
"""Name of a coordinate, or index of an actuator."""


@dataclass(frozen=True, kw_only=True)
class Pairs(Generic[K]):
    """Pairs of corresponding joints or actuators.

    Attributes:
        pairs: those of A -> those of B.
        notes: a phrase for each pair whose names differ.
        unpaired: those without a partner, of A and of B.
    """

    pairs: Mapping[K, K]
    notes: tuple[str, ...]
    unpaired: tuple[tuple[K, ...], tuple[K, ...]]


def pair_joints(
    a: Sequence[str],
    b: Sequence[str],
    spoken_for: tuple[set[str], set[str]],
    placed: tuple[PlacedTree, PlacedTree] | None,
) -> Pairs[str]:
    """Pair coordinates.

    Args:
        a, b: names of the coordinates.
        spoken_for: coordinates that the user or a sidecar maps.
        placed: both files' joints as they are drawn; None if a file has no tree.
    """
    pairs = {name: name for name in a if name in b and name not in spoken_for[0] | spoken_for[1]}
    unpaired_a = [name for name in a if name not in pairs and name not in spoken_for[0]]
    unpaired_b = [name for name in b if name not in pairs.values() and name not in spoken_for[1]]
    phrases: list[str] = []
    if placed is not None and unpaired_a and unpaired_b:
        placed_a, placed_b = placed
        ways = _whole(placed_a, unpaired_a), _whole(placed_b, unpaired_b)
        joint_pairs, how = _unnamed(*ways, joints_of(pairs, placed_a, placed_b), placed)
        phrases = [
            f"joint {here} of A is {there} of B: by {how}" for here, there in joint_pairs.items()
        ]
        for here, there in joint_pairs.items():
            pairs |= zip(placed_a.coordinates(here), placed_b.coordinates(there), strict=True)
    unpaired = (
        tuple(name for name in unpaired_a if name not in pairs),
        tuple(name for name in unpaired_b if name not in pairs.values()),
    )
    return Pairs(pairs=pairs, notes=tuple(phrases), unpaired=unpaired)


def _whole(placed: PlacedTree, names: Sequence[str]) -> list[str]:
    return [joint for joint in placed.index if set(placed.coordinates(joint)) <= set(names)]


def joints_of(
    pairs: Mapping[str, str], placed_a: PlacedTree, placed_b: PlacedTree
) -> dict[str, str]:
    """Return joint pairs whose coordinates are paired in order."""
    owners = {name: joint for joint in placed_b.index for name in placed_b.coordinates(joint)}
    joints: dict[str, str] = {}
    for joint in placed_a.index:
        names_a = placed_a.coordinates(joint)
        its = owners.get(pairs.get(names_a[0], ""))
        if its is not None and tuple(pairs.get(name) for name in names_a) == placed_b.coordinates(
            its
        ):
            joints[joint] = its
    return joints


def _unnamed(
    joints_a: Sequence[str],
    joints_b: Sequence[str],
    pairs: Mapping[str, str],
    placed: tuple[PlacedTree, PlacedTree],
) -> tuple[dict[str, str], str]:
    """Return pairs of joints whose names do not correspond, and the criterion.

    Pair them by order, unless geometry pairs more of them, or as many much closer.
    """
    placed_a, placed_b = placed
    in_order = _in_order(joints_a, joints_b, pairs, placed_a, placed_b)
    near = _nearest(joints_a, joints_b, placed_a, placed_b)
    if len(near) != len(in_order):
        return (near, "geometry") if len(near) > len(in_order) else (in_order, "order")
    apart = [_apart(found, placed_a, placed_b) for found in (in_order, near)]
    if apart[0] > SAME_AXIS and apart[1] < GEOMETRY_RATIO * apart[0]:
        return near, "geometry"
    return in_order, "order"


def _in_order(
    joints_a: Sequence[str],
    joints_b: Sequence[str],
    pairs: Mapping[str, str],
    placed_a: PlacedTree,
    placed_b: PlacedTree,
) -> dict[str, str]:
    """Pair joints of one kind whose parents are paired, in order."""
    paired, free = dict(pairs), [name for name in joints_b if name in placed_b.index]
    new: dict[str, str] = {}
    for name in sorted(
        (x for x in joints_a if x in placed_a.index), key=lambda x: placed_a.index[x]
    ):
        parent = placed_a.parent(name)
        if parent and parent not in paired:
            continue
        carrier, kind = paired[parent] if parent else "", placed_a.kind(name)
        like = (x for x in free if placed_b.kind(x) == kind and placed_b.parent(x) == carrier)
        partner = min(like, key=lambda x: placed_b.index[x], default=None)
        if partner is not None:
            free.remove(partner)
            paired[name] = new[name] = partner
    return new


def _apart(pairs: Mapping[str, str], placed_a: PlacedTree, placed_b: PlacedTree) -> float:
    """Return the summed distance of partners' axes and bodies.

    Bodies are needed since legs on both sides turn about one line.
    """
    size = max(placed_a.size, placed_b.size)
    lines = sum(_distance(placed_a, name, placed_b, its, size) for name, its in pairs.items())
    bodies = (
        placed_a.centers[placed_a.index[name]] - placed_b.centers[placed_b.index[its]]
        for name, its in pairs.items()
    )
    return lines + sum(float(np.linalg.norm(apart)) / size for apart in bodies)


def _nearest(
    joints_a: Sequence[str], joints_b: Sequence[str], placed_a: PlacedTree, placed_b: PlacedTree
) -> dict[str, str]:
    """Pair joints whose axes are close to each other in the world."""
    from scipy.optimize import linear_sum_assignment  # slow import: half a second per worker

    joints_a = [name for name in joints_a if name in placed_a.index]
    joints_b = [name for name in joints_b if name in placed_b.index]
    size = max(placed_a.size, placed_b.size)
    lines = np.array(
        [[_distance(placed_a, x, placed_b, y, size) for y in joints_b] for x in joints_a]
    )
    if not lines.size:
        return {}
    faint = np.array(
        [[_faintly(placed_a, x, placed_b, y, size) for y in joints_b] for x in joints_a]
    )
    rows, columns = linear_sum_assignment(np.minimum(lines, IMPOSSIBLE_COST) + TIE_WEIGHT * faint)
    near = [(i, j) for i, j in zip(rows, columns, strict=True) if lines[i, j] < MAX_AXIS_DISTANCE]
    return {joints_a[i]: joints_b[j] for i, j in near}


def _distance(placed_a: PlacedTree, x: str, placed_b: PlacedTree, y: str, size: float) -> float:
    """Return the distance of two axes: the angle in rad, plus the distance of hinges in sizes."""
    if placed_a.kind(x) != placed_b.kind(y):
        return IMPOSSIBLE_COST
    i, j = placed_a.index[x], placed_b.index[y]
    u, v = placed_a.axes[i], placed_b.axes[j]
    angle = float(np.linalg.norm(np.cross(u, v)))
    if placed_a.kind(x) != "hinge":
        return angle
    between = placed_b.anchors[j] - placed_a.anchors[i]
    return angle + float(np.linalg.norm(between - u * (u @ between))) / size


def _faintly(placed_a: PlacedTree, x: str, placed_b: PlacedTree, y: str, size: float) -> float:
    i, j = placed_a.index[x], placed_b.index[y]
    apart = float(np.linalg.norm(placed_a.centers[i] - placed_b.centers[j])) / size
    return apart + abs(i - j) / max(len(placed_a.index), len(placed_b.index))


@dataclass(frozen=True, kw_only=True)
class Match:
    """Map from the coordinates z of the source, (nz,), to the m coordinates c of the target.

    The source provides the states. It may have coordinates that the target lacks.

    Attributes:
        source: "A" or "B"; the target is the other.
        names: the target's coordinates, as the comparison calls them.
        pairing: a phrase for each pair that differs in name or by a formula.
        left_out: coordinates of the source that no coordinate of the target depends on.
        constant: whether dc/dz is constant.
        value: c(z).
        slope: dc/dz, flattened, (..., m * nz).
        push: dc/dz^T times forces on c, as a function of (z, forces), (..., nz).
        rates: derivatives of (c, dc/dt) with respect to (z, w), flattened, (..., 2m * 2nz).
        periodic: which c are angles known modulo 2 pi.
    """

    source: str
    names: tuple[str, ...]
    pairing: tuple[str, ...]
    left_out: tuple[str, ...]
    constant: bool
    value: NumericFunction
    slope: NumericFunction
    push: NumericFunction
    rates: NumericFunction
    periodic: tuple[bool, ...]

    def slopes(self, z: Array) -> Array:
        """Return dc/dz, (B, m, nz)."""
        return self.slope(z).reshape(len(z), len(self.names), -1)

    def convert(self, states: Array) -> Array:
        """Convert states (B, 2nz) of the source to the target's, (B, 2m)."""
        z, w = halves(states)
        return np.hstack([self.value(z), np.einsum("bmz,bz->bm", self.slopes(z), w)])

    def errors(self, states: Array, uncertainty: Array) -> Array:
        """Convert uncertainties (B, 2nz) of states to those of the target's, (B, 2m)."""
        z, w = halves(states)
        slopes = np.abs(self.rates(z, w)).reshape(len(z), 2 * len(self.names), -1)
        with np.errstate(invalid="ignore"):
            errors = np.einsum("bij,bj->bi", slopes, uncertainty)
        return np.where(np.isnan(errors), np.inf, errors)


def halves(states: Array) -> tuple[Array, Array]:
    """Return positions and velocities of states."""
    n = states.shape[1] // 2
    return states[:, :n], states[:, n:]


def declared(joints: str, file: Path | None) -> tuple[dict[str, str], dict[str, str]]:
    """Return the user's joint map: (a -> expression of b's, b -> expression of a's).

    `joints` is the text of --joints, `a1=b1,a2=-b2`; the file's table [joints] gives coordinates
    of B as expressions of those of A.

    Raises:
        CompareError: for unreadable text, with the place.
    """
    forward: dict[str, str] = {}
    for part in filter(None, (p.strip() for p in joints.split(","))):
        name, equals, expression = (p.strip() for p in part.partition("="))
        if not equals or not name or not expression:
            raise CompareError(f"--joints: {part!r} is not a pair such as hip=joint1 or hip=-j1")
        forward[name] = expression
    if file is None:
        return forward, {}
    try:
        data = toml_document(read_regular(file, MAX_SIDECAR_BYTES).decode("utf-8"))
    except OSError as error:
        raise CompareError(f"{file}: can't be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise CompareError(f"{file}: can't be read: {error}") from None
    except TomlError as error:
        raise CompareError(f"{file}: can't be read{error}") from None
    table = data.get("joints")
    if set(data) != {"joints"} or not isinstance(table, dict):
        raise CompareError(f"{file}: it needs one table, [joints], such as phi = 'x / 0.18'")
    return forward, {name: str(value) for name, value in table.items()}


def match(
    a: Sequence[str],
    b: Sequence[str],
    given: tuple[Mapping[str, str], Mapping[str, str]],
    readback: tuple[Mapping[str, str], Mapping[str, str]],
    joint_pairs: Pairs[str] | None = None,
) -> Match:
    """Match coordinates by the user's map, the readback of a sidecar, or partners.

    A is the source, unless only B has all coordinates that A's follow from.

    Args:
        given: what `declared` returns.
        readback: [readback] of both sidecars.
        joint_pairs: of the remaining coordinates; None: by name.

    Raises:
        CompareError: for coordinates without a match, with the remedy.
    """
    if joint_pairs is None:
        joint_pairs = pair_joints(a, b, spoken_for(a, b, given, readback), None)
    ways = []
    of_a = {its: name for name, its in joint_pairs.pairs.items()}
    for source, names, others, own_readback, partner in (
        ("A", a, b, readback[0], of_a),
        ("B", b, a, readback[1], joint_pairs.pairs),
    ):
        z = {name: sp.Symbol(f"z{i}_", real=True) for i, name in enumerate(names)}
        expressions = _given(source, names, others, given, z) if any(given) else {}
        for name in others:
            if name in expressions:
                continue
            if name in own_readback and name not in z:
                try:
                    expressions[name] = parse(own_readback[name], z, f"[readback] {name}")
                except SidecarError:
                    continue  # it needs the constants of a system
            elif name in partner:
                expressions[name] = z[partner[name]]
        missing = [name for name in others if name not in expressions]
        if not missing:
            plain = {name for name in partner if expressions[name] == z[partner[name]]}
            return _compiled(source, names, others, expressions, z, joint_pairs.notes, plain)
        ways.append(missing)
    raise CompareError(_unmatched(a, b, ways[0], ways[1]))


def _given(
    source: str,
    names: Sequence[str],
    others: Sequence[str],
    given: tuple[Mapping[str, str], Mapping[str, str]],
    z: Mapping[str, sp.Symbol],
) -> dict[str, sp.Expr]:
    expressions: dict[str, sp.Expr] = {}
    forward, backward = given
    label = ("A", "B") if source == "A" else ("B", "A")
    # Use expressions of the source's coordinates directly; invert the others.
    direct, turned = (backward, forward) if source == "A" else (forward, backward)
    for name, text in direct.items():
        _check_name(name, others, label[1])
        expressions[name] = _read(text, z, label[0])
    c = {name: sp.Symbol(f"c{i}_", real=True) for i, name in enumerate(others)}
    for name, text in turned.items():
        _check_name(name, names, label[0])
        expression = _read(text, c, label[1])
        free = list(expression.free_symbols)
        slope = expression.diff(free[0]) if len(free) == 1 else sp.Integer(0)
        if len(free) != 1 or slope.free_symbols or slope == 0:
            continue  # not invertible; the other model may be the source
        other = next(n for n, symbol in c.items() if symbol == free[0])
        expressions[other] = (z[name] - expression.subs(free[0], 0)) / slope
    return expressions


def spoken_for(
    a: Sequence[str],
    b: Sequence[str],
    given: tuple[Mapping[str, str], Mapping[str, str]],
    readback: tuple[Mapping[str, str], Mapping[str, str]],
) -> tuple[set[str], set[str]]:
    """Return coordinates of A and of B that the user maps or a sidecar reads back.

    Raises:
        CompareError: for unreadable text, with the place.
    """
    forward, backward = given
    of_a = set(forward) | _used(backward, a, "A") | (set(readback[1]) & set(a)) - set(b)
    of_b = set(backward) | _used(forward, b, "B") | (set(readback[0]) & set(b)) - set(a)
    return of_a, of_b


def _used(texts: Mapping[str, str], names: Sequence[str], label: str) -> set[str]:
    z = {name: sp.Symbol(f"z{i}_", real=True) for i, name in enumerate(names)}
    used = set[sp.Basic]().union(*(_read(text, z, label).free_symbols for text in texts.values()))
    return {name for name, symbol in z.items() if symbol in used}


def _check_name(name: str, names: Sequence[str], label: str) -> None:
    if name not in names:
        raise CompareError(f"the map names {name!r}; the joints of {label} are {', '.join(names)}")


def _read(text: str, symbols: Mapping[str, sp.Symbol], label: str) -> sp.Expr:
    try:
        return parse(text, symbols, "the map")
    except SidecarError as error:
        names = ", ".join(symbols)
        raise CompareError(f"{error}; the joints of {label} are {names}") from None


def _unmatched(a: Sequence[str], b: Sequence[str], of_b: Sequence[str], of_a: Sequence[str]) -> str:
    parts = []
    for label, missing in (("A", of_a), ("B", of_b)):
        if missing:
            what = "joint" if len(missing) == 1 else "joints"
            parts.append(f"{what} {', '.join(missing)} of {label}")
    pairs = []
    remaining = list(of_b)
    for name in of_a:
        near = difflib.get_close_matches(name, remaining, n=1, cutoff=0.0)
        if near:
            remaining.remove(near[0])
            pairs.append(f"{name}={near[0]}")
    remedy = (
        f"name the pairs, for instance --joints {','.join(pairs)}"
        if pairs
        else ("a joint that is locked in one model can't be compared: lock it in both")
    )
    return (
        f"no match for {' and '.join(parts)}; the joints of A are {', '.join(a)}; those of B are"
        f" {', '.join(b)}; {remedy}"
    )


def _compiled(
    source: str,
    names: Sequence[str],
    others: Sequence[str],
    expressions: Mapping[str, sp.Expr],
    z: Mapping[str, sp.Symbol],
    phrases: tuple[str, ...],
    plain: set[str],
) -> Match:
    symbols = list(z.values())
    w = [sp.Symbol(f"w{i}_", real=True) for i in range(len(symbols))]
    value = [sp.sympify(expressions[name]) for name in others]
    forces = [sp.Symbol(f"f{i}_", real=True) for i in range(len(value))]
    slope = sp.zeros(len(value), len(symbols))
    rates = sp.zeros(2 * len(value), 2 * len(symbols))
    for i, expression in enumerate(value):
        for j, symbol in enumerate(symbols):
            if expression.has(symbol):
                slope[i, j] = expression.diff(symbol)
        rate = sum((slope[i, j] * w[j] for j in range(len(symbols))), sp.Integer(0))
        turn = [rate.diff(symbol) if rate.has(symbol) else sp.Integer(0) for symbol in symbols]
        for j in range(len(symbols)):
            rates[i, j] = rates[len(value) + i, len(symbols) + j] = slope[i, j]
            rates[len(value) + i, j] = turn[j]
    used = set[sp.Basic]().union(*(e.free_symbols for e in value))
    spelled = {symbol: sp.Symbol(name) for name, symbol in z.items()}
    label, other = ("A", "B") if source == "A" else ("B", "A")
    pairing = [
        f"{name} of {other} is {sp.sstr(expression.xreplace(spelled))} of {label}"
        for name, expression in zip(others, value, strict=True)
        if expression != z.get(name) and name not in plain
    ]
    return Match(
        source=source,
        names=tuple(others),
        pairing=(*phrases, *pairing),
        left_out=tuple(name for name, symbol in z.items() if symbol not in used),
        constant=not slope.free_symbols,
        value=compile_function(value, symbols),
        slope=compile_function(list(slope), symbols),
        push=compile_function(list(slope.T * sp.Matrix(forces)), symbols, forces),
        rates=compile_function(list(rates), symbols, w),
        periodic=tuple(bool(e.has(sp.atan2)) for e in value),
    )


@dataclass(frozen=True, kw_only=True)
class JointPair:
    """Two joints related by a line: B's position is slope * A's + offset."""

    a: str
    b: str
    slope: float
    offset: float


def pairs_of(match: Match, source_names: tuple[str, ...]) -> tuple[JointPair, ...]:
    """Return pairs of joints of A and B that a match relates by lines.

    Args:
        match: of coordinates.
        source_names: names of the source's coordinates.
    """
    if not match.constant:
        return ()
    zero = np.zeros((1, len(source_names)))
    slopes, offsets = match.slopes(zero)[0], match.value(zero)[0]
    pairs = []
    for name, row, offset in zip(match.names, slopes, offsets, strict=True):
        (places,) = np.nonzero(row)
        if len(places) != 1:
            continue
        source, slope = source_names[places[0]], float(row[places[0]])
        if match.source == "A":
            pairs.append(JointPair(a=source, b=name, slope=slope, offset=float(offset)))
        else:
            pairs.append(
                JointPair(a=name, b=source, slope=1 / slope, offset=-float(offset) / slope + 0.0)
            )
    return tuple(pairs)
