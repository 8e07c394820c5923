"""Declarations of an MJCF and its sidecar, for engines whose parsers read a subset."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.compiled import CompiledBody
from physics_crosscheck.harness.engines.mjcf_defaults import Defaults, numbers_of
from physics_crosscheck.harness.engines.mjcf_inertias import (
    GravityCompensation,
    compiled_bodies,
    left_to_compiler,
    lifts_of,
)
from physics_crosscheck.harness.engines.mjcf_joints import FREE, HINGE, SLIDE, MjcfJoint, joints_of
from physics_crosscheck.harness.engines.mjcf_pulls import HeldActuator, JointForces
from physics_crosscheck.harness.engines.mjcf_refused import refuse
from physics_crosscheck.harness.engines.mjcf_source import MjcfSource, read_source_mjcf
from physics_crosscheck.harness.engines.protocol import (
    Engine,
    EngineError,
    ModelSpec,
    Spring,
    held_joints,
)
from physics_crosscheck.harness.engines.urdf import Mimic
from physics_crosscheck.harness.engines.urdf_copy import followers_of


@dataclass(frozen=True, kw_only=True)
class DeclaredMjcf:
    """A parsed file.

    Attributes:
        source: the file.
        defaults: its classes.
        joints: moving joints, in the order of their bodies.
        held: joints that stay at their drawn positions.
        springs: of single joints.
        tendons: springs and dampers of joint combinations.
        actuators: at their held controls.
        mimics: joints that follow others, limited by the setting `couplings`.
        inertias: bodies whose inertias the copy takes from another engine's compiler.
        lifts: gravity compensation.
    """

    source: MjcfSource
    defaults: Defaults
    joints: tuple[MjcfJoint, ...]
    held: tuple[MjcfJoint, ...]
    springs: tuple[Spring, ...]
    tendons: tuple[Spring, ...]
    actuators: tuple[HeldActuator, ...]
    mimics: tuple[Mimic, ...]
    inertias: Mapping[XmlElement, CompiledBody]
    lifts: tuple[GravityCompensation, ...]

    @property
    def root(self) -> MjcfJoint | None:
        """The joint of the floating body."""
        return next((one for one in self.joints if one.kind == FREE), None)

    @property
    def singles(self) -> tuple[MjcfJoint, ...]:
        """Slides and hinges."""
        return tuple(one for one in self.joints if one.kind != FREE)


def declared_mjcf(
    spec: ModelSpec, title: str, compiler: Engine | None, no_fromto: Collection[str]
) -> DeclaredMjcf:
    """Read an MJCF and its sidecar's declarations.

    Args:
        spec: the file.
        title: of the engine that reads it.
        compiler: another engine, for inertias that parsers can't compute, or None.
        no_fromto: shapes whose `fromto` the parser ignores.

    Raises:
        EngineError: naming file, line and setting, also for elements that these engines can't
            represent.
    """
    source = read_source_mjcf(spec.path)
    defaults = Defaults(source)
    everything, held = joints_of(source, defaults), held_joints(spec)
    for name in set(held) - {one.name for one in everything}:
        raise EngineError(f"{spec.path}.toml: [settings] held names {name!r}, which is not a joint")
    refuse(source, everything, title)
    needed = left_to_compiler(source, defaults, everything, no_fromto)
    inertias = compiled_bodies(source, needed, compiler, title)
    joints = {one.name: one for one in everything if one.name not in held}
    still = tuple(one for one in everything if one.name in held)
    refs = {one.name: one.ref for one in still}
    pulls = JointForces(source=source, defaults=defaults, joints=joints, refs=refs)
    followers = followers_of(spec.settings, f"{spec.path}.toml")
    return DeclaredMjcf(
        source=source,
        defaults=defaults,
        joints=tuple(joints.values()),
        held=still,
        springs=tuple(pulls.springs()),
        tendons=tuple(pulls.tendons()),
        actuators=tuple(_actuators(source, pulls, spec)),
        mimics=tuple(_mimics(source, joints, refs, followers)),
        inertias=inertias,
        lifts=tuple(lifts_of(source, inertias)),
    )


def _actuators(source: MjcfSource, pulls: JointForces, spec: ModelSpec) -> Iterator[HeldActuator]:
    """Yield actuators at held controls; the setting `smooth` is required."""
    rows, controls = source.root.findall("actuator/*"), spec.settings.get("controls")
    if rows and not spec.settings.get("smooth", False):
        raise source.unsupported(
            rows[0], "it has actuators, but crosscheck applies inputs to joints; remove them"
        )
    if controls is not None and not _numbers(controls):
        wanted = "1 number" if len(rows) == 1 else f"{len(rows)} numbers"
        problem = f"[settings] controls is {controls!r}; expected {wanted}"
        raise EngineError(f"{spec.path}.toml: {problem}")
    if rows and spec.settings.get("actuators", True) and not source.disabled("actuation"):
        given = controls if isinstance(controls, list) else [0.0] * len(rows)
        yield from pulls.actuators(given)


def _numbers(given: object) -> bool:
    return isinstance(given, list) and all(type(one) in (int, float) for one in given)


def _mimics(
    source: MjcfSource,
    joints: Mapping[str, MjcfJoint],
    still: Collection[str],
    followers: Collection[str] | None,
) -> Iterator[Mimic]:
    """Yield the mimics of linear equalities of two joints.

    Raises:
        EngineError: for other active equalities.
    """
    rows = [
        equality
        for equality in source.root.findall("equality/*")
        if equality.get("active") != "false"
    ]
    mimics: dict[str, Mimic] = {}
    if source.disabled("equality", "constraint"):
        rows = []
    for equality in rows:
        name = equality.get("joint1", "")
        if followers is not None and (equality.tag != "joint" or name not in followers):
            continue
        if name in still or equality.get("joint2", "") in still:
            continue  # Held joints are removed together with the equalities that name them.
        if name in mimics:
            raise source.unsupported(equality, f"joint {name!r} follows two leaders")
        mimics[name] = _mimic(source, joints, equality)
    for name in sorted(set(followers or ()) - set(mimics)):
        raise EngineError(f"{source.path}: no equality of two joints makes joint {name!r} follow")
    yield from mimics.values()


def _mimic(source: MjcfSource, joints: Mapping[str, MjcfJoint], equality: XmlElement) -> Mimic:
    ends = [joints.get(equality.get(key, "")) for key in ("joint1", "joint2")]
    if equality.tag != "joint":
        raise source.unsupported(equality, f"an equality <{equality.tag}> is not added here")
    pair = [end for end in ends if end is not None and end.kind in (SLIDE, HINGE)]
    if len(pair) != 2:
        raise source.unsupported(equality, "an equality of other than two slides or hinges")
    offset, slope, *higher = (
        *numbers_of(source, equality, equality.attributes, "polycoef", "0 1"),
        0.0,
        0.0,
    )
    if any(higher):
        raise source.unsupported(equality, "an equality that is not linear")
    follower, leader = pair
    start = follower.ref + offset - slope * leader.ref
    return Mimic(follower.name, leader.name, slope, start)
