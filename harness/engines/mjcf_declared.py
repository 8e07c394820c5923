"""Declarations of an MJCF and its sidecar, for engines whose parsers read a subset.

They include forces on joints: springs, fixed tendons, and actuators at held controls.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.documents.document import Mimic
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from .compiled import CompiledActuator, Numbers
from .mjcf_defaults import Attributes, Defaults, number_of, numbers_of
from .mjcf_inertias import GravityCompensation, compiled_bodies, left_to_compiler, lifts_of
from .mjcf_joints import FREE, HINGE, SLIDE, MjcfJoint, joints_of
from .mjcf_refused import refuse
from .mjcf_source import MjcfSource, read_source_mjcf
from .protocol import Engine, EngineError, ModelSpec, Spring, held_joints
from .urdf_copy import followers_of

_PARAMETERS = 10
"""Numbers of a compiled gain, and of a bias."""

AUTOMATIC = -1.0
"""MuJoCo's exact value for an automatic length; other negative lengths are lengths."""


@dataclass(frozen=True, kw_only=True)
class HeldActuator:
    """An actuator at its control: a held force on a combination of joints, with feedback.

    Attributes:
        joints: names of joints -> coefficient of the combination.
        force: N or N m, along the combination.
        stiffness, damping: loss of force per position and per velocity.
    """

    joints: Mapping[str, float]
    force: float
    stiffness: float
    damping: float


@dataclass(frozen=True, kw_only=True)
class JointForces:
    """A reader of forces; `joints` move, `refs` are the positions of held joints, by name."""

    source: MjcfSource
    defaults: Defaults
    joints: Mapping[str, MjcfJoint]
    refs: Mapping[str, float]

    def springs(self) -> Iterator[Spring]:
        """Yield the springs of slides and hinges."""
        for name, joint in self.joints.items():
            if joint.kind in (SLIDE, HINGE) and joint.stiffness:
                yield Spring({name: 1.0}, joint.stiffness, 0.0, joint.rest)

    def tendons(self) -> Iterator[Spring]:
        """Yield springs and dampers of fixed tendons.

        Raises:
            EngineError: for tendons with other forces.
        """
        for tendon in self.source.root.findall("tendon/*"):
            attributes = self.defaults.attributes(tendon, tag="tendon")
            numbers = {
                key: number_of(self.source, tendon, attributes, key)
                for key in ("stiffness", "damping", "armature")
            }
            for key, flag in (("stiffness", "spring"), ("damping", "damper")):
                numbers[key] *= not self.source.disabled(flag)
            if not any(numbers.values()):
                continue
            if tendon.tag != "fixed" or numbers["armature"]:
                kind = "a tendon with armature" if numbers["armature"] else "a tendon between sites"
                raise self.source.unsupported(tendon, f"{kind} that pulls is not added here")
            shares = self.shares(tendon)
            rest = self._rest(tendon, attributes, shares) if numbers["stiffness"] else 0.0
            yield self._free(shares, numbers["stiffness"], numbers["damping"], rest)

    def shares(self, tendon: XmlElement) -> dict[str, float]:
        """Return the coefficients of a fixed tendon's joints, including held ones."""
        coefficients: dict[str, float] = {}
        for element in tendon.findall("joint"):
            name = element.get("joint", "")
            moved = self.joints.get(name)
            if name not in self.refs and (moved is None or moved.kind not in (SLIDE, HINGE)):
                raise self.source.refused(element, f"{name!r} is neither a slide nor a hinge")
            coefficients[name] = coefficients.get(name, 0.0) + number_of(
                self.source, element, element.attributes, "coef", "nan"
            )
        return coefficients

    def _rest(
        self, tendon: XmlElement, attributes: Attributes, shares: Mapping[str, float]
    ) -> float:
        """Return the relaxed length; -1 stands for the length at the joints' rest positions."""
        length = numbers_of(self.source, tendon, attributes, "springlength", "-1")
        if length[0] != length[-1]:
            raise self.source.unsupported(tendon, "a tendon that is slack between two lengths")
        if length[0] == AUTOMATIC:
            positions = {**self.refs, **{name: one.rest for name, one in self.joints.items()}}
            return sum(share * positions[name] for name, share in shares.items())
        return length[0]

    def _free(self, shares: Mapping[str, float], k: float, c: float, rest: float) -> Spring:
        """Return the spring on the moving joints only."""
        still = sum(share * self.refs[name] for name, share in shares.items() if name in self.refs)
        moving = {name: share for name, share in shares.items() if name not in self.refs}
        return Spring(moving, k, c, rest - still)

    def actuators(
        self, controls: Sequence[float], compiled: Sequence[CompiledActuator]
    ) -> Iterator[HeldActuator]:
        """Yield actuators with an affine law, at these controls, one for each.

        Args:
            controls: one for each actuator.
            compiled: their laws, which depend on classes and, for `dampratio`, on inertias.

        Raises:
            EngineError: for actuators of other laws, and for a wrong number of controls.
        """
        rows = self.source.root.findall("actuator/*")
        if len(controls) != len(rows):
            wanted = "1 number" if len(rows) == 1 else f"{len(rows)} numbers"
            sentence = f"[settings] controls is {list(controls)}; expected {wanted}"
            raise self.source.refused(rows[0], sentence)
        for element, control, law in zip(rows, controls, compiled, strict=True):
            numbers = self._affine(element, law)
            length, gear = self._length(element), numbers["gear"][0]
            if not {name for name in length if name in self.joints}:
                continue  # the joint is held, so its actuator has no effect
            gain, bias = numbers["gain and bias"][0], numbers["gain and bias"][-_PARAMETERS:]
            bias = bias if "bias affine" in law.kind else (0.0, 0.0, 0.0)
            still = sum(by * self.refs[name] for name, by in length.items() if name in self.refs)
            yield HeldActuator(
                joints={k: gear * by for k, by in length.items() if k not in self.refs},
                force=gain * control + bias[0] + bias[1] * gear * still,
                stiffness=-bias[1],
                damping=-bias[2],
            )

    def _affine(self, element: XmlElement, law: CompiledActuator) -> Mapping[str, Numbers]:
        """Return the numbers of an actuator without a state, whose force is affine."""
        if not {"gain fixed", "dynamics none"} <= {*law.kind} or not (
            {"bias none", "bias affine"} & {*law.kind}
        ):
            raise self.source.unsupported(element, "an actuator with a state or a gain of a law")
        numbers = {**dict(law.numbers), **dict(law.ranges)}
        for key in ("armature", "damping", "delay"):
            if any(numbers.get(key, ())):
                raise self.source.unsupported(element, f"an actuator with {key} is not added here")
        return numbers

    def _length(self, element: XmlElement) -> Mapping[str, float]:
        """Return the combination of joints that it acts on."""
        joint = element.get("joint", element.get("jointinparent", ""))
        if joint in self.refs or (
            joint in self.joints and self.joints[joint].kind in (SLIDE, HINGE)
        ):
            return {joint: 1.0}
        tendon = element.get("tendon", "")
        for fixed in self.source.root.findall("tendon/fixed") if tendon else ():
            if fixed.get("name") == tendon:
                return self.shares(fixed)
        raise self.source.unsupported(element, "an actuator on no slide, hinge or fixed tendon")


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
    inertias: Mapping[XmlElement, RigidBody]
    lifts: tuple[GravityCompensation, ...]

    @property
    def frees(self) -> tuple[MjcfJoint, ...]:
        """The joints of floating bodies."""
        return tuple(one for one in self.joints if one.kind == FREE)

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
        actuators=tuple(_actuators(source, pulls, spec, compiler)),
        mimics=tuple(_mimics(source, joints, refs, followers)),
        inertias=inertias,
        lifts=tuple(lifts_of(source, inertias)),
    )


def _actuators(
    source: MjcfSource, pulls: JointForces, spec: ModelSpec, compiler: Engine | None
) -> Iterator[HeldActuator]:
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
        if compiler is None or compiler.version() is None:
            lacking = "an installed engine that compiles MJCFs"
            raise source.unsupported(rows[0], f"the law of an actuator needs {lacking}")
        yield from pulls.actuators(given, compiler.compiled(source.path).actuators)


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
