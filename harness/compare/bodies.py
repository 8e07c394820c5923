"""Comparison of bodies of two files: mass, centre of mass, inertia tensor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.harness.compare.alignment import SAME, Aligned
from physics_crosscheck.harness.compare.placed import with_link
from physics_crosscheck.harness.compare.property import Difference, make_property, shown
from physics_crosscheck.harness.compare.side import ModelSide
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.modelfiles.robot import LinkPart
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.reference.mechanism.tree import Tree

ROUNDING = 1e-13
"""Rounding error of a tensor transformed between frames, in units of m r^2."""


def body_properties(a: ModelSide, b: ModelSide, row: Aligned, size: float) -> Iterator[Difference]:
    """Yield the differences, in the world, of the bodies that a pair of joints carries."""
    body_a, body_b = a.placed.body_inertia(row.a), b.placed.body_inertia(row.b).in_frame(row.moved)
    parts, frame = (a.parts[row.a], b.parts[row.b]), a.placed.frames[row.a]
    heavy = max(body_a.mass, body_b.mass)
    if abs(body_a.mass - body_b.mass) > SAME * heavy:
        yield from _masses(a, b, row, parts, (body_a.mass, body_b.mass))
    apart = float(np.linalg.norm(body_a.center - body_b.center))
    weighed = min(body_a.mass, body_b.mass) > 0
    if weighed and apart > SAME * size:
        here, there = (f"({_digits(c, apart)})" for c in (body_a.center, body_b.center))
        message = f"centre of mass {apart:.3g} m apart: {here} in A, {there} in B, in the world"
        changed = with_link(a.tree, row.a, center=frame.rotation.T @ (body_b.center - frame.origin))
        yield _named(a, b, parts, "centre", message, apart / size, changed)
    large = max(np.abs(body_a.inertia).max(), np.abs(body_b.inertia).max())
    miss = float(np.abs(body_a.inertia - body_b.inertia).max())
    if miss > SAME * large + ROUNDING * heavy * size**2:
        message = _tensors(body_a.inertia, body_b.inertia)
        inertia = frame.rotation.T @ body_b.inertia @ frame.rotation
        changed = with_link(a.tree, row.a, inertia=inertia)
        yield _named(a, b, parts, "inertia", message, miss / large, changed)


def _masses(
    a: ModelSide,
    b: ModelSide,
    row: Aligned,
    parts: tuple[tuple[LinkPart, ...], tuple[LinkPart, ...]],
    masses: tuple[float, float],
) -> Iterator[Difference]:
    """Yield mass differences by link where these explain the total; else that of the body."""
    pairs = [
        (x, y) for x, y in _namesakes(*parts)
        if abs(x.mass - y.mass) > SAME * max(x.mass, y.mass)
    ]  # fmt: skip
    remainder = masses[0] - masses[1] - sum(x.mass - y.mass for x, y in pairs)
    if pairs and abs(remainder) <= SAME * max(masses):
        for x, y in pairs:
            message = f"link {_both(x.name, y.name)}: mass {shown(x.mass, y.mass)}"
            yield make_property(
                "mass",
                x.name,
                message,
                a=x.mass,
                b=y.mass,
                lines=_lines(a, b, x, y),
                relative=abs(x.mass - y.mass) / max(x.mass, y.mass),
                changed=with_link(a.tree, row.a, mass=masses[0] + y.mass - x.mass),
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
    """Return a difference of the one link that differs, or of all welded links.

    `share` is the relative difference.
    """
    unequal = [
        pair for pair in _namesakes(*parts) if a.file.suffix == b.file.suffix and _unlike(*pair)
    ]
    x, y = unequal[0] if len(unequal) == 1 else (_heaviest(parts[0]), _heaviest(parts[1]))
    name = _both(x.name, y.name) if x and y else (x or y or _NOBODY).name
    more = max(map(len, parts)) > 1 and len(unequal) != 1
    subject = f"link {name}{' with what is welded to it' if more else ''}"
    return make_property(
        kind,
        x.name if x else name,
        f"{subject}: {message}",
        a=values[0],
        b=values[1],
        lines=_lines(a, b, x, y),
        relative=share,
        changed=changed,
    )


_NOBODY = LinkPart(name="", line=0, mass=0.0, center=np.zeros(3), inertia=np.zeros((3, 3)))


def _unlike(x: LinkPart, y: LinkPart) -> bool:
    """Return whether the mass properties of two links differ in their own frames."""
    return not (
        x.mass == y.mass
        and np.array_equal(x.center, y.center)
        and np.array_equal(x.inertia, y.inertia)
    )


def _heaviest(parts: tuple[LinkPart, ...]) -> LinkPart | None:
    return max(parts, key=lambda part: part.mass, default=None)


def _both(x: str, y: str) -> str:
    return x if x == y else f"{x} / {y}"


def _lines(
    a: ModelSide, b: ModelSide, x: LinkPart | None, y: LinkPart | None
) -> tuple[SourceLine | None, SourceLine | None]:
    """Return the source lines of links of A and B."""
    here, there = (
        SourceLine(file=str(side.file), line=part.line) if part is not None and part.line else None
        for side, part in ((a, x), (b, y))
    )
    return here, there


def _tensors(tensor_a: Array, tensor_b: Array) -> str:
    """Describe the difference of principal moments of inertia, or the angle of the axes."""
    here, there = (np.asarray(np.linalg.eigvalsh(m), dtype=float) for m in (tensor_a, tensor_b))
    large = float(max(np.abs(here).max(), np.abs(there).max()))
    miss = float(np.abs(here - there).max())
    entries = float(np.abs(tensor_a - tensor_b).max())
    if miss > max(SAME * large, 1e-3 * entries):
        told_a, told_b = (f"({_digits(m, miss)})" for m in (here, there))
        return (
            f"principal moments of inertia {told_a} in A, {told_b} in B ({miss / large:.2g}"
            f" of the largest)"
        )
    turn = _turn(tensor_a, tensor_b)
    return f"the same principal moments of inertia about axes turned by {turn:.3g} rad"


def _turn(tensor_a: Array, tensor_b: Array) -> float:
    """Return the largest angle between corresponding principal axes, rad."""
    bases = np.linalg.eigh(tensor_a)[1], np.linalg.eigh(tensor_b)[1]
    cosines = np.abs(np.sum(bases[0] * bases[1], axis=0))
    sines = np.linalg.norm(np.cross(bases[0].T, bases[1].T), axis=1)
    return float(np.arctan2(sines, cosines).max())


def _digits(values: Array, apart: float) -> str:
    """Format numbers with enough digits to show a difference."""
    large = float(np.abs(values).max()) or 1.0
    digits = int(np.clip(np.ceil(np.log10(large / apart)) + 2 if apart else 4, 4, 15))
    return ", ".join(f"{value:.{digits}g}" for value in values)
