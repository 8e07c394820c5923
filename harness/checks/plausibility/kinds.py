"""One function for each kind of advice, and the table of all.

Thresholds are chosen on the robots of `campaigns.plausibility`; `docs/plausibility.md` has the
counts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, islice, permutations
from typing import get_args

import numpy as np

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.modelfiles.mesh_files import unread_meshes
from physics_crosscheck.harness.modelfiles.robot import HELD, LOCKED, LinkPart, Robot
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding, PlausibilityKind
from physics_crosscheck.harness.results.status import counted, listed, unread_words
from physics_crosscheck.reference.mechanism.rotations import Array
from ..acting import acting_quantities
from ..findings import finding
from .assembly import open_loops, overlapping_links
from .facts import (
    COMPILED,
    Advice,
    RobotFacts,
    WeldedBody,
    line_of,
    moments,
    stated_number,
    stated_parts,
    vector_text,
)
from .hull import Hull, uniform
from .mirror import mirrored_parts
from .usd import stage_advice

NAMED = 3
"""Most links or joints that a message names."""

MIN_EQUAL, UNLIKE, NEGLIGIBLE_SHARE = 3, 1.5, 0.02
"""Fewest links with one tensor that make a placeholder; ratio of masses or sizes from which these
differ; share of a body's mass below which the inertia of one of its links does not matter."""

MIN_OUTSIDE, OUTSIDE_SHARE = 0.005, 0.1
"""Smallest distance of a center of mass from the hull, m, and as a share of its diagonal."""

MAX_DENSITY = 22600.0
"""Density of osmium, the densest metal, kg/m^3; a hull has at least the volume of its body."""

MIN_DENSITY, MIN_SKIN = 3.0, 0.005
"""Density of a hull below that of foam, kg/m^3; mass per area of half a balloon's, kg/m^2."""

MARKER_MASS, MILLIMETRES = 1e-6, 10.0
"""Mass of a body that only marks a place, kg; smallest diagonal of a link in millimetres, m."""

FAR_RATIO, SMALL_RATIO, NO_INERTIA_SHARE = 1.5, 100.0, 1e-9
"""Ratio of an inertia to that of all mass at the farthest point, from which it is impossible; of
the inertia at uniform density to one that is too small; and of one that counts as none to it."""

LONG_RATIO, FIT_RATIO, SWAP_RATIO = 4.0, 2.5, 4.0
"""Ratio of a long shape's moments; misfit of swapped axes, and how much better it must be."""

MIN_RATIO, MAX_RATIO, MAX_LAG_SECONDS = 0.05, 10.0, 0.5
"""Damping ratios of drives that oscillate for long, and that may creep, and the longest time
constant of one that does not."""

STOPPED_BANDS = 12
"""Dead bands of dry friction in an amplitude that ends within three periods: two a half period."""

EXACT, ODD_RATIO = 0.01, 1.5
"""Relative difference of moments that are computed from a shape; ratio of one that is not."""

MIN_EXTENT, BEYOND = 0.01, 4.0
"""Smallest size of a robot to which radii of gyration are compared, m; links reach beyond it."""

CAD_DENSITIES = {1000.0: "the default of CAD programs", 7850.0: "solid steel"}
"""Densities in kg/m^3 that are assumed for whole robots."""

DENSITY_SHARE, ALUMINIUM = 0.02, 2700.0
"""Relative difference from these, and the density of aluminium, kg/m^3."""

TURNS, MAX_DEGREES, FAST = 4.04 * np.pi, 720.0, 60.0
"""Largest limit of a hinge in rad, largest in degrees, and speed beyond that of motors, rad/s."""

FAR_TRAVEL = 50.0
"""Range of a slide between massive links, in extents of the robot, that is in millimetres."""

SMALLEST_BALL = 4e-7 * np.eye(3)
"""Moments per kg of a ball of 1 mm radius, m^2, for links whose shapes can't be read."""


def equal_inertias(facts: RobotFacts) -> Iterator[Advice]:
    """Yield groups of unlike links with one tensor."""
    alike: dict[tuple[float, ...], list[LinkPart]] = {}
    for link, body in facts.body_of.items():
        part = facts.part(link)
        is_heavy = part.inertia.mass > NEGLIGIBLE_SHARE * body.inertia.mass
        even = _by_shape(part, body)
        fits = even is not None and _misfit(moments(part.inertia.inertia), even) < FIT_RATIO
        if is_heavy and any(part.link.inertia) and not fits:
            alike.setdefault(part.link.inertia, []).append(part)
    for tensor, parts in alike.items():
        need = 2 if _is_round(tensor) else MIN_EQUAL
        if len(parts) < need or not _differ(facts, parts):
            continue
        parts.sort(key=lambda one: one.inertia.mass)
        names = [part.name for part in parts]
        even = _by_shape(parts[0], facts.body_of[names[0]])
        largest = None if even is None else float(even[-1])
        hint = "" if largest is None else f"; by shape {quote(names[0])} has {largest:.2g}"
        yield facts.advice(
            "equal inertias",
            tuple(names),
            f"{len(names)} unlike links of {parts[0].inertia.mass:.3g} to "
            f"{parts[-1].inertia.mass:.3g} kg share the moments of inertia "
            f"{' '.join(f'{value:g}' for value in tensor[:3])} kg m^2: {listed(names, NAMED)}{hint}"
            ". Compute those of each link",
            largest,
            tensor[0],
            len(names),
        )


def _is_round(tensor: Sequence[float]) -> bool:
    """Return whether three equal moments have one digit, and there are no products."""
    xx, yy, zz, *products = tensor
    return xx == yy == zz and not any(products) and float(f"{xx:.0e}") == xx


def _differ(facts: RobotFacts, parts: Sequence[LinkPart]) -> bool:
    """Return whether the masses or the shapes of links differ."""
    masses = [part.inertia.mass for part in parts]
    bodies = [facts.body_of[part.name] for part in parts]
    hulls = [body.hull for body in bodies if len(body.parts) == 1]
    sizes = [hull.volume for hull in hulls if hull is not None] or [1.0]
    return max(masses) > UNLIKE * min(masses) or max(sizes) > UNLIKE**3 * min(sizes)


def _by_shape(part: LinkPart, body: WeldedBody) -> Array | None:
    """Return a link's principal moments of inertia at uniform density, kg m^2, (3,)."""
    if body.hull is None or len(body.parts) > 1:
        return None
    return part.inertia.mass * moments(body.hull.moments_about(body.inertia.center))


def unlike_shapes(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the most certain advice about each body with shapes."""
    for body in facts.bodies:
        solids = (one for part in body.parts for one in _unlike_solid(facts, body, part))
        beyond = (one for part in body.parts for one in _beyond_robot(facts, part))
        yield from islice(chain(solids, _by_hulls(facts, body), beyond), 1)


def _by_hulls(facts: RobotFacts, body: WeldedBody) -> Iterator[Advice]:
    """Judge a body by the shapes that collide, then by all: these are often more precise."""
    # The hull is unknown if a shape can't be read, and may be larger.
    if body.hull is None or body.whole_hull is None:
        return
    first, advice = (
        [one for judge in _BY_HULL for one in judge(facts, body, hull)]
        for hull in (body.hull, body.whole_hull)
    )
    kinds = {one[1].kind for one in first}
    advice.sort(key=lambda one: _ORDER.index(one[1].kind))
    yield from (one for one in advice if one[1].kind in kinds)


def _unlike_solid(facts: RobotFacts, body: WeldedBody, part: LinkPart) -> Iterator[Advice]:
    """Yield a link with the moments of its only shape, but not about its axes."""
    solids = body.solids(part.name)
    mass, tensor = part.inertia.mass, part.inertia.inertia
    if len(solids) != 1 or mass <= 0:
        return
    axes = solids[0].place.rotation
    even, stated = mass * uniform(solids[0].kind, solids[0].size)[1], axes.T @ tensor @ axes
    here = np.diagonal(stated)
    is_even = np.abs(here - even) <= EXACT * even
    is_turned = np.abs(stated - np.diag(here)).max() > EXACT * even.max()
    if is_even.all() or is_turned or min(here) <= 0:
        return
    worst = int(np.argmax(np.abs(np.log(here / even))))
    is_swapped = bool((np.abs(np.sort(here) - np.sort(even)) <= EXACT * np.sort(even)).all())
    misfit = _misfit(here, even)
    if not (is_swapped or (is_even.sum() == 2 and misfit > ODD_RATIO)):
        return
    what = "those of its shape, but along other axes" if is_swapped else "two of them as its shape"
    message = (
        f"link {quote(part.name)} has the moments of inertia {vector_text(here)} kg m^2 "
        f"along the axes of its {solids[0].kind}, {what}; expected {vector_text(even)}. Check the "
        "rotation of its inertia, and its digits"
    )
    kind: PlausibilityKind = "swapped axes" if is_swapped else "odd moment"
    yield facts.advice(kind, part.name, message, even[worst], here[worst], misfit)


def _beyond_robot(facts: RobotFacts, part: LinkPart) -> Iterator[Advice]:
    """Yield a link with a radius of gyration, or a center, that is larger than the robot."""
    mass, extent, turned = part.inertia.mass, facts.extent, np.trace(part.inertia.inertia) / 2
    far, limit = float(np.linalg.norm(part.inertia.center)), 10 * BEYOND * extent
    if mass > 0 and extent >= MIN_EXTENT and far > limit:
        message = (
            f"the center of mass of link {quote(part.name)} is {far:.3g} m from its frame in a "
            f"robot of {extent:.3g} m. Check the unit of the origin of its inertia"
        )
        yield facts.advice("center outside", part.name, message, extent, far, far / limit)
    if mass <= 0 or extent < MIN_EXTENT or turned <= mass * (BEYOND * extent) ** 2:
        return
    limit = mass * extent**2
    message = (
        f"link {quote(part.name)} of {mass:.3g} kg has moments of inertia "
        f"{vector_text(moments(part.inertia.inertia))} kg m^2, a radius of gyration of "
        f"{np.sqrt(turned / mass):.3g} m in a robot of {extent:.3g} m; expected less than "
        f"{limit:.2g}. Check its units"
    )
    yield facts.advice("inertia too large", part.name, message, limit, turned, turned / limit)


def one_density(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the one density of all links of a robot, if a program for drawings assumes it."""
    rows = [
        (part, sum(uniform(one.kind, one.size)[0] for one in body.solids(part.name)))
        for body in facts.bodies
        for part in body.parts
        if part.inertia.mass > 0
    ]
    is_by_density = facts.is_compiled and "stated" not in facts.mass_sources.values()
    if is_by_density or len(rows) < 2 or not all(volume for _, volume in rows):
        return
    densities = np.array([part.inertia.mass / volume for part, volume in rows])
    for density, what in CAD_DENSITIES.items():
        if np.abs(densities / density - 1).max() > DENSITY_SHARE:
            continue
        part, volume = max(rows, key=lambda row: row[1])
        message = (
            f"all {len(rows)} links have {density:g} kg/m^3 in their shapes, {what}; as "
            f"solid aluminium {quote(part.name)} has {ALUMINIUM * volume:.3g} kg instead of "
            f"{part.inertia.mass:.3g}. Weigh the links"
        )
        names, line = tuple(one.name for one, _ in rows), facts.inertial_line(part.name)
        yield facts.advice(
            "one density", names, message, ALUMINIUM * volume, part.inertia.mass, line=line
        )


def default_density(facts: RobotFacts) -> Iterator[Advice]:
    """Yield links with a mass by the default density, where most others state theirs.

    A tree of one link is excluded: a ball beside a robot is what its shapes are.
    """
    sources, parts = facts.mass_sources, [part for body in facts.bodies for part in body.parts]
    sizes = Counter(facts.tree_of(part.body) for part in parts)
    count = sum(sources.get(part.name) == "stated" for part in parts)
    parts = [one for one in parts if sources.get(one.name) == "default" and one.inertia.mass]
    parts = [one for one in parts if one.body < 0 or sizes[facts.tree_of(one.body)] > 1]
    for part in parts if count > len(parts) else ():
        name, mass, line = part.name, part.inertia.mass, facts.line("body", part.name, "geom")
        message = (
            f"link {quote(name)} has {mass:.3g} kg by the default density"
            f" of its shapes, while {counted(count, 'link')} state their masses. Write its mass, "
            'or mass="0" if another link counts it'
        )
        expected = None if part.link.joints else 0.0
        yield facts.advice("default density", name, message, expected, mass, line=line)


def limits_in_degrees(facts: RobotFacts) -> Iterator[Advice]:
    """Yield ranges and speeds of hinges that are degrees, or degrees that are radians."""
    small = dict(_radians(facts))
    for name, joint in facts.joints.items():
        limits = joint.limits if joint.kind == "hinge" else None
        if limits is None or name in [*small][1:]:
            continue
        largest = max(map(abs, limits))
        speed = facts.joint_numbers.get(name, {}).get("velocity", 0.0)
        is_round = float(f"{speed:.0e}") == speed and f"{speed:e}".startswith("1")
        quantity, actual, expected = "range", largest, float(np.radians(largest))
        if TURNS < largest <= MAX_DEGREES:
            low, high = np.radians(limits)
            what = f"limits of {limits[0]:g} and {limits[1]:g} rad, more than two turns: as degrees"
            what += f" they are {low:.3g} and {high:.3g} rad. Write radians"
        elif name in small:
            expected = small[name]
            what = f"a range of {small[name]:g} degrees, {largest:.2g} rad: it is written as "
            what += f"{small[name]:g}, like radians, as in {counted(len(small), 'joint')} of this "
            what += 'file. Write degrees, or angle="radian"'
        elif FAST < speed <= MAX_DEGREES and not is_round:
            quantity, actual, expected = "velocity", speed, float(np.radians(speed))
            what = f"a largest speed of {speed:g} rad/s, {speed / 2 / np.pi:.2g} turns a second: as"
            what += f" degrees it is {expected:.3g} rad/s. Check its unit"
        else:
            continue
        message, line = f"joint {quote(name)} has {what}", facts.line("joint", name, "limit")
        yield facts.advice(
            "implausible limit", (name, quantity), message, expected, actual, actual / expected,
            line=line,
        )  # fmt: skip


def travel_in_millimetres(facts: RobotFacts) -> Iterator[Advice]:
    """Yield ranges of slides between links with mass that are far longer than the robot."""
    extent, massive = facts.extent, {one.name for one in facts.robot.parts if one.inertia.mass}
    for link in facts.links:
        for joint in link.joints if link.parent in massive else ():
            if joint.kind != "slide" or joint.limits is None:
                continue
            low, high = joint.limits
            in_metres = 1e-3 * (high - low)
            if FAR_TRAVEL * extent < high - low and in_metres < extent:
                message = f"joint {quote(joint.name)} has limits of {low:g} and {high:g} m in a"
                message += f" robot of {extent:.2g} m: as millimetres they fit. Write metres"
                yield facts.advice(
                    "implausible limit", (joint.name, "range"), message, in_metres, high - low,
                    1e3, line=facts.line("joint", joint.name, "limit"),
                )  # fmt: skip


def _radians(facts: RobotFacts) -> Iterator[tuple[str, float]]:
    """Yield joints of a file in degrees that states their largest limits like radians."""
    compilers = (one for root in facts.roots for one in root.findall("compiler"))
    is_radian = any(one.get("angle") == "radian" for one in compilers)
    if facts.robot.file.suffix != COMPILED or is_radian:
        return
    ranges = {
        joint.get("name"): max(map(abs, values))
        for root in facts.roots
        for joint in root.iter("joint")
        if joint.get("type", "hinge") == "hinge" and (values := finite_numbers(joint.get("range")))
    }
    parts = [value / (np.pi / 12) for value in ranges.values()]
    is_like_radians = any(part > 1 and abs(part - round(part)) < 0.003 * part for part in parts)
    if is_like_radians and max(ranges.values()) <= 2 * np.pi + 0.01:
        yield from ranges.items()


def mesh_in_millimetres(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Iterator[Advice]:
    """Yield a mesh whose coordinates are millimetres."""
    density = body.inertia.mass / hull.volume
    if not body.has_mesh or hull.diagonal < MILLIMETRES or density > MIN_DENSITY / 100:
        return
    mesh = next(shape for shape in body.shapes if shape.kind == "mesh")
    file, line = mesh.size_place or (mesh.file, mesh.line)
    message = (
        f"{body.link} of {body.inertia.mass:.3g} kg is {hull.diagonal:.3g} m "
        f"long, {density:.1g} kg/m^3: its mesh is in millimetres. Scale it by 0.001"
    )
    place = SourceLine(file=str(file), line=line or None)
    excess = MIN_DENSITY / density
    yield facts.advice("mesh unit", body.name, message, 0.001, 1.0, excess, line=place)


def center_outside(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Iterator[Advice]:
    """Yield a center of mass outside the shapes."""
    distance = hull.outside(body.inertia.center)
    limit = max(MIN_OUTSIDE, OUTSIDE_SHARE * hull.diagonal)
    if distance > limit:
        frame = body.frames[body.name]
        middle, unit = frame.rotation.T @ (hull.center - frame.origin), 1e-4 * hull.diagonal
        message = (
            f"the center of mass of {body.link} is {1e3 * distance:.3g} mm outside its "
            f"shapes of {1e3 * hull.diagonal:.3g} mm; their middle is at "
            f"{vector_text(np.round(middle / unit) * unit)}. Check the origin of its inertia, "
            "and the places of its shapes"
        )
        yield facts.advice("center outside", body.name, message, 0.0, distance, distance / limit)


def implausible_density(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Iterator[Advice]:
    """Yield a mass that the volume of the shapes excludes."""
    mass, usual = body.inertia.mass, 1000.0 * hull.volume
    density = mass / hull.volume
    is_marker = mass < MARKER_MASS and facts.mass_sources.get(body.name) != "density"
    is_heavy = density > MAX_DENSITY
    is_light = density < MIN_DENSITY and mass < MIN_SKIN * hull.area
    if (is_heavy or is_light) and not is_marker:
        what = "more than any metal" if is_heavy else "less than a balloon"
        message = (
            f"{body.link} has {mass:.3g} kg in {hull.volume:.2g} m^3, "
            f"{density:.2g} kg/m^3, which is {what}; as water "
            f"it has {usual:.2g} kg. Check its mass and the size of its shapes"
        )
        excess = density / MAX_DENSITY if is_heavy else MIN_DENSITY / density
        yield facts.advice("density", body.name, message, usual, mass, excess)


def implausible_moments(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Iterator[Advice]:
    """Yield moments that no mass within the shapes has, or only one that is nearly a point."""
    mass, center, tensor = body.inertia
    stated, even = moments(tensor), mass * moments(hull.moments_about(center))
    size, usual = float(stated.sum()) / 2, float(even.sum()) / 2
    compact = 0.6 * mass * (3 * mass / (4 * np.pi * MAX_DENSITY)) ** (2 / 3)  # in a large cover
    excess = size / (mass * hull.farthest(center) ** 2)
    kind: PlausibilityKind = "inertia too large"
    what = "impossible within its shapes"
    if excess <= FAR_RATIO:
        # Moments that are none have their own kind.
        if not NO_INERTIA_SHARE * usual < size < min(usual / SMALL_RATIO, compact):
            return
        kind, excess = "inertia too small", usual / size / SMALL_RATIO
        what = f"{usual / size:.2g} times less than at uniform density, and less than a ball of any"
        what += " metal"
    message = (
        f"{body.link} has moments of inertia {vector_text(stated)} kg m^2, {what}; "
        f"expected about {vector_text(even)}. Compute them about its center of mass, or check the "
        "places of its shapes"
    )
    yield facts.advice(kind, body.name, message, even[-1], stated[-1], excess)


def swapped_axes(facts: RobotFacts, body: WeldedBody, hull: Hull) -> Iterator[Advice]:
    """Yield moments that fit the shape along other axes."""
    mass, _, tensor = body.inertia
    even, axes = np.linalg.eigh(mass * hull.tensor)
    stated = np.diagonal(axes.T @ tensor @ axes)
    if even[2] < LONG_RATIO * even[0] or min(stated) <= 0:
        return
    misfit = _misfit(stated, even)
    best = min(_misfit(stated[list(order)], even) for order in permutations(range(3)))
    if best <= FIT_RATIO and misfit >= SWAP_RATIO * best:
        message = (
            f"the moments of inertia of {body.link} fit its shape with other axes: "
            f"along the shape's axes they are {vector_text(stated)} kg m^2, expected about "
            f"{vector_text(even)}. Check the rotation of its inertia"
        )
        excess = misfit / best / SWAP_RATIO
        yield facts.advice("swapped axes", body.name, message, even[0], stated[0], excess)


def _misfit(stated: Array, even: Array) -> float:
    """Return the largest ratio between moments of both, in either direction."""
    return float(np.exp(np.abs(np.log(stated / even)).max()))


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
            yield facts.advice(kind, name, f"joint {quote(name)} {message}", line=line)
    for body in facts.bodies:
        mass, hull = body.inertia.mass, body.hull
        even = mass * moments(SMALLEST_BALL if hull is None else hull.tensor)
        is_none = np.trace(body.inertia.inertia) <= NO_INERTIA_SHARE * even.sum()
        if body.joint and body.shapes and is_none:
            shape = "" if hull is None else f"; its shape has about {vector_text(even)} kg m^2"
            message = f"link {quote(body.name)} of {mass:.3g} kg moves and has no moments of "
            message += f"inertia{shape}. Write them"
            expected = None if hull is None else float(even[-1])
            yield facts.advice("moving without inertia", body.name, message, expected, 0.0)


def rest_outside_limits(facts: RobotFacts) -> Iterator[Advice]:
    """Yield the joints whose limits exclude the stated pose, in one finding.

    Other formats state no pose: their zero only fixes the frames, and knees often exclude it.
    """
    has_keyframes = any(root.find("keyframe/key") for root in facts.roots)
    if has_keyframes or facts.robot.file.suffix != COMPILED:
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
    message = (
        f"the pose as drawn is outside the limits of {listed(ranges, NAMED)}: engines that "
        "start there jump or are pushed. State an initial pose within the limits"
    )
    rest, line = facts.rest[first], facts.line("joint", first, "limit")
    yield facts.advice(
        "rest outside limits", tuple(outside), message, low if rest < low else high, rest,
        len(outside), line=line,
    )  # fmt: skip


def weak_drives(facts: RobotFacts) -> Iterator[Advice]:
    """Yield joints whose largest drive force is below the one that holds them as drawn."""
    for name, held in facts.holding.items():
        effort, force = facts.joint_numbers.get(name, {}).get("effort", 0.0), abs(held)
        if 0 < effort < force:  # without an effort, the joint has no motor
            unit = "N m" if facts.joints[name].kind == "hinge" else "N"
            message = (
                f"the drive of joint {quote(name)} exerts at most {effort:.3g} {unit}, but "
                f"gravity as drawn takes {force:.3g} {unit}. Check its effort and the masses that "
                "it carries"
            )
            line, excess = facts.line("joint", name, "limit"), force / effort
            yield facts.advice("weak drive", name, message, force, effort, excess, line=line)


def negative_limits(facts: RobotFacts) -> Iterator[Advice]:
    """Yield efforts and velocities of a URDF's joints below zero, and ranges without a position."""
    for joint, limit in stated_parts(facts, "limit"):
        name, line = joint.get("name"), line_of(limit)
        low, high = stated_number(limit, "lower") or 0.0, stated_number(limit, "upper") or 0.0
        if low > high and joint.get("type") in ("revolute", "prismatic"):
            message = (
                f"the lower limit of joint {quote(name)} is {low:g}, above the upper "
                f"one, {high:g}: engines ignore the range, or refuse the file. "
                "Exchange them, or remove both"
            )
            yield facts.advice("implausible limit", (name, "range"), message, high, low, line=line)
        for key in ("effort", "velocity") if joint.parent in facts.roots else ():
            value = stated_number(limit, key) or 0.0
            if value < 0:
                message = f"the {key} of joint {quote(name)} is {value:g}: engines "
                message += "refuse the file, or ignore the limit. Write a positive number"
                yield facts.advice("negative limit", (name, key), message, None, value, line=line)


def repeated_elements(facts: RobotFacts) -> Iterator[Advice]:
    """Yield elements without effect, since engines that load the file take the one before."""
    for element in facts.robot.repeated:
        what = f"{element.sentence}: engines take the first, or refuse the file. Keep one of them"
        line = SourceLine(file=str(element.file), line=element.line)
        yield facts.advice("repeated element", element.sentence, what, line=line)


def damping_ratios(facts: RobotFacts) -> Iterator[Advice]:
    """Yield position drives that oscillate for long or creep, with all other joints held."""
    values: dict[str, dict[str, float]] = {}
    for row in () if facts.compiled is None else acting_quantities(facts.compiled):
        if row.subject.startswith("drive of ") and row.value is not None:
            joint = row.subject.removeprefix("drive of ")
            values.setdefault(joint, {})[row.quantity] = row.value
    for joint, rows in values.items():
        hertz, ratio = rows.get("natural frequency", 0.0), rows.get("damping ratio")
        if hertz <= 0 or ratio is None:
            continue
        lag = ratio / (np.pi * hertz)
        if ratio >= MIN_RATIO and (ratio <= MAX_RATIO or lag <= MAX_LAG_SECONDS):
            continue
        low, high = (joint in facts.joints and facts.joints[joint].limits) or (-0.5, 0.5)
        if ratio < 1 and STOPPED_BANDS * rows.get("dead band", 0.0) >= (high - low) / 2:
            continue
        slow = f"takes {lag:.2g} s for two thirds of the way to its target"
        what = "oscillates for many periods" if ratio < 1 else slow
        message = (
            f"the position drive of joint {quote(joint)} has the damping ratio {ratio:.2g}"
            f" and {what}; 1 is critical. Choose kv and the joint's damping for a ratio near 1"
        )
        excess = MIN_RATIO / max(ratio, 1e-9) if ratio < 1 else ratio / MAX_RATIO
        drives = (drive for root in facts.roots for drive in root.findall("actuator/*"))
        lines = (line_of(drive) for drive in drives if drive.get("joint") == joint)
        line = next(lines, None) or facts.line("joint", joint)
        yield facts.advice("damping ratio", joint, message, 1.0, ratio, excess, line=line)


_BY_HULL = (
    mesh_in_millimetres,
    center_outside,
    implausible_density,
    implausible_moments,
    swapped_axes,
)
"""Functions that compare a body with a hull of its shapes."""

KINDS: tuple[Callable[[RobotFacts], Iterator[Advice]], ...] = (
    equal_inertias,
    unlike_shapes,
    mirrored_parts,
    moving_without_inertia,
    rest_outside_limits,
    one_density,
    default_density,
    limits_in_degrees,
    travel_in_millimetres,
    weak_drives,
    damping_ratios,
    negative_limits,
    repeated_elements,
    open_loops,
    overlapping_links,
)
"""Functions that yield advice about a file."""

_ORDER: tuple[str, ...] = get_args(PlausibilityKind)


def plausibility_findings(robot: Robot) -> tuple[AuditFinding, ...]:
    """Return advice about a file with a tree, by kind and the worst first, and a note on meshes."""
    if robot.tree is None or has_stand_ins(robot.file):
        return ()
    facts = RobotFacts(robot, robot.tree)
    with np.errstate(all="ignore"):  # bodies whose numbers overflow have no advice
        advice = [one for judge in KINDS for one in judge(facts)]
        if facts.stage is not None:
            advice += stage_advice(facts.stage)
    advice.sort(key=lambda one: (_ORDER.index(one[1].kind), -one[0]))
    return (*(finding for _, finding in advice), *_uncompared(facts))


def _uncompared(facts: RobotFacts) -> Iterator[AuditFinding]:
    """Yield a note if the hull of a body with meshes is unknown."""
    bodies = [body for body in facts.bodies if body.has_mesh and body.hull is None]
    if not bodies:
        return
    unread = unread_meshes(shape for body in bodies for shape in body.shapes)
    why = unread_words(unread) or "some have no volume, or axes that some programs turn"
    message = f"meshes are not compared with masses and inertias: {why}"
    yield finding("unresolved", ("meshes",), message, severity="note")
