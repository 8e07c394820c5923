"""Positions and rotations of a model's frames, over the motions and at random positions."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.checks.placed_frames import Frames
from physics_crosscheck.harness.checks.pose_mistakes import Miss, kind_of
from physics_crosscheck.harness.checks.prepare import PreparedTree
from physics_crosscheck.harness.checks.verdict import Verdict, motions_in_words
from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.modelfiles.frames import FrameTarget, SidecarFrames, sidecar_frames
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.poses import FramePose, Poses
from physics_crosscheck.reference.dynamics.tree_equations import TreeFrames
from physics_crosscheck.reference.mechanism.declaration import Coordinate
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System

BODIES = ("link", "body")
"""Words of engines for a body, in the names of its places."""

SEED = 20260115
DRAWS = 64
"""Number of random positions, in addition to those of the motions."""

RESOLUTION = 1e-9
"""Smallest pose error that counts, relative to the largest declared distance, or in rad. Smaller
errors are differences in the last digits of a number.
"""


@dataclass(frozen=True)
class PoseFinding:
    """Frames with the same pose error.

    Attributes:
        frames: their names.
        off: largest error, m.
        share: smallest share of it that would still be detected.
    """

    frames: tuple[str, ...]
    message: str
    off: float
    share: float


@dataclass(frozen=True)
class PoseCheck:
    """The compared frames, and their differences."""

    record: Poses
    findings: tuple[PoseFinding, ...] = ()


def check_poses(
    system: System,
    sidecar: Sidecar,
    model: Model,
    coordinates: CoordinateMap,
    reached: Array,
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
    frames = Frames.of(system, mapped_frames, model, coordinates)
    with np.errstate(all="ignore"):
        q = _positions(frames, system, reached)
    points = [system.frames[row].rotation is None for row in frames.rows]
    return _compared(frames, system.coordinates, points, q, unchecked)


def check_bodies(target: PreparedTree, model: Model, coordinates: CoordinateMap) -> PoseCheck:
    """Compare the bodies of a robot file, by name, at the sampled positions."""
    engine_names = {
        name: place
        for name in target.tree.frames
        if (place := _place_of(name, model.places)) is not None
    }
    unchecked = tuple(name for name in target.tree.frames if name not in engine_names)
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
        TreeFrames(target.tree, tuple(engine_names)),
        tuple(range(len(targets))),
    )
    q, points = target.samples.start[:, : len(target.names)], [False] * len(targets)
    return _compared(frames, target.system.coordinates, points, q, unchecked)


def _place_of(name: str, places: Collection[str]) -> str | None:
    """Return a body's name in an engine, or None if the engine lacks it."""
    return next((f"{kind}:{name}" for kind in BODIES if f"{kind}:{name}" in places), None)


def with_poses(verdict: Verdict, check: PoseCheck) -> Verdict:
    """Combine the verdict on a motion with the one on poses: a difference in either counts."""
    if not check.findings or verdict.outcome is Outcome.DIFFERS:
        return verdict
    worst = min(check.findings, key=lambda one: one.share)
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
        reason="; ".join([*(one.message for one in check.findings), motions_in_words(verdict)]),
        resolution=RESOLUTION,
        kind="pose",
        decided_by="poses",
    )


def _compared(
    frames: Frames,
    coordinates: Sequence[Coordinate],
    points: Sequence[bool],
    q: Array,
    unchecked: tuple[str, ...],
) -> PoseCheck:
    """Compare every mapped frame at positions q, (K, n); a point has no rotation."""
    z = frames.coordinates.forward(q)
    expected, measured = frames.expected(q), frames.found(z)
    length = frames.length(z)
    uncertainty = frames.uncertainty(q, length)
    far, turned = expected.miss(measured)
    turned[:, np.flatnonzero(points)] = 0.0
    size = float(np.max(np.abs(expected.at), initial=0.0)) or length
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
        for f, target in enumerate(frames.said.targets)
    )
    record = Poses(
        frames=rows,
        states=len(q),
        length=number(length),
        uncertainty=number(uncertainty[0]),
        unchecked=unchecked,
    )
    flipped = {c.name: frames.expected(_flipped(q, j)) for j, c in enumerate(coordinates)}
    alike: dict[str, list[int]] = {}
    for f in elsewhere:
        miss = Miss.of(f, expected, measured, flipped, point=points[f], uncertainty=uncertainty)
        alike.setdefault(kind_of(miss), []).append(f)
    findings = []
    for kind, group in alike.items():
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
    names = ", ".join(f"{one.name} ({one.place})" for one in group)
    far = max(one.position or 0.0 for one in group)
    angle = max(one.rotation or 0.0 for one in group)
    off = [f"{far:.3g} m"] if far > near[0] else []
    off += [f"{angle:.3g} degrees"] if np.radians(angle) > near[1] else []
    size = " and ".join(off) or "not a number"
    message = f"{names}: off by up to {size} from the equations' pose, at {place}"
    return f"{message}; {kind or 'no single shift, turn or flipped axis explains it'}"
