"""A file that an engine compiles, such as an MJCF, as a tree of bodies.

The engine resolves includes, defaults, frames, meshes and shapes; the report notes that this step
is not checked. The equations of the bodies are.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from physics_crosscheck.harness.documents.errors import ReadError, ReadKind, quote
from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.reference.mechanism.tree import Tree, TreeError
from ..formats import is_robot
from ..parts import included
from ..robot import Omission, Robot, refused
from .tree import KINDS, compiled_robot, compiled_tree


def compiler(suffix: str) -> Engine | None:
    """Return an installed engine that compiles files with this suffix, or None."""
    able = (engine for engine in engines_reading(suffix) if suffix in engine.compiles)
    return next((engine for engine in able if engine.version() is not None), None)


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
        return _refused(error.file or path, [error.sentence], line=error.line or 0, kind="file")
    if not actuated:
        passive = tuple(pull for pull in compiled.pulls if pull.control < 0)
        compiled = replace(compiled, pulls=passive, controls=0)
    if sentences := list(_problems(compiled)):
        return _refused(path, sentences, _left_out(engine, compiled), compiled.name)
    try:
        return compiled_robot(compiled, path, _left_out(engine, compiled), controls)
    except TreeError as error:
        return _refused(path, [str(error)], _left_out(engine, compiled), compiled.name)


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
    joints = [joint for body in compiled.bodies for joint in body.joints]
    for joint in joints:
        if joint.kind not in KINDS:
            yield f"joint {quote(joint.name)} is a {joint.kind} joint: not covered"
    if not joints:
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
