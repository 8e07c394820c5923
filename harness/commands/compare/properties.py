"""Differences between the contents of two files: bodies, joints, actuators, gravity, omissions.

They are read from the files, without a motion. Masses and axes affect the equations; limits,
some actuators and shapes do not affect the compared motions.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from pathlib import Path

import numpy as np
from msgspec import structs

from physics_crosscheck.harness.documents.reading import FLOAT_DIGITS, USD_SUFFIXES
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.modelfiles.robot import LinkPart
from physics_crosscheck.harness.records.comparison import ComparedProperty
from physics_crosscheck.reference.mechanism.bodies import RigidBody, powers
from physics_crosscheck.reference.mechanism.rotations import NO_INERTIA, Place, SpatialInertia
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.segments import Segments
from .actuators import actuator_properties
from .alignment import (
    SAME,
    Aligned,
    PlacedTree,
    aligned,
    angle_of,
    paired_links,
    turned_about,
    with_joint,
    with_link,
)
from .candidate import Candidate, Facts, ask
from .judge import weighed
from .match import JointPair, joints_of, pairs_of
from .prepared import PreparedComparison
from .side import (
    Difference,
    ModelSide,
    apart,
    lines_of,
    make_property,
    model_side,
    shown,
    values_shown,
)
from .stated import stated_properties

MAX_TURNED = 1.0
"""Angle between two lines above which neither direction of an axis is that of the other, rad."""

ROUNDING = 1e-13
"""Rounding error of a tensor transformed between frames, in units of m r^2."""


def properties(
    a: ModelSide, b: ModelSide, pairs: Sequence[JointPair]
) -> tuple[list[Difference], tuple[str, ...]]:
    """Compare two files; also return joints whose axis direction in B contradicts the pairing."""
    by_name = _joint_pairs(a.placed, b.placed, pairs)
    names = [(pair.a, pair.b) for pair in by_name.values()]
    links, odd = paired_links(a.placed, b.placed, names)
    rows = aligned(a.placed, b.placed, links)
    size = max(a.placed.size, b.placed.size)
    differences = [
        make_property("kind", name, f"joint {name}: {here} in A, {there} in B")
        for name, here, there in odd
    ]
    turned = []
    for row in rows:
        pair = by_name[a.tree.links[row.a].name]
        single = a.tree.links[row.a].kind in ("hinge", "slide")
        if single and row.angle < MAX_TURNED and row.opposite != (pair.slope < 0):
            turned.append(pair.a)
        differences += _joint(a, b, row, pair, size)
        differences += _body_properties(a, b, row, size)
    differences += _gravity(a, b)
    differences += [*_ranges(a, b, rows, by_name), *_tendons(a, b)]
    if a.facts.compiled is not None and b.facts.compiled is not None:
        acting = any(side.facts.robot and side.facts.robot.controls for side in (a, b))
        of_a, of_b = a.facts.actuators, b.facts.actuators
        differences += actuator_properties(of_a, of_b, dict(names), bool(acting))
    return [*differences, *stated_properties(a, b, rows, by_name)], tuple(turned)


def _joint_pairs(
    placed_a: PlacedTree, placed_b: PlacedTree, pairs: Sequence[JointPair]
) -> dict[str, JointPair]:
    """Return pairs of joints, from pairs of coordinates, by the names of A's.

    Coordinates of a ball and a free joint are paired in order, unchanged.
    """
    straight = {pair.a: pair.b for pair in pairs if (pair.slope, pair.offset) == (1.0, 0.0)}
    by_name = {
        name: JointPair(a=name, b=its, slope=1.0, offset=0.0)
        for name, its in joints_of(straight, placed_a, placed_b).items()
    }
    single = (pair for pair in pairs if pair.a in placed_a.index and pair.b in placed_b.index)
    return by_name | {pair.a: pair for pair in single}


def _joint(
    a: ModelSide, b: ModelSide, row: Aligned, pair: JointPair, size: float
) -> Iterator[Difference]:
    link_a, link_b = a.tree.links[row.a], b.tree.links[row.b]
    differences: list[Difference] = []
    if link_a.kind in ("hinge", "slide"):
        differences += _geometry(a, b, row, pair, size)
    if abs(abs(pair.slope) - 1) <= SAME:
        differences += _forces(a, b, row, pair)
    if not differences:
        return
    names = link_a.name, link_b.name
    for difference, changed in differences:
        where_a, where_b = lines_of(a, b, difference.kind, names)
        yield structs.replace(difference, where_a=where_a, where_b=where_b), changed


def _geometry(
    a: ModelSide, b: ModelSide, row: Aligned, pair: JointPair, size: float
) -> Iterator[Difference]:
    link = a.tree.links[row.a]
    name, u, point = link.name, a.placed.axes[row.a], a.placed.anchors[row.a]
    if row.angle > SAME:
        sign = -1.0 if row.opposite else 1.0  # in the direction of A's
        both = a.placed.axes[row.a], sign * b.placed.axes[row.b]
        here, there = (_digits(np.round(one, 12) + 0.0, row.angle) for one in both)
        message = f"axis of joint {name}: ({here}) in A, ({there}) in B, in the world"
        message += f", {row.angle:.3g} rad apart"
        across = np.cross(u, row.axis)
        motion = turned_about(point, across / np.linalg.norm(across), row.angle)
        changed = with_joint(a.placed, row.a, motion)
        if row.axis_only:
            inward = a.placed.frames[row.a].rotation.T
            changed = with_link(a.tree, row.a, axis=inward @ row.axis)
        yield make_property("axis", name, message, relative=row.angle, changed=changed)
    if row.apart > SAME * size:
        message = f"place of joint {name}: {row.apart:.3g} m apart"
        changed = with_joint(a.placed, row.a, Place(np.eye(3), row.shift))
        yield make_property("anchor", name, message, relative=row.apart / size, changed=changed)
    share = abs(row.zero) / (1.0 if link.kind == "hinge" else size)
    if share > SAME:
        unit = "rad" if link.kind == "hinge" else "m"
        sign = -1.0 if row.opposite else 1.0
        shift = f"{row.zero - sign * pair.offset:+.15g}"
        remedy = f"--joints={pair.a}={'-' if row.opposite else ''}{pair.b}{shift}"
        message = f"zero of joint {name}: {abs(row.zero):.9g} {unit} from that of A ({remedy})"
        slid = Place(np.eye(3), row.zero * u)
        motion = turned_about(point, u, row.zero) if link.kind == "hinge" else slid
        changed = with_joint(a.placed, row.a, motion)
        yield make_property("zero", name, message, relative=share, changed=changed)


def _forces(a: ModelSide, b: ModelSide, row: Aligned, pair: JointPair) -> Iterator[Difference]:
    link_a, link_b = a.tree.links[row.a], b.tree.links[row.b]
    name = link_a.name
    plain = [("armature", link_a.armature, link_b.armature)]
    if not (a.springs or b.springs):
        plain += [
            ("damping", link_a.damping, link_b.damping),
            ("stiffness", link_a.stiffness, link_b.stiffness),
        ]
    for what, here, there in plain:
        largest = max(abs(here), abs(there))
        if abs(here - there) > SAME * largest:
            message = f"{what} of joint {name}: {shown(here, there)}"
            share = abs(here - there) / largest
            changed = with_link(a.tree, row.a, **{what: there})
            yield make_property(
                what, name, message, a=here, b=there, relative=share, changed=changed
            )
    if link_a.stiffness and link_b.stiffness and not (a.springs or b.springs):
        rest = (link_b.rest[0] - pair.offset) / pair.slope
        if abs(link_a.rest[0] - rest) > SAME:
            message = f"rest of the spring of joint {name}: {shown(link_a.rest[0], rest)}"
            changed = with_link(a.tree, row.a, rest=(rest,))
            yield make_property("rest", name, message, a=link_a.rest[0], b=rest, changed=changed)


def _body_properties(a: ModelSide, b: ModelSide, row: Aligned, size: float) -> Iterator[Difference]:
    body_a, body_b = a.placed.body_inertia(row.a), b.placed.body_inertia(row.b).in_frame(row.moved)
    parts, frame = (a.parts[row.a], b.parts[row.b]), a.placed.frames[row.a]
    if welded := _welded(a, b, row, body_b):
        yield from welded
        return
    heavy = max(body_a.mass, body_b.mass)
    if abs(body_a.mass - body_b.mass) > SAME * heavy:
        yield from _masses(a, b, row, parts, (body_a.mass, body_b.mass))
    apart = float(np.linalg.norm(body_a.center - body_b.center))
    weighed = min(body_a.mass, body_b.mass) > 0
    if weighed and apart > SAME * size:
        message = f"{_centers(body_a.center, body_b.center)}, in the world"
        changed = with_link(a.tree, row.a, center=frame.rotation.T @ (body_b.center - frame.origin))
        yield _named(a, b, parts, "centre", message, apart / size, changed)
    large = max(np.abs(body_a.inertia).max(), np.abs(body_b.inertia).max())
    miss = float(np.abs(body_a.inertia - body_b.inertia).max())
    if miss > SAME * large + ROUNDING * heavy * size**2:
        message = _tensors(body_a.inertia, body_b.inertia)
        inertia = frame.rotation.T @ body_b.inertia @ frame.rotation
        changed = with_link(a.tree, row.a, inertia=inertia)
        record, tree = _named(a, b, parts, "inertia", message, miss / large, changed)
        yield structs.replace(record, remedy=_tensor_remedy(a, b, row, record)), tree


def _welded(a: ModelSide, b: ModelSide, row: Aligned, body_b: SpatialInertia) -> list[Difference]:
    """Return a row per number of welded links, if these explain the body in B, in the world."""
    parts, frame = a.parts[row.a], a.placed.frames[row.a]
    unequal = [pair for pair in _namesakes(parts, b.parts[row.b]) if _unlike(*pair)]
    if max(len(parts), len(b.parts[row.b])) < 2 or a.file.suffix != b.file.suffix:
        return []

    def whole(numbers: Mapping[str, SpatialInertia]) -> SpatialInertia:
        links = [
            numbers.get(one.name, one.inertia).in_frame(a.tree.frames[one.name][1]) for one in parts
        ]
        return reduce(SpatialInertia.combined, links, NO_INERTIA)

    every = whole({x.name: y.inertia for x, y in unequal}).in_frame(frame)
    scale = max(every.mass, body_b.mass), a.placed.size, float(np.abs(body_b.inertia).max())
    miss = (
        abs(every.mass - body_b.mass),
        _norm(every.center - body_b.center),
        _norm(every.inertia - body_b.inertia),
    )
    if any(error > SAME * size for error, size in zip(miss, scale, strict=True)):
        return []
    rows = []
    for x, y in unequal:
        p, q = x.inertia, y.inertia
        bare = [not one.mass and not one.inertia.any() for one in (p, q)]
        texts = ("none" if empty else f"(mass {one.mass:.9g}, moments "
                 f"{values_shown(np.linalg.eigvalsh(one.inertia).tolist())[1:]}"
                 for one, empty in zip((p, q), bare, strict=True))  # fmt: skip
        changes = [("mass", "inertial {} in A, {} in B".format(*texts), 1.0, q)] if any(bare) else [
            ("mass", f"mass {shown(p.mass, q.mass)}",
             abs(p.mass - q.mass) / (max(p.mass, q.mass) or 1.0), p._replace(mass=q.mass)),
            ("centre", _centers(p.center, q.center), _norm(p.center - q.center) / a.placed.size,
             p._replace(center=q.center)),
            ("inertia", _tensors(p.inertia, q.inertia), _norm(p.inertia - q.inertia)
             / (_norm(p.inertia) or 1.0), p._replace(inertia=q.inertia)),
        ]  # fmt: skip
        for kind, message, share, new in changes:
            if share:
                body = whole({x.name: new})
                rows.append(make_property(
                    kind, x.name, f"link {_both(x.name, y.name)}: {message}",
                    a=p.mass if kind == "mass" else None, b=q.mass if kind == "mass" else None,
                    lines=lines_of(a, b, kind, (x.name, y.name)), relative=share,
                    changed=with_link(a.tree, row.a, **body._asdict()),
                ))  # fmt: skip
    return rows


def _norm(values: Array) -> float:
    return float(np.abs(values).max())


def _centers(here: Array, there: Array) -> str:
    apart = float(np.linalg.norm(here - there))
    texts = (f"({_digits(center, apart)})" for center in (here, there))
    return "centre of mass {} in A, {} in B".format(*texts) + f", {apart:.3g} m apart"


def _tensor_remedy(a: ModelSide, b: ModelSide, row: Aligned, record: ComparedProperty) -> str:
    """Return the six moments that make one file like the other, in the axes of its only link."""
    for model, link, parts, other, where in (
        (b, row.b, b.parts[row.b], a.placed.body_inertia(row.a), record.where_b),
        (a, row.a, a.parts[row.a], b.placed.body_inertia(row.b), record.where_a),
    ):
        if len(parts) != 1 or where is None:
            continue
        frame = model.placed.frames[link].compose(model.tree.frames[parts[0].name][1])
        turn = frame.rotation.T @ (row.moved.rotation.T if model is b else row.moved.rotation)
        tensor = turn @ other.inertia @ turn.T
        names = (("ixx", 0, 0), ("iyy", 1, 1), ("izz", 2, 2), ("ixy", 0, 1), ("ixz", 0, 2),
                 ("iyz", 1, 2))  # fmt: skip
        size = np.abs(tensor).max()
        values = [
            f"{key} {tensor[i, j]:.9g}" for key, i, j in names if abs(tensor[i, j]) > SAME * size
        ]
        place = f"{Path(where.file).name}:{where.line}"
        text = f"set the inertia of link {parts[0].name} in {place} to {', '.join(values)}"
        return f"{text}, about its centre of mass, along the axes of the link"
    return ""


def _masses(
    a: ModelSide,
    b: ModelSide,
    row: Aligned,
    parts: tuple[tuple[LinkPart, ...], tuple[LinkPart, ...]],
    masses: tuple[float, float],
) -> Iterator[Difference]:
    pairs = [(x.link.mass, y.link.mass, x, y) for x, y in _namesakes(*parts)]
    unequal = [pair for pair in pairs if abs(pair[0] - pair[1]) > SAME * max(pair[:2])]
    remainder = masses[0] - masses[1] - sum(m - n for m, n, *_ in unequal)
    if unequal and abs(remainder) <= SAME * max(masses):
        for m, n, x, y in unequal:
            yield make_property(
                "mass",
                x.name,
                f"link {_both(x.name, y.name)}: mass {shown(m, n)}",
                a=m,
                b=n,
                lines=lines_of(a, b, "mass", (x.name, y.name)),
                relative=abs(m - n) / max(m, n),
                changed=with_link(a.tree, row.a, mass=masses[0] + n - m),
            )
        return
    message = f"mass {shown(*masses)}"
    share = abs(masses[0] - masses[1]) / max(masses)
    changed = with_link(a.tree, row.a, mass=masses[1])
    yield _named(a, b, parts, "mass", message, share, changed, masses)


def _namesakes(
    parts_a: tuple[LinkPart, ...], parts_b: tuple[LinkPart, ...]
) -> list[tuple[LinkPart, LinkPart]]:
    if len(parts_a) == len(parts_b) == 1:
        return [(parts_a[0], parts_b[0])]
    by_name = {part.name: part for part in parts_b}
    return [(part, by_name[part.name]) for part in parts_a if part.name in by_name]


def _named(
    a: ModelSide,
    b: ModelSide,
    parts: tuple[tuple[LinkPart, ...], tuple[LinkPart, ...]],
    kind: str,
    message: str,
    share: float,
    changed: Tree,
    values: tuple[float | None, float | None] = (None, None),
) -> Difference:
    """Return a difference of all welded links.

    `share` is the relative difference.
    """
    x, y = _heaviest(parts[0]), _heaviest(parts[1])
    name = _both(x.name, y.name) if x and y else (x or y or _NOBODY).name
    subject = f"link {name}{' with what is welded to it' if max(map(len, parts)) > 1 else ''}"
    return make_property(
        kind,
        x.name if x else name,
        f"{subject}: {message}",
        a=values[0],
        b=values[1],
        lines=lines_of(a, b, kind, (x.name if x else "", y.name if y else "")),
        relative=share,
        changed=changed,
    )


_NOBODY = LinkPart(link=RigidBody(name="", parent=None), line=0)


def _unlike(x: LinkPart, y: LinkPart) -> bool:
    p, q = x.inertia, y.inertia
    return not (
        p.mass == q.mass
        and np.array_equal(p.center, q.center)
        and np.array_equal(p.inertia, q.inertia)
    )


def _heaviest(parts: tuple[LinkPart, ...]) -> LinkPart | None:
    return max(parts, key=lambda part: part.link.mass, default=None)


def _both(x: str, y: str) -> str:
    return x if x == y else f"{x} / {y}"


def _tensors(tensor_a: Array, tensor_b: Array) -> str:
    here, there = (np.asarray(np.linalg.eigvalsh(m), dtype=float) for m in (tensor_a, tensor_b))
    large = float(max(np.abs(here).max(), np.abs(there).max()))
    miss = float(np.abs(here - there).max())
    entries = float(np.abs(tensor_a - tensor_b).max())
    if miss > max(SAME * large, 1e-3 * entries):
        text_a, text_b = (f"({_digits(m, miss)})" for m in (here, there))
        return (
            f"principal moments of inertia {text_a} in A, {text_b} in B ({miss / large:.2g}"
            f" of the largest)"
        )
    turn = _turn(tensor_a, tensor_b)
    return f"the same principal moments of inertia about axes turned by {turn:.3g} rad"


def _turn(tensor_a: Array, tensor_b: Array) -> float:
    """Return the largest angle between corresponding principal axes, rad.

    Equal moments have no axes of their own: any in their plane are principal.
    """
    (moments, axes_a), (_, axes_b) = (np.linalg.eigh(one) for one in (tensor_a, tensor_b))
    apart = np.abs(moments[:, None] - moments) + np.diag(np.full(3, np.inf))
    is_single = apart.min(axis=0) > SAME * np.abs(moments).max()
    cosines = np.abs(np.sum(axes_a * axes_b, axis=0))
    sines = np.linalg.norm(np.cross(axes_a.T, axes_b.T), axis=1)
    return float(np.max(np.arctan2(sines, cosines)[is_single], initial=0.0))


def _digits(values: Array, apart: float) -> str:
    """Format numbers with enough digits to show a difference."""
    large = float(np.abs(values).max()) or 1.0
    digits = int(np.clip(np.ceil(np.log10(large / apart)) + 2 if apart else 4, 4, 15))
    return ", ".join(f"{value:.{digits}g}" for value in values)


def _gravity(a: ModelSide, b: ModelSide) -> Iterator[Difference]:
    gravity_a, gravity_b = np.array(a.facts.gravity), np.array(b.facts.gravity)
    if gravity_a.shape != gravity_b.shape or not gravity_a.size:
        return
    apart = float(np.linalg.norm(gravity_a - gravity_b))
    large = max(float(np.linalg.norm(gravity_a)), float(np.linalg.norm(gravity_b)))
    if apart > SAME * large:
        here, there = (f"({', '.join(f'{x:.9g}' for x in v)})" for v in (gravity_a, gravity_b))
        changed = replace(a.tree, gravity=gravity_b)
        message = f"gravity: {here} in A, {there} in B"
        is_turned = bool(np.linalg.norm(np.cross(gravity_a, gravity_b)) > SAME * large**2)
        lines = a.gravity_line(is_turned), b.gravity_line(is_turned)
        yield make_property(
            "gravity", "", message, lines=lines, relative=apart / large, changed=changed
        )


def _ranges(
    a: ModelSide, b: ModelSide, rows: Sequence[Aligned], by_name: dict[str, JointPair]
) -> Iterator[Difference]:
    for row in rows:
        pair = by_name[a.tree.links[row.a].name]
        if pair.a not in a.facts.coordinates:
            continue
        here = np.array(a.limits(pair.a))
        there = np.sort((np.array(b.limits(pair.b)) - pair.offset) / pair.slope)
        declared = not (a.facts.candidate.bare and b.facts.candidate.bare)
        if declared and a.file.suffix != b.file.suffix and np.isinf([here, there]).any():
            continue  # a URDF must state a range; a sidecar declares the system without it
        with np.errstate(invalid="ignore"):
            miss = np.where(here == there, 0.0, np.abs(here - there))
        if (miss > SAME * np.maximum(1.0, np.minimum(np.abs(here), np.abs(there)))).any():
            text_a, text_b = _range(here, there)
            message = f"range of joint {pair.a}: {text_a} in A, {text_b} in B"
            share = _share(miss, np.maximum(np.abs(here), np.abs(there)))
            lines = lines_of(a, b, "range", (pair.a, pair.b))
            yield make_property("range", pair.a, message, moves=False, relative=share, lines=lines)


def _share(miss: Array, sizes: Array) -> float:
    """Return the largest relative difference; 1 for values that are not finite."""
    finite = np.isfinite(miss) & np.isfinite(sizes) & (sizes > 0)
    shares = np.divide(miss, sizes, out=np.where(miss > 0, 1.0, 0.0), where=finite)
    return float(np.max(shares))


def _range(here: Array, there: Array) -> tuple[str, str]:
    if np.isinf(here).any() or np.isinf(there).any():
        text_a, text_b = (
            "endless" if np.isinf(both).all() else f"{both[0]:.7g} to {both[1]:.7g}"
            for both in (here + 0.0, there + 0.0)
        )
        return text_a, text_b
    (low, its_low), (high, its_high) = (
        apart(float(x) + 0.0, float(y) + 0.0, 0.0) if x != y else (f"{x + 0.0:.7g}",) * 2
        for x, y in zip(here, there, strict=True)
    )
    return f"{low} to {high}", f"{its_low} to {its_high}"


def _tendons(a: ModelSide, b: ModelSide) -> Iterator[Difference]:
    if a.facts.compiled is None or b.facts.compiled is None:
        return
    tendons_a, tendons_b = (
        {pull.name: pull for pull in own.facts.compiled.passive}
        for own in (a, b)
        if own.facts.compiled is not None
    )
    for name in dict.fromkeys([*tendons_a, *tendons_b]):
        if name not in tendons_a or name not in tendons_b:
            label = "A" if name in tendons_a else "B"
            yield make_property("tendon", name, f"tendon {name} pulls in {label} alone")
            continue
        here, there = tendons_a[name], tendons_b[name]
        for what, x, y in (
            ("stiffness", powers(here.stiffness), powers(there.stiffness)),
            ("damping", powers(here.damping), powers(there.damping)),
            ("rest", here.rest, there.rest),
            ("armature", (here.armature,), (there.armature,)),
        ):
            if x != y:
                message = f"{what} of tendon {name}: {_row(x)} in A, {_row(y)} in B"
                yield make_property("tendon", name, message)


def _row(values: Sequence[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values) or "none"


POSE_ACCURACY = 1e-9
"""Accuracy of frames from engines, relative to the size of the mechanism."""


@dataclass(frozen=True, kw_only=True)
class FileComparison:
    """Comparison of two files.

    Attributes:
        sides: A and B; None if a file is not a tree of hinges and slides.
        properties: differences that affect motions first, then frames, then the rest.
        turned: reversed joints of the comparison.
    """

    sides: tuple[ModelSide, ModelSide] | None
    properties: tuple[ComparedProperty, ...]
    turned: tuple[str, ...]

    @property
    def moving(self) -> bool:
        """True if a difference affects motions."""
        return any(one.moves for one in self.properties)


def compare_files(
    executor: Executor, prepared: PreparedComparison, home: Array, runs: Segments | None
) -> FileComparison:
    """Compare both files at one position.

    Args:
        executor: runs the engines, which compute frames.
        prepared: both models.
        home: positions of the source, (nz,).
        runs: of A, with forces on its own coordinates, to weigh differences; None if unknown.

    Raises:
        FailureError: if an engine fails.
    """
    source_facts = prepared.facts[0 if prepared.match.source == "A" else 1]
    pairs = pairs_of(prepared.match, source_facts.coordinates)
    z = home, prepared.match.value(home[None])[0]
    z = z if prepared.match.source == "A" else z[::-1]
    sides = _sides(prepared, z)
    if sides is None:
        return FileComparison(
            sides=None, properties=_compare_frames(executor, prepared, z, 1.0), turned=()
        )
    differences, opposite = properties(*sides, pairs)
    turned = tuple(p.a if prepared.match.source == "B" else p.b for p in pairs if p.a in opposite)
    if opposite:
        of_a = dict(zip(prepared.facts[0].coordinates, z[0].tolist(), strict=True))
        # Compare again in corresponding positions.
        pairs = tuple(
            replace(p, slope=-p.slope, offset=-p.offset) if p.a in opposite else p for p in pairs
        )
        z = z[0], _posed(z[1], prepared.facts, pairs, of_a)
        again = _sides(prepared, z)
        assert again is not None
        differences, _ = properties(*again, pairs)
    size = max(one.placed.size for one in sides)
    is_usd = any(side.file.suffix in USD_SUFFIXES for side in sides)
    rows = weighed(differences, sides[0], runs, FLOAT_DIGITS if is_usd else 0.0)
    moving = [row for row in rows if row.moves]
    rest = [row for row in rows if not row.moves]
    placed = [
        structs.replace(row, where_a=sides[0].frame_line(row.about),
                        where_b=sides[1].frame_line(row.about))
        for row in _compare_frames(executor, prepared, z, size)
    ]  # fmt: skip
    every = (*moving, *placed, *rest)
    return FileComparison(sides=sides, properties=every, turned=turned)


def _sides(
    prepared: PreparedComparison, z: tuple[Array, Array]
) -> tuple[ModelSide, ModelSide] | None:
    side_a = model_side(prepared.facts[0], z[0])
    side_b = model_side(prepared.facts[1], z[1])
    return None if side_a is None or side_b is None else (side_a, side_b)


def _posed(
    z: Array, facts: tuple[Facts, Facts], pairs: tuple[JointPair, ...], of_a: Mapping[str, float]
) -> Array:
    posed = np.array(z)
    for pair in pairs:
        posed[facts[1].coordinates.index(pair.b)] = pair.slope * of_a[pair.a] + pair.offset
    return posed


def _compare_frames(
    executor: Executor, prepared: PreparedComparison, z: tuple[Array, Array], size: float
) -> tuple[ComparedProperty, ...]:
    places = shared_frames(*prepared.facts)
    if not places[0] or prepared.models[0] == prepared.models[1]:
        return ()
    frames_a, frames_b = (
        ask(executor, candidate, partial(frames, places=its, z=at), candidate)
        for candidate, its, at in zip(prepared.models, places, z, strict=True)
    )
    return frame_properties(places[0], frames_a, frames_b, size)


def frames(candidate: Candidate, places: tuple[str, ...], z: Array) -> tuple[Array, Array]:
    """Return origins (F, 3), m, and rotations (F, 3, 3) of frames in the engine's world.

    Args:
        candidate: the model.
        places: the frames, as `kind:name`.
        z: positions, (nz,).

    Raises:
        EngineError: with file, place and remedy.
    """
    origins, turns = candidate.load().poses(places, z[None])
    return origins[0], turns[0]


def shared_frames(a: Facts, b: Facts) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return massless frames of A and of B with equal names: sites, and links on fixed joints.

    The frame of a link with mass is a convention.
    """
    frames_a, frames_b = _massless_frames(a), _massless_frames(b)
    names = [name for name in frames_a if name in frames_b]
    return tuple(frames_a[name] for name in names), tuple(frames_b[name] for name in names)


def _massless_frames(facts: Facts) -> dict[str, str]:
    parts = () if facts.robot is None else facts.robot.parts
    massless = {part.name for part in parts if not part.link.mass and not any(part.link.inertia)}
    places: dict[str, str] = {}
    for place in facts.places:
        kind, _, name = place.partition(":")
        if kind == "site" or (kind in ("body", "link") and name in massless):
            places.setdefault(name, place)
    return places


def frame_properties(
    places: Sequence[str], a: tuple[Array, Array], b: tuple[Array, Array], size: float
) -> tuple[ComparedProperty, ...]:
    """Return frames whose poses differ between the files."""
    differences = []
    for i, place in enumerate(places):
        name = place.partition(":")[2]
        apart = b[0][i] - a[0][i]
        far = float(np.linalg.norm(apart))
        turn = angle_of(a[1][i].T @ b[1][i])
        parts = []
        if far > max(POSE_ACCURACY, SAME) * size:
            x, y, z = (f"{value + 0.0:.4g}" for value in apart)
            parts.append(f"in B {far:.4g} m away, by ({x}, {y}, {z}) in the world")
        if turn > 10 * SAME:
            parts.append(f"turned by {turn:.4g} rad")
        if parts:
            message = f"frame {name}: {' and '.join(parts)}"
            differences.append(
                make_property("frame", name, message, moves=False, relative=far / size + turn)[0]
            )
    return tuple(differences)
