"""A file that an engine compiles, such as an MJCF, as a tree of bodies.

The engine resolves includes, defaults, frames, meshes and shapes; the report notes that this step
is not checked. The equations of the bodies are.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document, finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, ReadError, ReadKind
from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.mjcf_source import ORIENTATIONS
from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.reference.laws.mechanics import LawTree
from physics_crosscheck.reference.laws.step import LawModel
from physics_crosscheck.reference.mechanism.assemble import assemble
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import IDENTITY, minimal_coordinates
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeError
from ..folders import is_robot
from ..parts import included
from ..robot import LinkPart, Omission, PlacedShape, Robot, home_of, refused
from .stated import StatedLaws


def compiler(suffix: str) -> Engine | None:
    """Return an installed engine that compiles files with this suffix, or None."""
    able = (engine for engine in engines_reading(suffix) if suffix in engine.compiles)
    return next((engine for engine in able if engine.version() is not None), None)


_TENSORS = ("diaginertia", "fullinertia")

MAX_USERS = 100
"""Number of files of a folder that may include a part."""


def parts_of(path: Path) -> tuple[Path, ...]:
    """Return a file and its includes.

    Raises:
        EngineError: naming file and reason.
    """
    engine = compiler(path.suffix)
    return (path,) if engine is None else engine.parts(path)


def read_compiled_robot(
    path: Path, *, actuated: bool = True, controls: Sequence[float] | None = None
) -> Robot:
    """Read a file as an engine compiles it.

    Args:
        path: of the file.
        actuated: whether its actuators act, each at a held control.
        controls: held values; None chooses values within their ranges.
    """
    engine = compiler(path.suffix)
    if engine is None:
        return _refused(path, [f"no engine is installed that compiles {path.suffix} files"])
    try:
        compiled = engine.compiled(path)
    except EngineError as error:
        refusal = _refused(error.file or path, [error.sentence], line=error.line or 0, kind="file")
        return replace(refusal, parts=tuple(_stated_links(path)))
    if not actuated:
        compiled = replace(compiled, pulls=compiled.passive, controls=0)
    if sentences := list(_problems(compiled)):
        kind: ReadKind = "unsupported" if compiled.joints else "no joint"
        return _refused(path, sentences, _left_out(engine, compiled), compiled.name, kind=kind)
    try:
        return compiled_robot(compiled, path, _left_out(engine, compiled), controls)
    except TreeError as error:
        return _refused(path, [str(error)], _left_out(engine, compiled), compiled.name)


def _stated_links(path: Path) -> Iterator[LinkPart]:
    """Yield links of a refused file that state an inertia, since several of them may be wrong."""
    try:
        roots = [Document(part).root for part in parts_of(path)]
    except (EngineError, LocationError):
        return
    for body in (one for root in roots for one in root.iter("body")):
        inertial = body.find("inertial")
        if inertial is None:
            continue
        rows = [finite_numbers(inertial.get(key)) for key in ("mass", *_TENSORS)]
        mass, tensor = rows[0], next((one for one in rows[1:] if one), None)
        if mass and tensor and len(tensor) in (3, 6):
            xx, yy, zz, xy, xz, yz = (*tensor, 0.0, 0.0, 0.0)[:6]
            name = body.get("name") or "without a name"
            link = RigidBody(name=name, parent=None, mass=mass[0], inertia=(xx, yy, zz, xy, xz, yz))
            yield LinkPart(link=link, line=inertial.place[1] or 0)


def tree_of(
    compiled: CompiledTree, controls: Sequence[float], held: Collection[str] = ()
) -> Tree | None:
    """Return the tree of a compiled file under held controls, with joints fixed, or None."""
    if list(_problems(compiled)):
        return None
    try:
        return compiled_tree(compiled, controls, held)
    except TreeError:
        return None


def _problems(compiled: CompiledTree) -> Iterator[str]:
    """Yield elements that the equations of the bodies do not cover."""
    for what in compiled.uncovered:
        yield f"{what}: not covered"
    if not compiled.joints:
        yield "it has no joint that moves"


def _left_out(engine: Engine, compiled: CompiledTree) -> tuple[Omission, ...]:
    read = Omission(what=f"how {engine.title} compiles the file", count=1, where=())
    return (*(Omission(what=what, count=count, where=()) for what, count in compiled.besides), read)


def _refused(
    path: Path,
    sentences: list[str],
    left_out: tuple[Omission, ...] = (),
    name: str = "",
    line: int = 0,
    kind: ReadKind = "unsupported",
) -> Robot:
    """Return a robot without a tree, with these problems."""
    compare = "`crosscheck compare` compares it with another file, without equations"
    remedy = "correct the file" if kind == "file" else compare
    if user := _user_of(path):
        remedy = f"open {user}, which includes it"
    obstacles = [
        ReadError(sentence=one, file=path, line=line, remedy=remedy, kind=kind) for one in sentences
    ]
    return refused(path, name or path.stem, obstacles, left_out=left_out)


def _user_of(part: Path) -> Path | None:
    """Return a file in the folder of a part, or in the one above, that includes it."""
    above = (part.parent, part.parent.parent)
    files = [one for folder in above for one in sorted(folder.glob("*.xml"))[:MAX_USERS]]
    whole = part.resolve()
    users = [one for one in files if whole in map(Path.resolve, included(one))]
    return next((one for one in users if is_robot(one)), None)


FilePlace = tuple[Path, int]
"""A file and a line."""


def shape_lines(path: Path, names: Sequence[str]) -> Mapping[str, tuple[FilePlace, FilePlace]]:
    """Return the lines of each shape and of its size, which may be in a default, by its place.

    Args:
        path: of the file.
        names: places of all shapes, in the engine's order: bodies depth first. Those without a name
            are matched by this order, if the file repeats no elements.
    """
    try:
        stated = StatedLaws(path)
    except EngineError:
        return {}
    lines: dict[str, tuple[FilePlace, FilePlace]] = {}
    for kind in ("geom", "site"):
        mine = [f"{kind}:{name}" if name else "" for name in stated.names(kind)]
        places = [name for name in names if name.startswith(f"{kind}:")]
        pairs = zip(mine, places, strict=False)
        aligned = len(mine) == len(places) and all(not one or one == there for one, there in pairs)
        for i, name in enumerate(places if aligned else mine):
            chain = stated.elements(kind, i)
            frame = _line(path, chain, "pos", "fromto", *ORIENTATIONS)
            lines[name] = frame, _line(path, chain, "size")
    return lines


def _line(path: Path, chain: Sequence[XmlElement], *keys: str) -> FilePlace:
    """Return the line of the first of these attributes that is stated, or of the element."""
    stated = (one.attribute_place(key) for key in keys for one in chain if key in one.attributes)
    file, line = next(stated, chain[0].place)
    return file or path, line or 0


SPREAD = (5**0.5 - 1) / 2
"""The step of controls in their ranges; its multiples make all controls differ."""


def compiled_robot(
    compiled: CompiledTree,
    path: Path,
    left_out: tuple[Omission, ...],
    controls: Sequence[float] | None = None,
) -> Robot:
    """Return the robot, with its controls held at given values, or within their ranges.

    Raises:
        TreeError: naming the joint that is not covered.
    """
    controls = held_controls(compiled) if controls is None else tuple(controls)
    body_model = compiled.held(controls)
    whole = assemble(body_model)
    return Robot(
        name=compiled.name or path.stem,
        file=path,
        tree=whole.tree,
        parts=tuple(
            LinkPart(link=body, line=0, body=whole.tree.frames[body.name][0])
            for body in body_model.bodies
        ),
        limits=whole.limits,
        home=home_of(whole.tree, whole.limits),
        left_out=left_out,
        obstacles=(),
        controls=controls,
        body_model=body_model,
        shapes=compiled.shapes,
        placed=tuple(placed_shapes(compiled, path)),
    )


def placed_shapes(compiled: CompiledTree, path: Path) -> Iterator[PlacedShape]:
    """Yield the shapes and sites, with their lines in a file whose elements are not repeated."""
    lines = shape_lines(path, [shape.name for shape in compiled.placed])
    for shape in compiled.placed:
        frame = shape.frame
        (file, line), size_place = lines.get(shape.name, ((path, 0), (path, 0)))
        yield PlacedShape(
            name=shape.name,
            body=frame.body,
            place=frame.place,
            size=shape.size,
            file=file,
            line=line,
            size_place=size_place,
            kind=shape.kind,
            visual=shape.visual,
            mesh=shape.mesh,
            scale=shape.scale,
        )


def compiled_tree(
    compiled: CompiledTree, controls: Sequence[float], held: Collection[str] = ()
) -> Tree:
    """Return the tree under held controls, with some joints fixed.

    Raises:
        TreeError: naming the joint that is not covered.
    """
    return assemble(compiled.held(controls).without(held)).tree


def held_controls(compiled: CompiledTree) -> tuple[float, ...]:
    """Return a value within the range of each control; between 0 and 1 without a range."""
    ranges = {one.input: one.range for one in compiled.pulls if one.input >= 0}
    held = []
    for i in range(compiled.controls):
        low, high = ranges.get(i) or (0.0, 1.0)
        held.append(low + (high - low) * ((i + 1) * SPREAD % 1.0))
    return tuple(held)


NO_TURN = 1.0, 0.0, 0.0, 0.0


def law_model(compiled: CompiledTree) -> LawModel | None:
    """Return the laws of a compiled file on its own bodies; None without joints or laws.

    Raises:
        TreeError: naming the element that the equations of the bodies do not cover.
    """
    if compiled.laws is None or not compiled.joints:
        return None
    paths = tuple(replace(path, name=f"path {i}") for i, path in enumerate(compiled.paths))
    tree = compiled_tree(replace(compiled, pulls=(*compiled.passive, *paths), couplings=()), ())
    count = len(tree.pulls) - len(paths)
    bodies = list(tree.frames.values())
    return LawModel(
        laws=compiled.laws,
        tree=LawTree(
            tree=replace(tree, pulls=tree.pulls[:count]),
            paths=tree.pulls[count:],
            bodies=((WORLD, IDENTITY), *bodies),
            masses=np.array([0.0, *(body.mass for body in compiled.bodies)]),
            centers=np.array([np.zeros(3), *(body.center for body in compiled.bodies)]),
        ),
        home=_home(compiled),
    )


def _home(compiled: CompiledTree) -> Array:
    """Return the coordinates of the drawn configuration, (nv,)."""
    parts: list[Array] = []
    for body in compiled.bodies:
        for joint in body.joints:
            if joint.kind == "free":
                turn = minimal_coordinates(np.array(body.quaternion or NO_TURN), np.array(NO_TURN))
                parts += [turn, np.array(body.position)]
            else:
                parts.append(np.zeros(3) if joint.kind == "ball" else np.array([joint.zero]))
    return np.concatenate(parts)
