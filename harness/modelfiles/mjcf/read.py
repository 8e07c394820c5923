"""A file that an engine compiles, as a tree of bodies: an MJCF, with all that its format resolves.

Includes, defaults, frames, meshes and shapes are the engine's to resolve: how it reads them is not
checked by this, and that is told. What follows from the bodies is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.protocol import Engine, EngineError
from physics_crosscheck.harness.engines.registry import readers
from physics_crosscheck.harness.modelfiles.mjcf.tree import KINDS, compiled_robot, compiled_tree
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.robot import LeftOut, Obstacle, Robot, refused
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.reference.mechanism.tree import Tree, TreeError


def compiler(suffix: str) -> Engine | None:
    """An engine that is there and compiles files with that ending."""
    able = (engine for engine in readers(suffix) if suffix in engine.compiles)
    return next((engine for engine in able if engine.version() is not None), None)


def parts_of(path: Path) -> tuple[Path, ...]:
    """A file, and those that it includes.

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
        actuated: whether its actuators act, each at a control that is held.
        controls: at which they are; None: within their ranges.
    """
    engine = compiler(path.suffix)
    if engine is None:
        return _refused(path, [f"no engine is installed that compiles {path.suffix} files"])
    try:
        found = engine.compiled(path)
    except EngineError as error:
        return _refused(error.file or path, [error.sentence], line=error.line or 0, kind="file")
    if not actuated:
        own = tuple(pull for pull in found.pulls if pull.control < 0)
        found = replace(found, pulls=own, controls=0)
    if sentences := list(_in_the_way(found)):
        return _refused(path, sentences, _left_out(engine, found), found.name)
    try:
        return compiled_robot(found, path, _left_out(engine, found), controls)
    except TreeError as error:
        return _refused(path, [str(error)], _left_out(engine, found), found.name)


def tree_of(found: CompiledTree, controls: Sequence[float]) -> Tree | None:
    """The tree of what an engine has compiled, under held controls; None where there is none."""
    if list(_in_the_way(found)):
        return None
    try:
        return compiled_tree(found, controls)
    except TreeError:
        return None


def _in_the_way(found: CompiledTree) -> Iterator[str]:
    """What acts and can't be told by equations of the bodies."""
    for what in found.uncovered:
        yield f"{what}: not covered"
    joints = [joint for body in found.bodies for joint in body.joints]
    for joint in joints:
        if joint.kind not in KINDS:
            yield f"joint {brief(joint.name)} is a {joint.kind} joint: not covered"
    if not joints:
        yield "it has no joint that moves"


def _left_out(engine: Engine, found: CompiledTree) -> tuple[LeftOut, ...]:
    read = LeftOut(what=f"how {engine.title} compiles the file", count=1, where=())
    return (*(LeftOut(what=what, count=count, where=()) for what, count in found.besides), read)


def _refused(
    path: Path,
    sentences: list[str],
    left_out: tuple[LeftOut, ...] = (),
    name: str = "",
    line: int = 0,
    kind: CaseKind = "unsupported",
) -> Robot:
    """Without a tree, for all of these."""
    remedy = "`crosscheck compare` compares it with another file, without equations"
    obstacles = [
        Obstacle(sentence=one, file=path, line=line, remedy=remedy, kind=kind) for one in sentences
    ]
    return refused(path, name or path.stem, obstacles, left_out=left_out)
