"""One function for each kind of advice, and the table of all.

Thresholds are chosen on the robots of `campaigns.plausibility`; `docs/plausibility.md` has the
counts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import get_args

import numpy as np

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.modelfiles.robot import HELD, LOCKED, LinkPart
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import PlausibilityKind
from physics_crosscheck.harness.results.status import counted, listed
from physics_crosscheck.reference.mechanism.rotations import Array
from ..acting import acting_quantities
from .facts import COMPILED, RobotFacts, WeldedBody
from .hull import Hull

NAMED = 3
"""Most links or joints that a message names."""

MIN_EQUAL = 3
"""Fewest links with one tensor that make a placeholder."""

UNLIKE = 1.5
"""Ratio of masses or sizes from which links with one tensor differ."""

NEGLIGIBLE_SHARE = 0.02
"""Share of a body's mass below which the inertia of one of its links does not matter."""

MIN_OUTSIDE, OUTSIDE_SHARE = 0.005, 0.1
"""Smallest distance of a center of mass from the hull, m, and as a share of its diagonal."""

MAX_DENSITY = 22600.0
"""Density of osmium, the densest metal, kg/m^3; a hull has at least the volume of its body."""

MIN_DENSITY, MIN_SKIN = 3.0, 0.005
"""Density of a hull below that of foam, kg/m^3; mass per area of half a balloon's, kg/m^2."""

MARKER_MASS = 1e-6
"""Mass of a body that only marks a place, kg."""

MILLIMETRES = 10.0
"""Smallest diagonal of a link that is drawn in millimetres, m."""

FAR_RATIO = 1.5
"""Ratio of an inertia to that of all mass at the farthest point, from which it is impossible."""

SMALL_RATIO = 100.0
"""Ratio of the inertia at uniform density to the stated one from which it is too small."""

LONG_RATIO, FIT_RATIO, SWAP_RATIO = 4.0, 2.5, 4.0
"""Ratio of a long shape's moments; misfit of swapped axes, and how much better it must be."""

MIRROR_MASS, MIRROR_MOMENTS = 0.05, 0.2
"""Relative difference of masses, and of moments, of a left and a right link."""

MIN_RATIO, MAX_RATIO = 0.05, 10.0
"""Damping ratios of drives that oscillate for long, and that may creep."""

STOPPED_BANDS = 12
"""Dead bands of dry friction in an amplitude that ends within three periods: two a half period."""

MAX_LAG_SECONDS = 0.5
"""Longest time constant of a drive that does not creep."""

NO_INERTIA_SHARE = 1e-9
"""Moments that count as none, relative to those at uniform density."""

SMALLEST_BALL = 4e-7 * np.eye(3)
"""Moments per kg of a ball of 1 mm radius, m^2, for links whose shapes can't be read."""

_SIDES = (
    ("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("l", "r"), ("L", "R"),
    ("lf", "rf"), ("lh", "rh"), ("LF", "RF"), ("LH", "RH"),
    ("fl", "fr"), ("FL", "FR"), ("hl", "hr"), ("HL", "HR"), ("bl", "br"), ("RL", "RR"),
    ("BL", "BR"), ("rl", "rr"),
)  # fmt: skip
"""Words for both sides in names."""

_OTHER_SIDE = dict(_SIDES) | {right: left for left, right in _SIDES}

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|[^A-Za-z\d]+")


@dataclass(frozen=True, kw_only=True)
class Advice:
    """An implausible number.

    Attributes:
        kind: of the finding.
        subject: names of links or joints.
        message: the number, what would be expected, and what to do.
        line: of the file.
        expected, actual: the numbers; None without one.
        excess: how far it is from plausible, for the order; 1 is the threshold.
    """

    kind: PlausibilityKind
    subject: tuple[str, ...]
    message: str
    line: SourceLine
    expected: float | None = None
    actual: float | None = None
    excess: float = 1.0


BodyJudge = Callable[[RobotFacts, WeldedBody, Hull], Advice | None]
"""Judges a body by the hull of its shapes."""


def equal_inertias(facts: RobotFacts) -> Iterator[Advice]:
    """Yield groups of unlike links with one tensor."""
    sizes = {part.name: body for body in facts.bodies for part in body.parts}
    alike: dict[tuple[float, ...], list[LinkPart]] = {}
    for body in facts.bodies:
        for part in body.parts:
            is_heavy = part.inertia.mass > NEGLIGIBLE_SHARE * body.inertia.mass
            if is_heavy and any(part.link.inertia) and not _fits_shape(part, body):
                alike.setdefault(part.link.inertia, []).append(part)
    for tensor, parts in alike.items():
        need = 2 if _is_round(tensor) else MIN_EQUAL
        if len(parts) < need or not _differ(parts, sizes):
            continue
        names = [part.name for part in sorted(parts, key=lambda one: one.inertia.mass)]
        values = " ".join(f"{value:g}" for value in tensor[:3])
        shapes = (_by_shape(part, sizes[part.name]) for part in parts if part.name == names[0])
        shape = next(shapes, None)
        hint = "" if shape is None else f"; by shape {quote(shape[0])} has {shape[1]:.2g}"
        masses = [part.inertia.mass for part in parts]
        yield Advice(
            kind="equal inertias",
            subject=tuple(names),
            message=f"{len(names)} unlike links of {min(masses):.3g} to {max(masses):.3g} kg share "
            f"the moments of inertia {values} kg m^2: {listed(names, NAMED)}{hint}. "
            "Compute those of each link",
            line=facts.inertial_line(names[0]),
            expected=None if shape is None else shape[1],
            actual=tensor[0],
            excess=float(len(names)),
        )


def _is_round(tensor: Sequence[float]) -> bool:
    """Return whether three equal moments have one digit, and there are no products."""
    xx, yy, zz, *products = tensor
    return xx == yy == zz and not any(products) and float(f"{xx:.0e}") == xx


def _differ(parts: Sequence[LinkPart], bodies: Mapping[str, WeldedBody]) -> bool:
    """Return whether the masses or the shapes of links differ."""
    masses = [part.inertia.mass for part in parts]
    if max(masses) > UNLIKE * min(masses):
        return True
    hulls = [body.hull for part in parts if len((body := bodies[part.name]).parts) == 1]
    sizes = [hull.volume for hull in hulls if hull is not None]
    return len(sizes) > 1 and max(sizes) > UNLIKE**3 * min(sizes)


def _fits_shape(part: LinkPart, body: WeldedBody) -> bool:
    """Return whether the moments of a link are about those at uniform density."""
    if body.hull is None or len(body.parts) > 1:
        return False
    even = part.inertia.mass * _moments(body.hull.moments_about(body.inertia.center))
    return _misfit(_moments(part.inertia.inertia), even) < FIT_RATIO


def _by_shape(part: LinkPart, body: WeldedBody) -> tuple[str, float] | None:
    """Return a link's name and its largest moment at uniform density, kg m^2."""
    if body.hull is None or len(body.parts) > 1:
        return None
    moments = _moments(body.hull.moments_about(body.inertia.center))
    return part.name, float(moments[-1]) * part.inertia.mass


def unlike_shapes(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the first of `BODY_KINDS` that holds for each body with shapes."""
    for body in facts.bodies:
        if body.hull is not None:
            advice = (_judged(judge, facts, body, body.hull) for judge in BODY_KINDS)
            yield from [one for one in advice if one is not None][:1]


def _judged(judge: BodyJudge, facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Judge a body by the shapes that collide, then by all: these are often more precise."""
    # The hull is unknown if a shape can't be read, and may be larger.
    if body.whole_hull is None or judge(facts, body, hull) is None:
        return None
    return judge(facts, body, body.whole_hull)


def mesh_in_millimetres(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Return advice about a mesh whose coordinates are millimetres."""
    if not body.has_mesh or hull.diagonal < MILLIMETRES:
        return None
    density = body.inertia.mass / hull.volume
    if density > MIN_DENSITY / 100:
        return None
    mesh = next(shape for shape in body.shapes if shape.kind == "mesh")
    file, line = mesh.size_place or (mesh.file, mesh.line)
    return Advice(
        kind="mesh unit",
        subject=(body.name,),
        message=f"{_named(body)} of {body.inertia.mass:.3g} kg is {hull.diagonal:.3g} m "
        f"long, {density:.1g} kg/m^3: its mesh is in millimetres. Scale it by 0.001",
        line=SourceLine(file=str(file), line=line or None),
        expected=0.001,
        actual=1.0,
        excess=MIN_DENSITY / density,
    )


def center_outside(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Return advice about a center of mass outside the shapes."""
    distance = hull.outside(body.inertia.center)
    limit = max(MIN_OUTSIDE, OUTSIDE_SHARE * hull.diagonal)
    if distance <= limit:
        return None
    return Advice(
        kind="center outside",
        subject=(body.name,),
        message=f"the center of mass of {_named(body)} is {1e3 * distance:.3g} mm outside its "
        f"shapes of {1e3 * hull.diagonal:.3g} mm; their middle is at "
        f"{_vector(_in_link(body, hull.center))}. Check the origin of its inertia, and the "
        "places of its shapes",
        line=facts.inertial_line(body.name),
        expected=0.0,
        actual=distance,
        excess=distance / limit,
    )


def implausible_density(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Return advice about a mass that the volume of the shapes excludes."""
    density = body.inertia.mass / hull.volume
    heavy, usual = density > MAX_DENSITY, 1000.0 * hull.volume
    light = density < MIN_DENSITY and body.inertia.mass < MIN_SKIN * hull.area
    if not (heavy or light) or body.inertia.mass < MARKER_MASS:
        return None
    what = "more than any metal" if heavy else "less than a balloon"
    return Advice(
        kind="density",
        subject=(body.name,),
        message=f"{_named(body)} has {body.inertia.mass:.3g} kg in {hull.volume:.2g} m^3, "
        f"{density:.2g} kg/m^3, which is {what}; as water "
        f"it has {usual:.2g} kg. Check its mass and the size of its shapes",
        line=facts.inertial_line(body.name),
        expected=usual,
        actual=body.inertia.mass,
        excess=density / MAX_DENSITY if heavy else MIN_DENSITY / density,
    )


def inertia_too_large(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Return advice about moments that no mass within the shapes has."""
    mass, center, tensor = body.inertia
    stated, limit = float(np.trace(tensor)) / 2, mass * hull.farthest(center) ** 2
    if stated <= FAR_RATIO * limit:
        return None
    what = "impossible within its shapes"
    return _of_moments(facts, body, hull, "inertia too large", what, stated / limit)


def inertia_too_small(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Return advice about moments of a body that is concentrated in a point."""
    mass, center, tensor = body.inertia
    stated = float(np.trace(tensor)) / 2
    even = mass * float(np.trace(hull.moments_about(center))) / 2
    if stated * SMALL_RATIO >= even or _is_none(stated, even):  # which has its own kind
        return None
    compact = 0.6 * mass * (3 * mass / (4 * np.pi * MAX_DENSITY)) ** (2 / 3)
    if stated >= compact:  # a dense part in a large cover
        return None
    ratio = even / stated
    what = f"{ratio:.2g} times less than at uniform density, and less than a ball of any metal"
    return _of_moments(facts, body, hull, "inertia too small", what, ratio / SMALL_RATIO)


def _is_none(stated: float, even: float) -> bool:
    """Return whether moments are zero up to rounding, compared with those at uniform density."""
    return stated <= NO_INERTIA_SHARE * even


def _of_moments(
    facts: RobotFacts,
    body: WeldedBody,
    hull: Hull,
    kind: PlausibilityKind,
    what: str,
    excess: float,
) -> Advice:
    mass, center, tensor = body.inertia
    stated = _moments(tensor)
    even = mass * _moments(hull.moments_about(center))
    return Advice(
        kind=kind,
        subject=(body.name,),
        message=f"{_named(body)} has moments of inertia {_vector(stated)} kg m^2, {what}; "
        f"expected about {_vector(even)}. Compute them about its center of mass, or check the "
        "places of its shapes",
        line=facts.inertial_line(body.name),
        expected=float(even[-1]),
        actual=float(stated[-1]),
        excess=excess,
    )


def swapped_axes(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Advice | None:
    """Return advice about moments that fit the shape along other axes."""
    mass, _, tensor = body.inertia
    even, axes = np.linalg.eigh(mass * hull.tensor)
    stated = np.diagonal(axes.T @ tensor @ axes)
    if even[2] < LONG_RATIO * even[0] or min(stated) <= 0:
        return None
    misfits = {order: _misfit(stated[list(order)], even) for order in permutations(range(3))}
    best = min(misfits, key=lambda order: misfits[order])
    if misfits[best] > FIT_RATIO or misfits[0, 1, 2] < SWAP_RATIO * misfits[best]:
        return None
    return Advice(
        kind="swapped axes",
        subject=(body.name,),
        message=f"the moments of inertia of {_named(body)} fit its shape with other axes: "
        f"along the shape's axes they are {_vector(stated)} kg m^2, expected about "
        f"{_vector(even)}. Check the rotation of its inertia",
        line=facts.inertial_line(body.name),
        expected=float(even[0]),
        actual=float(stated[0]),
        excess=misfits[0, 1, 2] / misfits[best] / SWAP_RATIO,
    )


def _misfit(stated: Array, even: Array) -> float:
    """Return the largest ratio between moments of both, in either direction."""
    return float(np.exp(np.abs(np.log(stated / even)).max()))


def mirrored_links(facts: RobotFacts) -> Iterator[Advice]:
    """Yield links on the left whose mass or moments differ from those on the right."""
    parts = {part.name: part for body in facts.bodies for part in body.parts}
    for name, part in parts.items():
        other = parts.get(_mirrored(name))
        if other is None or not (part.inertia.mass and other.inertia.mass):
            continue
        here, there = (_moments(one.inertia.inertia) for one in (part, other))
        heavy = _apart(np.array([part.inertia.mass]), np.array([other.inertia.mass]))
        turned = _apart(here, there)
        if heavy <= MIRROR_MASS and turned <= MIRROR_MOMENTS:
            continue
        pair = (part, other)
        if heavy > MIRROR_MASS:
            masses = [one.inertia.mass for one in pair]
            numbers = f"masses {masses[0]:.4g} and {masses[1]:.4g} kg"
        else:
            masses = [float(here[-1]), float(there[-1])]
            numbers = f"moments of inertia {_vector(here)} and {_vector(there)} kg m^2"
        yield Advice(
            kind="left and right",
            subject=(name, other.name),
            message=f"links {quote(name)} and {quote(other.name)} have {numbers}. Mirror one of "
            "them, unless the robot is asymmetric",
            line=facts.inertial_line(name),
            expected=masses[1],
            actual=masses[0],
            excess=max(heavy / MIRROR_MASS, turned / MIRROR_MOMENTS),
        )


def _apart(first: Array, other: Array) -> float:
    """Return the largest difference, relative to the largest number."""
    scale = max(np.abs(first).max(), np.abs(other).max())
    return float(np.abs(first - other).max() / scale) if scale else 0.0


def _mirrored(name: str) -> str:
    """Return the name of the same part on the other side, of a name that begins on the left.

    All words for sides change: the mirror image of `front_leftL` is `front_rightR`.
    """
    words = _WORDS.findall(name)
    first = next((word for word in words if word in _OTHER_SIDE), "")
    if first not in dict(_SIDES):
        return ""
    return "".join(_OTHER_SIDE.get(word, word) for word in words)


_HELD: Mapping[str, tuple[PlausibilityKind, str]] = {
    HELD: (
        "moving without inertia",
        "moves links without mass: engines hold it, refuse it, or invent a mass. Give a link an"
        " <inertial>, or fix the joint",
    ),
    LOCKED: (
        "damping ratio",
        "is locked by its damping or its spring, so it is held still. Lower it, or fix the joint",
    ),
}
"""Kind and message by the reason for which joints are held."""


def moving_without_inertia(facts: RobotFacts) -> Iterator[Advice]:
    """Yield joints that are held, and links that move with mass but without moments."""
    for omission in facts.robot.left_out:
        for name in omission.where if omission.what in _HELD else ():
            kind, message = _HELD[omission.what]
            line = facts.line("joint", name)
            yield Advice(
                kind=kind, subject=(name,), message=f"joint {quote(name)} {message}", line=line
            )
    for body in facts.bodies:
        if not (body.joint and body.shapes):
            continue
        tensor = SMALLEST_BALL if body.hull is None else body.hull.tensor
        even = body.inertia.mass * _moments(tensor)
        if _is_none(float(np.trace(body.inertia.inertia)), float(even.sum())):
            shape = "" if body.hull is None else f"; its shape has about {_vector(even)} kg m^2"
            yield Advice(
                kind="moving without inertia",
                subject=(body.name,),
                message=f"link {quote(body.name)} of {body.inertia.mass:.3g} kg moves and has no "
                f"moments of inertia{shape}. Write them",
                line=facts.inertial_line(body.name),
                expected=None if body.hull is None else float(even[-1]),
                actual=0.0,
            )


def rest_outside_limits(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the joints whose limits exclude the stated pose, in one finding.

    Other formats state no pose: their zero only fixes the frames, and knees often exclude it.
    """
    if facts.has_keyframes or facts.robot.file.suffix != COMPILED:
        return
    outside = {
        name: joint.limits
        for name, joint in facts.joints.items()
        if joint.single
        and joint.limits is not None
        and not joint.limits[0] <= joint.zero <= joint.limits[1]
    }
    if not outside:
        return
    ranges = [f"{name} [{low:.3g}, {high:.3g}]" for name, (low, high) in outside.items()]
    first, (low, high) = next(iter(outside.items()))
    rest = facts.rest[first]
    yield Advice(
        kind="rest outside limits",
        subject=tuple(outside),
        message=f"the pose as drawn is outside the limits of {listed(ranges, NAMED)}: engines that "
        "start there jump or are pushed. State an initial pose within the limits",
        line=facts.line("joint", first, "limit"),
        expected=low if rest < low else high,
        actual=rest,
        excess=float(len(outside)),
    )


def weak_drives(facts: RobotFacts) -> Iterator[Advice]:
    """Yield joints whose largest drive force is below the one that holds them as drawn."""
    weak = {
        name: (effort, abs(force), line)
        for name, force in facts.holding.items()
        if name in facts.efforts
        for effort, line in [facts.efforts[name]]
        if 0 < effort < abs(force)  # without an effort, the joint has no motor
    }
    for name, (effort, force, line) in weak.items():
        unit = "N m" if facts.joints[name].kind == "hinge" else "N"
        yield Advice(
            kind="weak drive",
            subject=(name,),
            message=f"the drive of joint {quote(name)} exerts at most {effort:.3g} {unit}, but "
            f"gravity as drawn takes {force:.3g} {unit}. Check its effort and the masses that it "
            "carries",
            line=line,
            expected=force,
            actual=effort,
            excess=force / effort,
        )


def negative_limits(facts: RobotFacts) -> Iterator[Advice]:
    """Yield efforts and velocities of a URDF's joints below zero."""
    for document in () if facts.robot.file.suffix == COMPILED else facts.documents:
        for joint in document.root.findall("joint"):
            name, limit = joint.get("name"), joint.find("limit") or joint
            for key in ("effort", "velocity"):
                for value in finite_numbers(limit.get(key)) or ():
                    if value < 0:
                        yield Advice(
                            kind="negative limit",
                            subject=(name, key),
                            message=f"the {key} of joint {quote(name)} is {value:g}: engines "
                            "refuse the file, or ignore the limit. Write a positive number",
                            line=SourceLine(file=str(document.path), line=document.line(limit)),
                            actual=value,
                        )


def repeated_elements(facts: RobotFacts) -> Iterator[Advice]:
    """Yield elements without effect, since engines that load the file take the one before."""
    for element in facts.robot.repeated:
        yield Advice(
            kind="repeated element",
            subject=(element.sentence,),
            message=f"{element.sentence}: engines take the first, or refuse the file. "
            "Keep one of them",
            line=SourceLine(file=str(element.file), line=element.line),
        )


def _named(body: WeldedBody) -> str:
    """Return the name of a body's heaviest link, and how many links are welded to it."""
    others = len(body.parts) - 1
    welded = f" with {counted(others, 'welded link')}" if others else ""
    return f"link {quote(body.name)}{welded}"


def _in_link(body: WeldedBody, point: Array) -> Array:
    """Return a point of the body's frame in the frame of its heaviest link."""
    frame = body.frames[body.name]
    moved: Array = frame.rotation.T @ (point - frame.origin)
    return moved


def _moments(tensor: Array) -> Array:
    """Return the principal moments of inertia, ascending, (3,)."""
    moments: Array = np.linalg.eigvalsh(tensor).astype(np.float64)
    return moments


def _vector(values: Array) -> str:
    return " ".join(f"{value + 0.0:.3g}" for value in np.round(values, 12).tolist())


def damping_ratios(facts: RobotFacts) -> Iterator[Advice]:
    """Yield position drives that oscillate for long or creep, with all other joints held."""
    for joint, (hertz, ratio, band) in _oscillators(facts).items():
        lag = ratio / (np.pi * hertz)
        if ratio >= MIN_RATIO and (ratio <= MAX_RATIO or lag <= MAX_LAG_SECONDS):
            continue
        if ratio < 1 and STOPPED_BANDS * band >= _amplitude(facts, joint):
            continue
        slow = f"takes {lag:.2g} s for two thirds of the way to its target"
        what = "oscillates for many periods" if ratio < 1 else slow
        yield Advice(
            kind="damping ratio",
            subject=(joint,),
            message=f"the position drive of joint {quote(joint)} has the damping ratio {ratio:.2g}"
            f" and {what}; 1 is critical. Choose kv and the joint's damping for a ratio near 1",
            line=facts.drive_line(joint),
            expected=1.0,
            actual=ratio,
            excess=MIN_RATIO / max(ratio, 1e-9) if ratio < 1 else ratio / MAX_RATIO,
        )


def _amplitude(facts: RobotFacts, joint: str) -> float:
    """Return half the range of a joint, or 0.5 without limits, rad or m."""
    bodies = () if facts.compiled is None else facts.compiled.bodies
    limits = [one.limits for body in bodies for one in body.joints if one.name == joint]
    return next(((high - low) / 2 for low, high in filter(None, limits)), 0.5)


def _oscillators(facts: RobotFacts) -> Mapping[str, tuple[float, float, float]]:
    """Return natural frequency, Hz, damping ratio and dead band of position drives, by joint."""
    values: dict[str, dict[str, float]] = {}
    for row in () if facts.compiled is None else acting_quantities(facts.compiled):
        joint = row.subject.removeprefix("drive of ")
        if joint != row.subject and row.value is not None:
            values.setdefault(joint, {})[row.quantity] = row.value
    keys = ("natural frequency", "damping ratio")
    return {
        joint: (rows[keys[0]], rows[keys[1]], rows.get("dead band", 0.0))
        for joint, rows in values.items()
        if rows.get(keys[0], 0.0) > 0 and keys[1] in rows
    }


BODY_KINDS: tuple[BodyJudge, ...] = (
    mesh_in_millimetres,
    inertia_too_large,
    center_outside,
    implausible_density,
    inertia_too_small,
    swapped_axes,
)
"""Functions that compare a body with its shapes, most certain first."""

KINDS: tuple[Callable[[RobotFacts], Iterator[Advice]], ...] = (
    equal_inertias,
    unlike_shapes,
    mirrored_links,
    moving_without_inertia,
    rest_outside_limits,
    weak_drives,
    damping_ratios,
    negative_limits,
    repeated_elements,
)
"""Functions that yield advice about a file."""


def advise(facts: RobotFacts) -> tuple[Advice, ...]:
    """Return all advice about a file: by kind, the worst first in each."""
    advice = [one for judge in KINDS for one in judge(facts)]
    return tuple(sorted(advice, key=lambda one: (_ORDER.index(one.kind), -one.excess)))


_ORDER: tuple[PlausibilityKind, ...] = get_args(PlausibilityKind)
