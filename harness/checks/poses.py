"""Positions and rotations of a model's frames, over the motions and at random positions."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from msgspec.structs import replace as replace_fields

from physics_crosscheck.harness.engines.protocol import EngineError, LoadedModel
from physics_crosscheck.harness.modelfiles.frames import FrameTarget, SidecarFrames, sidecar_frames
from physics_crosscheck.harness.modelfiles.readers import RobotError, read_as_it_runs
from physics_crosscheck.harness.modelfiles.robot import PlacedShape
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.poses import FramePose, Poses
from physics_crosscheck.reference.dynamics.tree_equations import TreeFrames
from physics_crosscheck.reference.mechanism.declaration import Coordinate
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import IDENTITY
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from .placed_frames import Frames, Placed
from .prepare import Prepared, PreparedTree
from .task import ModelTask
from .verdict import CaseJudgement, motions_in_words

SHARE = 1e-3
"""Share of a pose error that a kind may leave unexplained, if rounding allows less."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Miss:
    """One frame at K positions, in the equations and in the engine.

    Attributes:
        origin, turn: in the equations, (K, 3) and (K, 3, 3).
        measured_origin, measured_turn: in the engine.
        flipped: the equations' poses with the sign of one coordinate changed, by its name.
        point: whether it is a point, so that its rotation has no meaning.
        near: distance below which poses are equal, m and rad.
    """

    origin: Array
    turn: Array
    measured_origin: Array
    measured_turn: Array
    flipped: Mapping[str, tuple[Array, Array]]
    point: bool
    near: tuple[float, float]

    @staticmethod
    def select(
        f: int,
        expected: Placed,
        measured: Placed,
        flipped: Mapping[str, Placed],
        *,
        point: bool,
        uncertainty: tuple[float, float],
    ) -> Miss:
        """Select frame `f`."""
        far, turned = (float(np.max(each[:, f])) for each in expected.miss(measured))
        return Miss(
            origin=expected.origin[:, f],
            turn=expected.turn[:, f],
            measured_origin=measured.origin[:, f],
            measured_turn=measured.turn[:, f],
            flipped={name: (one.origin[:, f], one.turn[:, f]) for name, one in flipped.items()},
            point=point,
            near=(max(uncertainty[0], SHARE * far), max(uncertainty[1], SHARE * turned)),
        )

    def is_at(self, position: Array) -> bool:
        """Return whether the engine has the origin at this place."""
        return bool(
            np.max(np.linalg.norm(self.measured_origin - position, axis=-1)) <= self.near[0]
        )

    def is_turned(self, turn: Array) -> bool:
        """Return whether the engine has this rotation; false for a point."""
        chord = np.linalg.norm(self.measured_turn - turn, axis=(-2, -1)) / np.sqrt(2)
        return self.point or bool(np.max(chord) <= self.near[1])


def kind_of(miss: Miss) -> str:
    """Return the kind of a mistake in a few words; "" if no kind explains the error."""
    return next(_kinds(miss), "")


def _kinds(miss: Miss) -> Iterator[str]:
    yield from _shifted(miss)
    yield from _wrong_signs(miss)
    if not miss.point:
        yield from _turned(miss)
    yield from _plane(miss)
    if miss.point:
        yield from _mirrored(miss)


def _wrong_signs(miss: Miss) -> Iterator[str]:
    """Yield the coordinates with the opposite sign."""
    for name, (position, turn) in miss.flipped.items():
        moved = _mean(miss.measured_origin - position)
        if miss.is_at(position + moved) and miss.is_turned(turn):
            kind = f"as if {name} had the other sign: an axis is flipped"
            yield f"{kind}{_and_moved(moved, miss)}"


def _shifted(miss: Miss) -> Iterator[str]:
    """Yield a translation in the world or in the body."""
    if not miss.is_turned(miss.turn):
        return
    off = miss.measured_origin - miss.origin
    if miss.is_at(miss.origin + _mean(off)):
        yield f"moved by {_vector(_mean(off))} in the world"
    # For a point, only the engine has the rotation of its body.
    inside = _mean(np.einsum("kji,kj->ki", miss.measured_turn, off))
    if miss.is_at(miss.origin + miss.measured_turn @ inside):
        yield f"offset by {_vector(inside)} in its body's axes"


def _turned(miss: Miss) -> Iterator[str]:
    """Yield a constant rotation in the world or in the body."""
    world = miss.measured_turn[0] @ miss.turn[0].T
    if miss.is_turned(world @ miss.turn):
        moved = _mean(miss.measured_origin - miss.origin @ world.T)
        if miss.is_at(miss.origin @ world.T + moved):
            yield f"turned in the world by {_turn(world)}{_and_moved(moved, miss)}"
    body = miss.turn[0].T @ miss.measured_turn[0]
    if miss.is_turned(miss.turn @ body):
        inside = _mean(np.einsum("kji,kj->ki", miss.turn, miss.measured_origin - miss.origin))
        if miss.is_at(miss.origin + miss.turn @ inside):
            near = np.linalg.norm(inside) <= miss.near[0]
            yield f"its axes are turned by {_turn(body)} in its body" + (
                "" if near else f", and offset by {_vector(inside)} there"
            )


def _plane(miss: Miss) -> Iterator[str]:
    """Yield a rotation of the plane of motion or of a joint axis."""
    for axes in _cube():
        if np.allclose(axes, np.eye(3)):
            continue
        moved = _mean(miss.measured_origin - miss.origin @ axes.T)
        if miss.is_at(miss.origin @ axes.T + moved) and miss.is_turned(axes @ miss.turn @ axes.T):
            yield f"its motion is turned by {_turn(axes)}{_and_moved(moved, miss)}"


def _mirrored(miss: Miss) -> Iterator[str]:
    for i, name in enumerate("xyz"):
        sign = np.ones(3)
        sign[i] = -1.0
        moved = _mean(miss.measured_origin - miss.origin * sign)
        if miss.is_at(miss.origin * sign + moved):
            yield f"mirrored in {name}{_and_moved(moved, miss)}"


def _cube() -> Iterator[Array]:
    """Yield the 24 rotations of a cube, quarter turns about an axis first."""
    turns = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0:
                turns.append(matrix)
    yield from sorted(turns, key=lambda matrix: -float(np.trace(matrix)))


def _mean(rows: Array) -> Array:
    mean: Array = rows.mean(axis=0)
    return mean


def _vector(v: Array) -> str:
    size = np.linalg.norm(v)
    shown = [0.0 if abs(x) < 1e-6 * size else x for x in v]
    return f"({', '.join(f'{x:.4g}' for x in shown)}) m"


def _and_moved(moved: Array, miss: Miss) -> str:
    near = np.linalg.norm(moved) <= miss.near[0]
    return "" if near else f", and moved by {_vector(moved)} in the world"


def _turn(matrix: Array) -> str:
    """Format a rotation as an angle about an axis."""
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    # The rotation keeps its axis: the largest column of the symmetric part.
    symmetric = matrix + matrix.T + (1 - np.trace(matrix)) * np.eye(3)
    axis = symmetric[:, int(np.argmax(np.linalg.norm(symmetric, axis=0)))]
    axis = axis / (np.linalg.norm(axis) or 1.0)
    skew = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    if angle < 1e-4:  # the rest of the symmetric part is rounding
        angle, axis = float(np.linalg.norm(skew)) / 2, skew / (np.linalg.norm(skew) or 1.0)
    elif axis @ skew < 0 or (not (axis @ skew > 0) and axis.sum() < 0):
        axis = -axis
    return f"{np.degrees(angle):.4g} degrees about {_axis(axis)}"


def _axis(axis: Array) -> str:
    i = int(np.argmax(np.abs(axis)))
    if abs(axis[i]) > 1 - 1e-9:
        return f"{'-' if axis[i] < 0 else ''}{'xyz'[i]}"
    return f"({', '.join(f'{x:.4g}' for x in axis)})"


BODIES = ("link", "body")
"""Words of engines for a body, in the names of its places."""

SEED = 20260115
DRAWS = 64
"""Number of random positions, in addition to those of the motions."""

RESOLUTION = 1e-9
"""Smallest pose error that counts, relative to the largest declared distance, or in rad. Smaller
errors are differences in the last digits of a number.
"""


MESH = 1.0
"""Size of the meshes that adapters load in place of files, m."""


@dataclass(frozen=True)
class PoseFinding:
    """Frames with the same pose error.

    Attributes:
        frames: their names.
        off: largest error, m.
        share: smallest share of it that would still be detected.
        is_size: whether it is the size of a shape.
    """

    frames: tuple[str, ...]
    message: str
    off: float
    share: float
    is_size: bool = False


@dataclass(frozen=True)
class PoseCheck:
    """The compared frames, their differences, and the lines of the frames that differ."""

    record: Poses
    findings: tuple[PoseFinding, ...] = ()
    locations: tuple[SourceLine, ...] = ()
    kind: CaseKind = "pose"

    def combined(self, verdict: CaseJudgement) -> CaseJudgement:
        """Combine the verdict on a motion with this one: a difference in either counts."""
        if not self.findings or verdict.outcome is Outcome.DIFFERS:
            return verdict
        worst = min(self.findings, key=lambda one: one.share)
        differs_by = RESOLUTION / worst.share
        return replace(
            verdict,
            outcome=Outcome.DIFFERS,
            discrepancy=differs_by,
            uncertainty=RESOLUTION,
            largest_discrepancy=differs_by,
            largest_uncertainty=RESOLUTION,
            component=worst.frames[0],
            time=float("nan"),
            reason="; ".join([*(one.message for one in self.findings), motions_in_words(verdict)]),
            resolution=RESOLUTION,
            kind=self.kind,
            decided_by="poses",
        )


def check_poses(
    system: System, sidecar: Sidecar, model: LoadedModel, coordinates: CoordinateMap, reached: Array
) -> PoseCheck:
    """Compare the frames of a loaded model with the equations.

    Args:
        reached: positions of the motions, (K, n).

    Raises:
        SidecarError: naming file, line, entry and remedy.
    """
    mapped_frames = sidecar_frames(system, sidecar)
    mapped = [target.name for target in mapped_frames.targets]
    unchecked = tuple(frame.name for frame in system.frames if frame.name not in mapped)
    if not system.frames:
        return PoseCheck(Poses(note="the system declares no frames"))
    if not mapped:
        return PoseCheck(Poses(unchecked=unchecked, note="the sidecar maps no frame of the system"))
    if not model.places:
        return PoseCheck(
            Poses(unchecked=unchecked, note="the engine does not report the poses of its bodies")
        )
    frames = Frames.look_up(system, mapped_frames, model, coordinates)
    with np.errstate(all="ignore"):
        q = _positions(frames, system, reached)
    points = [system.frames[row].rotation is None for row in frames.rows]
    return _compared(frames, system.coordinates, points, q, unchecked)


def case_poses(
    task: ModelTask[Prepared], model: LoadedModel, coordinates: CoordinateMap
) -> PoseCheck | None:
    """Compare the poses of a tree's bodies; the audit compares frames of declared energies."""
    if not isinstance(task.target, PreparedTree):
        return None
    check = _check_bodies(task.target, model, coordinates)
    lines = {name: (task.file, line) for name, line in _lines(task).items()}
    lines |= {one.name: (one.file, one.line) for one in task.target.placed}
    sizes = lines | {one.name: one.size_place for one in task.target.placed if one.size_place}
    named = (
        (name, sizes if one.is_size else lines) for one in check.findings for name in one.frames
    )
    places = dict.fromkeys(where[name] for name, where in named if name in where)
    locations = (SourceLine(file=str(file), line=line) for file, line in places if line)
    return replace(check, locations=tuple(locations))


def _lines(task: ModelTask[Prepared]) -> Mapping[str, int]:
    """Return the line of each body in the model file, by name; none in a file of another kind."""
    if isinstance(task.target, PreparedTree) and task.sidecar is None:
        return task.target.lines
    with suppress(RobotError, EngineError):
        return read_as_it_runs(task.file, {}).lines
    return {}


def _check_bodies(
    target: PreparedTree, model: LoadedModel, coordinates: CoordinateMap
) -> PoseCheck:
    """Compare bodies, and shapes and sites of a robot file, by name, at the sampled positions."""
    engine_names = {
        name: place
        for name in target.tree.frames
        if (place := _place_of(name, model.places)) is not None
    }
    shapes = [one for one in target.placed if one.name in model.shapes]
    tree = with_shapes(target.tree, shapes)
    unchecked = tuple(name for name in target.tree.frames if name not in engine_names)
    engine_names |= {one.name: one.name for one in shapes}
    if not engine_names:
        return PoseCheck(
            Poses(unchecked=unchecked, note="the engine does not report the poses of its bodies")
        )
    targets = tuple(
        FrameTarget(name=name, place=place, offset=np.zeros(3), axes=np.eye(3), where="")
        for name, place in engine_names.items()
    )
    frames = Frames(
        model,
        coordinates,
        SidecarFrames(targets=targets, axes=np.eye(3), origin=np.zeros(3)),
        TreeFrames(tree, tuple(engine_names)),
        tuple(range(len(targets))),
    )
    q, points = target.samples.start[:, : len(target.names)], [False] * len(targets)
    owners = {one.name: one.body for one in shapes}
    # Engines place bodies by their centers.
    extent = max((float(np.linalg.norm(one.center)) for one in target.tree.links), default=0.0)
    extent += MESH if any(one.kind == "mesh" for one in shapes) else 0.0
    check = _compared(frames, target.system.coordinates, points, q, unchecked, owners, extent)
    return _with_sizes(check, shapes, model.shapes)


def with_shapes(tree: Tree, shapes: Iterable[PlacedShape]) -> Tree:
    """Return a tree with the frames of shapes, by their names."""
    frames = dict(tree.frames)
    for shape in shapes:
        link, place = (WORLD, IDENTITY) if shape.body is None else tree.frames[shape.body]
        frames[shape.name] = link, place.compose(shape.place)
    return replace(tree, frames=frames)


def _with_sizes(
    check: PoseCheck, shapes: Sequence[PlacedShape], sizes: Mapping[str, tuple[float, ...]]
) -> PoseCheck:
    """Add the shapes whose sizes differ, and drop the rows of those that agree."""
    rows = {row.name: row for row in check.record.frames}
    findings = list(check.findings)
    for shape in shapes:
        measured = sizes[shape.name]
        expected = shape.scale if shape.kind == "mesh" and measured else shape.size
        off = _size_error(expected, measured)
        if off > RESOLUTION * max(map(abs, expected), default=0.0):
            far = max(rows[shape.name].position or 0.0, off)
            rows[shape.name] = replace_fields(rows[shape.name], position=number(far), agrees=False)
            findings.append(_size_finding(shape, expected, measured, off))
    names = {shape.name for shape in shapes}
    kept = tuple(row for row in rows.values() if row.name not in names or not row.agrees)
    record = replace_fields(check.record, frames=kept, shapes=len(shapes))
    return PoseCheck(record, tuple(findings))


def _size_error(expected: Sequence[float], measured: Sequence[float]) -> float:
    """Return the largest difference of two sizes, m; infinite for shapes of two kinds."""
    if len(expected) != len(measured):
        return np.inf
    return float(np.max(np.abs(np.subtract(expected, measured)), initial=0.0))


def _size_finding(
    shape: PlacedShape, expected: Sequence[float], measured: Sequence[float], off: float
) -> PoseFinding:
    sizes = (" ".join(f"{x:.12g}" for x in size) for size in (expected, measured))
    word = "scale" if shape.kind == "mesh" else "size"
    message = "{}: its {} is {} in the file and {} in the engine".format(shape.name, word, *sizes)
    largest = max(map(abs, expected), default=0.0)
    share = off / largest if largest and np.isfinite(off) else 1.0
    return PoseFinding((shape.name,), message, off, RESOLUTION / share, is_size=True)


def _place_of(name: str, places: Collection[str]) -> str | None:
    """Return a body's name in an engine, or None if the engine lacks it."""
    return next((f"{kind}:{name}" for kind in BODIES if f"{kind}:{name}" in places), None)


def _compared(
    frames: Frames,
    coordinates: Sequence[Coordinate],
    points: Sequence[bool],
    q: Array,
    unchecked: tuple[str, ...],
    owners: Mapping[str, str | None] = MappingProxyType({}),
    extent: float = 0.0,
) -> PoseCheck:
    """Compare every mapped frame at positions q, (K, n); a point has no rotation.

    Shapes that move with their owners are not named beside these. Engines compute frames from
    distances of up to `extent`, m, besides those between bodies.
    """
    z = frames.coordinates.forward(q)
    expected, measured = frames.expected(q), frames.measured(z)
    length = frames.length(z) + extent
    uncertainty = frames.uncertainty(q, length)
    far, turned = expected.miss(measured)
    turned[:, np.flatnonzero(points)] = 0.0
    size = float(np.max(np.abs(expected.origin), initial=0.0)) or length
    near = max(uncertainty[0], RESOLUTION * size), max(uncertainty[1], RESOLUTION)
    # A pose that is not a number counts as infinitely far away.
    wrong = ~np.all((far <= near[0]) & (turned <= near[1]), axis=0)
    elsewhere = np.flatnonzero(wrong).tolist()
    rows = tuple(
        FramePose(
            name=target.name,
            place=target.place,
            position=number(float(np.max(far[:, f]))),
            rotation=None if points[f] else number(float(np.degrees(np.max(turned[:, f])))),
            agrees=f not in elsewhere,
        )
        for f, target in enumerate(frames.mapped.targets)
    )
    record = Poses(
        frames=rows,
        states=len(q),
        length=number(length),
        uncertainty=number(uncertainty[0]),
        unchecked=unchecked,
    )
    flips = enumerate(coordinates if elsewhere else ())
    flipped = {c.name: frames.expected(_flipped(q, j)) for j, c in flips}
    alike: dict[str, list[int]] = {}
    for f in elsewhere:
        miss = Miss.select(f, expected, measured, flipped, point=points[f], uncertainty=uncertainty)
        alike.setdefault(kind_of(miss), []).append(f)
    findings = []
    for kind, members in alike.items():
        moved = {rows[f].name for f in members}
        group = [f for f in members if owners.get(rows[f].name) not in moved]
        worst = q[int(np.argmax((far + turned)[:, group].max(axis=1)))]
        message = _sentence([rows[f] for f in group], kind, _place(coordinates, worst), near)
        apart = far[:, group].max() / near[0] if near[0] else 0.0, turned[:, group].max() / near[1]
        names = tuple(rows[f].name for f in group)
        off, share = float(far[:, group].max()), 1 / float(max(apart))
        findings.append(PoseFinding(names, message, off, share))
    return PoseCheck(record, tuple(findings))


def _flipped(q: Array, j: int) -> Array:
    """Change the sign of one coordinate in positions."""
    other = q.copy()
    other[:, j] *= -1
    return other


def _positions(frames: Frames, system: System, reached: Array) -> Array:
    """Return the positions of the motions, and random ones up to a turn or twice as far, (K, n)."""
    extent = np.max(np.abs(reached), axis=0)
    turns = np.array([coordinate.unit == "rad" for coordinate in system.coordinates])
    wide = np.where(turns, np.pi, 2 * np.where(extent > 0, extent, 1.0))
    random = np.random.default_rng(SEED).uniform(-wide, wide, (DRAWS, len(wide)))
    q = np.concatenate([reached, random])
    is_finite = np.isfinite(frames.coordinates.forward(q)).all(axis=1)
    is_finite &= np.isfinite(frames.function(q)).all(axis=1)
    return q[is_finite]


def _place(coordinates: Sequence[Coordinate], q: Array) -> str:
    named = zip(coordinates, q, strict=True)
    return ", ".join(f"{c.name} = {value:.4g}" for c, value in named)


def _sentence(group: Sequence[FramePose], kind: str, place: str, near: tuple[float, float]) -> str:
    """Describe the common error of some frames; omit parts smaller than `near`, m and rad."""
    places = (f" ({one.place})" if one.place != one.name else "" for one in group)
    names = ", ".join(one.name + place for one, place in zip(group, places, strict=True))
    far = max(one.position or 0.0 for one in group)
    angle = max(one.rotation or 0.0 for one in group)
    off = [f"{far:.3g} m"] if far > near[0] else []
    off += [f"{angle:.3g} degrees"] if np.radians(angle) > near[1] else []
    size = " and ".join(off) or "not a number"
    message = f"{names}: off by up to {size} from the equations' pose, at {place}"
    return f"{message}; {kind or 'no single shift, turn or flipped axis explains it'}"
