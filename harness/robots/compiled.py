"""A file that an engine compiles, as a tree of bodies: an MJCF, with all that its format resolves.

Includes, defaults, frames, meshes and shapes are the engine's to resolve: how it reads them is not
checked by this, and that is told. What follows from the bodies is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from harness.engines.compiled import CompiledBody, CompiledJoint, CompiledTree
from harness.engines.protocol import Engine, EngineError
from harness.engines.registry import readers
from harness.robots.lump import HERE, NOTHING, Lump, Place
from harness.robots.robot import LeftOut, Obstacle, Part, Robot, home_of, refused
from reference.multibody.algebra import DOUBLES, about_axis, from_quaternion
from reference.multibody.tree import WORLD, Link, Tree
from reference.numeric import Array

_COVERED = ("hinge", "slide")


def compiler(suffix: str) -> Engine | None:
    """An engine that is there and compiles files with that ending."""
    able = (engine for engine in readers(suffix) if suffix in engine.compiles)
    return next((engine for engine in able if engine.version() is not None), None)


def read_compiled_robot(path: Path) -> Robot:
    """Read a file as an engine compiles it."""
    engine = compiler(path.suffix)
    if engine is None:
        return _refused(path, [f"no engine is installed that compiles {path.suffix} files"])
    try:
        found = engine.compiled(path)
    except EngineError as error:
        # Its message names the file, and the line where it is known.
        place, _, sentence = str(error).removeprefix(f"{path}").partition(": ")
        return _refused(path, [sentence], line=int(place[1:]) if place[1:].isdigit() else 0)
    if sentences := list(_in_the_way(found)):
        return _refused(path, sentences, _left_out(engine, found), found.name)
    return _Builder(found).robot(path, _left_out(engine, found))


def _in_the_way(found: CompiledTree) -> Iterator[str]:
    """What acts and can't be told by equations of the bodies."""
    for what in found.uncovered:
        yield f"{what}: not covered yet"
    joints = [joint for body in found.bodies for joint in body.joints]
    for kind in sorted({joint.kind for joint in joints} - set(_COVERED)):
        names = ", ".join(joint.name or "one without a name" for joint in joints
                          if joint.kind == kind)  # fmt: skip
        yield f"{kind} joints ({names}): not covered yet"
    if not joints:
        yield "it has no joint that moves"


def _left_out(engine: Engine, found: CompiledTree) -> tuple[LeftOut, ...]:
    read = LeftOut(what=f"how {engine.title} compiles the file", count=1, where=())
    return (*(LeftOut(what=what, count=count, where=()) for what, count in found.besides), read)


class _Builder:
    """Links in the engine's order: a body's joints one after the other, the last with its mass."""

    def __init__(self, found: CompiledTree) -> None:
        self._found = found
        self._links: list[Link] = []
        self._lumps: list[Lump] = []
        self._bounds: list[tuple[float, float]] = []

    def robot(self, path: Path, left_out: tuple[LeftOut, ...]) -> Robot:
        """The whole."""
        # Of each of the engine's bodies: the link that it is in, and where its frame is there.
        places: list[tuple[int, Place]] = [(WORLD, HERE)]
        parts = []
        for i, body in enumerate(self._found.bodies, start=1):
            within, place = places[body.parent]
            place = place.of(Place(from_quaternion(np.array(body.turn)), np.array(body.at)))
            for joint in body.joints:
                within, place = self._joint(joint, within, place)
            places.append((within, place))
            lump = _lump(body)
            parts.append(
                Part(name=body.name or f"body_{i}", line=0, mass=lump.mass, center=lump.center,
                     inertia=lump.inertia, body=within)
            )  # fmt: skip
            if within != WORLD:
                self._lumps[within] = self._lumps[within].with_(lump.seen(place))
        links = (
            replace(link, mass=lump.mass, center=lump.center, inertia=lump.inertia)
            for link, lump in zip(self._links, self._lumps, strict=True)
        )
        tree = Tree(links=tuple(links), gravity=np.array(self._found.gravity))
        lower, upper = np.array(self._bounds).T
        return Robot(
            name=self._found.name or path.stem,
            file=path,
            tree=tree,
            parts=tuple(parts),
            limits=(lower, upper),
            home=home_of(tree, (lower, upper)),
            left_out=left_out,
            obstacles=(),
        )

    def _joint(self, joint: CompiledJoint, within: int, place: Place) -> tuple[int, Place]:
        """Add a joint to what a body hangs on; the link, and where the body's frame is in it.

        The link's frame is at the joint's anchor. Its position counts from where the file draws it.
        """
        anchor, axis = np.array(joint.at), np.array(joint.axis)
        at = place.at(anchor)
        rotation = place.rotation
        if joint.kind == "hinge":
            rotation = rotation @ about_axis(axis, np.array(-joint.zero), DOUBLES)
        else:
            at = at - rotation @ axis * joint.zero
        self._links.append(
            Link(
                name=joint.name or f"joint_{len(self._links)}",
                parent=within,
                position=at,
                rotation=rotation,
                kind="hinge" if joint.kind == "hinge" else "slide",
                axis=axis,
                mass=0.0,
                center=np.zeros(3),
                inertia=np.zeros((3, 3)),
                armature=joint.armature,
                damping=joint.damping[0],
                stiffness=joint.stiffness[0],
                rest=(joint.rest,),
            )
        )
        self._lumps.append(NOTHING)
        self._bounds.append(joint.limits or (-np.inf, np.inf))
        return len(self._links) - 1, Place(np.eye(3), -anchor)


def _lump(body: CompiledBody) -> Lump:
    turn: Array = from_quaternion(np.array(body.principal))
    inertia = turn @ np.diag(body.moments) @ turn.T
    return Lump(body.mass, np.array(body.centre), inertia)


def _refused(
    path: Path,
    sentences: list[str],
    left_out: tuple[LeftOut, ...] = (),
    name: str = "",
    line: int = 0,
) -> Robot:
    """Without a tree, for all of these."""
    remedy = "`crosscheck compare` holds it against another file without equations"
    obstacles = [Obstacle(sentence=one, file=path, line=line, remedy=remedy) for one in sentences]
    return refused(path, name or path.stem, obstacles, left_out=left_out)
