"""Prepared targets: the equations of a system folder or a robot file, solved once for all checks.

A folder declares energies, with motions, or bodies; a robot file states bodies. Models of bodies
are checked at sampled states, since a robot has more joints than one motion can excite.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Self, TypeVar

import msgspec
import numpy as np
import sympy as sp

from physics_crosscheck.harness.engines.protocol import ARMATURES, EngineError, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.inertias import impossible_links
from physics_crosscheck.harness.modelfiles.readers import (
    RobotError,
    hold_joints,
    read_robot,
    robot_system,
)
from physics_crosscheck.harness.modelfiles.robot import PlacedShape, Robot, home_of
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, coordinate_map
from physics_crosscheck.harness.numerics.differences import (
    MAX_PERTURBATION,
    OperatingPoint,
    moved,
    slopes,
)
from physics_crosscheck.harness.records import system as records
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.outcome import FLOOR
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.equations import VectorFunction
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.laws.motion import ends_through, hybrid_of, solve_events
from physics_crosscheck.reference.load import load_declaration, load_system, with_location
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem, TreeSystem
from physics_crosscheck.reference.mechanism.bodies import RigidBody
from physics_crosscheck.reference.mechanism.chart import Coupled
from physics_crosscheck.reference.mechanism.declaration import DeclarationError, Scenario
from physics_crosscheck.reference.mechanism.laws import SoftLaw
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.next_state import (
    Stepped,
    SteppedBodies,
    SteppedEquations,
    stepped_equations,
)
from physics_crosscheck.reference.solving.samples import LockedError, samples, solved
from physics_crosscheck.reference.solving.segments import Motion, Segments, even_indices
from physics_crosscheck.reference.solving.solve import solve
from physics_crosscheck.reference.solving.variants import Variants, variants
from .findings import format_omission, robot_findings, settings_of, sidecar_beside
from .followers import Followers
from .law_states import KeptSteps
from .plausibility.kinds import plausibility_findings
from .scene import scene_record
from .system_record import system_record, tree_record
from .verdict import component_scale, nonzero_scale

SCENARIO = "states"
"""Name of the sampled states of bodies, in place of a scenario."""

FLOATING = "floating states"
"""The same for a URDF whose root link moves freely."""

STATES = 40
"""Number of segments of a check. They are selected so that each number shows as well as with a
hundred random segments.
"""

SEED = 1

STEPPED = 100
"""Maximum number of states of a motion at which accelerations and single steps are compared."""

VISITED = 200
"""Number of states of all motions at which compiled terms and poses are compared."""


MassAndForce = Callable[[Array, Array], tuple[Array, Array]]
"""Mass matrices and forces at states (B, 2n) and inputs (B, m)."""


@dataclass(frozen=True, kw_only=True)
class Prepared(ABC):
    """A target's equations, solved; picklable.

    Attributes:
        place: the system folder, or the robot file.
        record: its entry in results.json.
        reads: states of the files that `system.py` read, by name relative to the folder.
    """

    place: Path
    record: records.SystemResult
    reads: Mapping[str, str]

    def under_laws(self, sidecar: Sidecar | None) -> Self:
        """Return the target whose motions follow the soft laws that a sidecar states."""
        return self

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates, (n,)."""

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the state's components: positions, then velocities, (2n,)."""
        return (*self.names, *(f"{name}_dot" for name in self.names))

    @abstractmethod
    def spec(self, sidecar: Sidecar | None, engine: str) -> ModelSpec:
        """Return what an engine loads: the model of a sidecar, or the file itself."""

    @abstractmethod
    def coordinates(
        self, sidecar: Sidecar | None, file: Path, engine: str, there: tuple[str, ...]
    ) -> CoordinateMap:
        """Build the map to the coordinates `there` of a loaded model.

        Raises:
            SidecarError, EngineError: if they don't fit.
        """

    @abstractmethod
    def segments(self, scenario: str) -> Segments:
        """Return the segments of a scenario, solved."""

    @property
    @abstractmethod
    def stepped(self) -> Stepped | None:
        """The equations in the form for integrators; None if they depend on time."""

    @abstractmethod
    def states(self, scenario: str) -> tuple[Array, Array]:
        """Return states of these segments, (B, 2n), and the inputs there, (B, m)."""

    @abstractmethod
    def mechanics(self) -> MassAndForce:
        """Return M, (B, n, n), and the forces of M a = f, (B, n), as a function of states and
        inputs.
        """

    @abstractmethod
    def motion(self, scenario: str) -> Motion | str | None:
        """Return the motion for full runs, or why it can't be solved; None without one."""

    @abstractmethod
    def amplitude_of(self, motion: Motion) -> Array:
        """Return the scale of global errors of that motion, (2n,); nowhere zero."""

    @abstractmethod
    def power(self) -> VectorFunction | None:
        """Return (energy, supplied, dissipated) of (q, v, u, (t,)); None where events take some."""


@dataclass(frozen=True, kw_only=True)
class PreparedSystem(Prepared):
    """A folder that declares energies, solved.

    Attributes:
        motions: reference motion by scenario.
        amplitude: largest magnitude over all scenarios, (2n,); nowhere zero.
        push: largest input over all scenarios, (inputs,).
        numeric_power: (energy, supplied, dissipated) of (q, v, u, (t,)).
        steps: the equations in the form for integrators; None if they depend on time, or switch.
        variants: the equations with every constant and some missing terms free.
        ideal: whether every model is judged by the rigid motions.
        laws: soft laws of a model, by interaction, in place of the rigid ones.
    """

    system: System
    motions: Mapping[str, Motion]
    amplitude: Array
    push: Array
    numeric_power: NumericFunction
    equilibria: tuple[OperatingPoint, ...]
    steps: SteppedEquations | None
    variants: Variants
    ideal: bool = False
    laws: Mapping[str, SoftLaw] = field(default_factory=dict)

    def under_laws(self, sidecar: Sidecar | None) -> Self:
        """Return the target whose motions follow the soft laws that a sidecar states.

        Raises:
            SidecarError: for a law of an interaction that the system lacks.
        """
        laws = {} if sidecar is None or self.ideal else sidecar.laws
        names = {one.name for one in self.system.interactions}
        for name in sorted(set(laws) - names):
            assert sidecar is not None
            place = sidecar.entry("laws", name)
            raise SidecarError(f"{place}: {self.system.name} has no interaction of that name")
        return replace(self, laws=laws) if laws else self

    @property
    def compared(self) -> Mapping[str, Motion]:
        """The motions that a model is compared with, by scenario."""
        return {name: self.segments(name) for name in self.motions}

    @cached_property
    def _by_law(self) -> dict[str, Motion]:
        """Motions under soft laws, by scenario, as they are requested."""
        return {}

    @cached_property
    def visited(self) -> Array:
        """States that the motions pass, (S, 2n): evenly spread, and each component's extremes."""
        motions = self.motions.values()
        states = np.concatenate([m.nodes.reshape(-1, m.nodes.shape[-1]) for m in motions])
        extremes = np.concatenate([states.argmax(axis=0), states.argmin(axis=0)])
        # Regularly spaced states for contacts, and the extremes of each component for limits.
        spread = np.linspace(0, len(states) - 1, VISITED).astype(int)
        visited: Array = states[np.unique(np.concatenate([extremes, spread]))]
        return visited

    @property
    def fastest(self) -> float:
        """Fastest rate along the motions, rad/s."""
        return max(motion.fastest for motion in self.motions.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the declared coordinates."""
        return tuple(c.name for c in self.system.coordinates)

    def spec(self, sidecar: Sidecar | None, engine: str) -> ModelSpec:
        """Return what an engine loads."""
        assert sidecar is not None  # a model of a folder has one
        return sidecar.spec(engine)

    def coordinates(
        self, sidecar: Sidecar | None, file: Path, engine: str, there: tuple[str, ...]
    ) -> CoordinateMap:
        """Build the declared map."""
        assert sidecar is not None
        return coordinate_map(self.system, sidecar, there)

    def segments(self, scenario: str) -> Motion:
        """Return the motion of a scenario, under the soft laws of the model if it has any.

        Raises:
            EventError: if the laws have no motion to compare.
        """
        if not self.laws:
            return self.motions[scenario]
        if scenario not in self._by_law:
            equations = derive(self.system)
            with with_location(self.place):
                motion = solve_events(equations, self.system.scenario(scenario), self.laws)
            others = [other for name, other in self.motions.items() if name != scenario]
            self._by_law[scenario] = replace(motion, scale=component_scale(motion, others))
        return self._by_law[scenario]

    def ends_through_events(self, segments: Segments) -> Array:
        """Return the ends of segments of a scenario by contacts, friction and drives, (K, 2n).

        Raises:
            EventError: for a start from which the motion is not unique, or does not exist.
        """
        scenario = self.system.scenario(segments.name)
        return ends_through(hybrid_of(derive(self.system), scenario, self.laws), segments)

    @property
    def stepped(self) -> Stepped | None:
        """The equations in the form for integrators."""
        return self.steps

    def states(self, scenario: str) -> tuple[Array, Array]:
        """Select states spread over the motion."""
        motion = self.motions[scenario]
        some = motion.pick(even_indices(len(motion.t), STEPPED))
        return some.start, some.start_inputs

    def mechanics(self) -> MassAndForce:
        """Compile the derived terms."""
        equations, n = derive(self.system), len(self.names)
        entries: list[sp.Expr] = [*equations.mass, *equations.force]
        compiled = equations.compile(entries)

        def mechanics(states: Array, inputs: Array) -> tuple[Array, Array]:
            both = compiled(states[:, :n], states[:, n:], inputs, np.zeros((len(states), 1)))
            return both[:, : n * n].reshape(-1, n, n), both[:, n * n :]

        return mechanics

    def motion(self, scenario: str) -> Motion:
        """Return the motion of the scenario itself."""
        return self.segments(scenario)

    def amplitude_of(self, motion: Motion) -> Array:
        """Return its amplitude, with a share of that of all scenarios as lower bound."""
        scale: Array = np.maximum(motion.amplitude, FLOOR * self.amplitude)
        return scale

    def power(self) -> NumericFunction | None:
        """Return energy, supplied and dissipated power."""
        return None if self.system.interactions else self.numeric_power


@dataclass(frozen=True, kw_only=True)
class PreparedTree(Prepared):
    """A folder that declares bodies, or a robot file, solved at sampled states.

    Attributes:
        system: the tree as a system.
        scenario: name of the states.
        samples: the states, and the states that the equations reach from them.
        followers: map to the joints of an engine.
        rest: the motion from rest, or why it can't be solved; None if none was requested.
        home: the middle of the joints' ranges, (n,).
        settings: settings of the engines; those of a folder's models are in sidecars.
        left_out: statements of the file that the equations omit.
        findings: what is wrong with the file by reading it.
        lines: line of each link of the file, by name.
        placed: shapes and sites of the file.
        smooth: whether whole steps, with limits, friction, contacts and drives, are left out.
        steps: whole steps of the file.
    """

    system: TreeSystem
    scenario: str
    samples: Segments
    followers: Followers
    home: Array
    rest: Motion | str | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    findings: tuple[AuditFinding, ...] = ()
    lines: Mapping[str, int] = field(default_factory=dict)
    placed: tuple[PlacedShape, ...] = ()
    smooth: bool = False
    steps: KeptSteps = field(default_factory=KeptSteps)

    @property
    def tree(self) -> Tree:
        """The tree of the equations."""
        return self.system.tree

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the independent joint coordinates."""
        return tuple(c.name for c in self.system.coordinates)

    def spec(self, sidecar: Sidecar | None, engine: str) -> ModelSpec:
        """Return what an engine loads."""
        if sidecar is not None:
            return sidecar.spec(engine)
        named = engines()[engine]
        settings = {**named.settings_for(self.place.suffix), **self.settings}
        if added := named.armatures(self.place):
            settings[ARMATURES] = added
        return ModelSpec(path=self.place, settings=settings)

    def with_armatures(self, added: Mapping[str, float]) -> PreparedTree:
        """Return it with inertias added to joints' own motions, solved from the same states."""
        if not added:
            return self
        links = (replace(one, armature=added.get(one.name, 0.0)) for one in self.tree.links)
        system = replace(self.system, tree=replace(self.tree, links=tuple(links)))
        drawn = self.samples
        length = float(drawn.lengths[0])
        ends = solved(TreeEquations(system), drawn.start, drawn.start_inputs, length, drawn.fastest)
        rest = None if self.rest is None else "rotors of one engine alone act"
        return replace(self, system=system, samples=ends, rest=rest, steps=KeptSteps())

    def coordinates(
        self, sidecar: Sidecar | None, file: Path, engine: str, there: tuple[str, ...]
    ) -> CoordinateMap:
        """Match joints by name."""
        return self.followers.map(joints_of(self.followers, there, file, engine), self.names)

    @cached_property
    def equilibria(self) -> tuple[OperatingPoint, ...]:
        """The home position, held by forces on the joints."""
        return (_held(self),)

    @property
    def amplitude(self) -> Array:
        """Largest magnitude over all states, (2n,); nowhere zero."""
        return nonzero_scale(np.max(np.abs(self.samples.start), axis=0))

    @property
    def push(self) -> Array:
        """Largest force over all states, (n,); nowhere zero."""
        largest = np.max(np.abs(self.samples.start_inputs), axis=0)
        return np.where(largest > 0, largest, 1.0)

    @cached_property
    def scale(self) -> Array:
        """Scale of the defects: the largest displacement of each component, (2n,)."""
        return nonzero_scale(self.samples.movement)

    def segments(self, scenario: str) -> Segments:
        """Return the sampled segments, each under its own forces."""
        return replace(self.samples, scale=self.scale)

    @property
    def stepped(self) -> Stepped | None:
        """The equations in the form for integrators."""
        return SteppedBodies(self.tree)

    def states(self, scenario: str) -> tuple[Array, Array]:
        """Return the sampled states, and their forces."""
        return self.samples.start, self.samples.start_inputs

    def mechanics(self) -> MassAndForce:
        """Return the terms by recursion."""
        equations, n = TreeEquations(self.system), len(self.names)
        return lambda states, inputs: equations.mechanics(states[:, :n], states[:, n:], inputs)

    @property
    def visited(self) -> Array:
        """The sampled states, (S, 2n)."""
        return self.samples.start

    @property
    def fastest(self) -> float:
        """Fastest rate at the sampled states, rad/s."""
        return self.samples.fastest

    def motion(self, scenario: str) -> Motion | str | None:
        """Return the motion from rest, if one was requested."""
        return self.rest

    def amplitude_of(self, motion: Motion) -> Array:
        """Return its amplitude, with a share of the largest of its kind as lower bound."""
        n, size = len(self.names), motion.amplitude
        largest = np.repeat([size[:n].max(), size[n:].max()], n)
        return nonzero_scale(np.maximum(size, FLOOR * largest))

    def power(self) -> VectorFunction:
        """Return energy, supplied and dissipated power."""
        return TreeEquations(self.system).numeric_power


_P = TypeVar("_P", bound=Prepared)


def joints_of(followers: Followers, there: tuple[str, ...], file: Path, engine: str) -> list[int]:
    """Return the index of the tree's joint for each of an engine's coordinates.

    Raises:
        EngineError: naming the joints that only one side has.
    """
    mine, theirs = set(followers.names), set(there)
    if mine != theirs or len(theirs) != len(there):
        missing, more = sorted(mine - theirs), sorted(theirs - mine)
        parts = [f"it has no {', '.join(missing)}"] if missing else []
        parts += [f"it has the additional {', '.join(more)}"] if more else []
        differences = " and ".join(parts) or "two of its joints have the same name"
        raise EngineError(f"{file}: {engine} builds different joints from it: {differences}")
    return [followers.names.index(name) for name in there]


def prepare(
    place: Path,
    *,
    described: bool = True,
    floating: bool | None = None,
    model: str = "",
    motion: float = 0.0,
    states: int = STATES,
    smooth: bool = False,
    ideal: bool = False,
) -> PreparedSystem | PreparedTree:
    """Read a system folder or a robot file, derive its equations, and solve them.

    Args:
        place: the folder or the file.
        described: whether the record of energies contains a derivation. Formulas take longer than
            all the rest, and only a report shows them.
        floating: whether the root link of a URDF moves freely.
        model: which of several models of an SDFormat file; empty: the only one that moves.
        motion: duration of a motion of bodies from rest, seconds; 0 for none.
        states: number of sampled states of bodies.
        smooth: whether a robot file is checked without limits, friction, contacts and drives only.
        ideal: whether models of a folder are judged by rigid contacts, not by their engines' laws.

    Raises:
        DeclarationError, RobotError, ReferenceError: naming file, line and remedy.
    """
    if place.is_file():
        prepared = prepare_tree(place, floating=floating, model=model, motion=motion, states=states)
        return replace(prepared, smooth=smooth)
    began = time.perf_counter()
    with record_reads(place) as reads:
        declared = load_declaration(place)
    if isinstance(declared, MultibodySystem):
        bodies = _from_bodies(place, declared, motion, states)
        return _finished(bodies, began, reads.states)
    energies = replace(_from_energies(place, declared, described=described), ideal=ideal)
    return _finished(energies, began, reads.states)


def prepare_system(folder: Path, *, described: bool = True) -> PreparedSystem:
    """Prepare a folder that declares energies.

    Raises:
        DeclarationError, ReferenceError: as `prepare`, and if the folder declares bodies.
    """
    began = time.perf_counter()
    with record_reads(folder) as reads:
        system = load_system(folder)
    prepared = _from_energies(folder, system, described=described)
    return _finished(prepared, began, reads.states)


def prepare_tree(
    file: Path,
    *,
    floating: bool | None = None,
    model: str = "",
    motion: float = 0.0,
    states: int = STATES,
) -> PreparedTree:
    """Prepare a robot file.

    Raises:
        RobotError, ReferenceError: naming file, line and remedy.
    """
    began = time.perf_counter()
    robot = read_robot(file, floating=floating, model=model)
    robot, prepared = _solved_robot(robot, motion, states)
    left_out = (*(format_omission(one) for one in robot.left_out), *sidecar_beside(file))
    links = (part.link for part in robot.parts)
    prepared = replace(
        prepared,
        record=_drawn(prepared, links, robot.placed, robot.home),
        settings=settings_of(robot),
        left_out=left_out,
        findings=(*robot_findings(robot), *plausibility_findings(robot)),
        lines=robot.lines,
        placed=robot.placed,
    )
    return _finished(prepared, began, {})


def _solved_robot(robot: Robot, motion: float, states: int) -> tuple[Robot, PreparedTree]:
    """Return a robot, with joints held that their dampers lock, and its solved equations."""
    system, file = robot_system(robot), robot.file
    try:
        scenario = scenario_of(robot)
        return robot, _solved(file, system, robot.limits, scenario, motion, states)
    except LockedError as error:
        held = hold_joints(robot, error.joints)
        if held.tree is None or not held.tree.links:
            raise RobotError(f"{file}: no other joint moves: {error}") from None
        return _solved_robot(held, motion, states)
    except ReferenceError as error:
        impossible = impossible_links(robot)
        message = "; ".join([*map(str, impossible), f"{file}: {error}"])
        raise RobotError(message, impossible) from None


def scenario_of(robot: Robot) -> str:
    """Return the name of a robot's states."""
    return FLOATING if robot.floats else SCENARIO


def _finished(prepared: _P, began: float, reads: Mapping[str, str]) -> _P:
    record = msgspec.structs.replace(prepared.record, seconds=time.perf_counter() - began)
    return replace(prepared, record=record, reads=reads)


def _from_bodies(
    folder: Path, declared: MultibodySystem, motion: float, states: int
) -> PreparedTree:
    try:
        limits = declared.assembled.limits
        solved = _solved(folder, declared.tree_system, limits, SCENARIO, motion, states)
        return replace(solved, record=_drawn(solved, declared.bodies))
    except ReferenceError as error:
        raise ReferenceError(f"{folder / 'system.py'}: {error}") from None


def _drawn(
    solved: PreparedTree,
    bodies: Iterable[RigidBody],
    shapes: Sequence[PlacedShape] = (),
    home: Array | None = None,
) -> records.SystemResult:
    """Return the record with the scene of the bodies."""
    scene = scene_record(solved.tree, solved.samples, bodies, shapes, home)
    return msgspec.structs.replace(solved.record, scene=scene)


def _solved(
    place: Path,
    system: TreeSystem,
    limits: tuple[Array, Array],
    scenario: str,
    motion: float,
    states: int,
) -> PreparedTree:
    """Select states that make a tree's numbers distinguishable, and solve the equations from them.

    Raises:
        ReferenceError: if a joint moves nothing that has mass.
    """
    kept = Coupled(system.tree).kept
    within, home = np.stack(limits, axis=1)[kept], home_of(system.tree, limits)[kept]
    drawn = samples(TreeEquations(system), within, home, states, SEED)
    return PreparedTree(
        place=place,
        record=tree_record(str(place), system, drawn, scenario, motion),
        reads={},
        system=system,
        scenario=scenario,
        samples=drawn,
        followers=Followers.build(system.tree),
        home=home,
        rest=_motion_from_rest(system, drawn, motion) if motion else None,
    )


def _held(target: PreparedTree) -> OperatingPoint:
    """Linearize about the home position, at rest, held by forces on the joints.

    A and B are differences of accelerations; an engine's are those of the same steps.
    """
    equations, n, position = TreeEquations(target.system), len(target.names), target.home
    still = np.zeros((1, n))
    hold = equations.forces_for(position[None], still, still)[0]
    sizes = np.max(np.abs(target.samples.start), axis=0)
    deltas = MAX_PERTURBATION * np.concatenate(
        [np.minimum(np.where(sizes > 0, sizes, 1.0), 1.0), np.maximum(np.abs(hold), 1.0)]
    )
    by = moved(deltas)
    q, v = position + by[:, :n], by[:, n : 2 * n]
    accelerations = equations.pushed_acceleration(q, v, hold + by[:, 2 * n :])
    rates = np.concatenate([v, accelerations], axis=1)
    both = slopes(rates, np.zeros_like(rates), deltas).value
    lower = both[n:, : 2 * n]
    mass = np.asarray(np.linalg.inv(both[n:, 2 * n :]), dtype=np.float64)
    matrices: dict[str, Array] = {
        "A": both[:, : 2 * n], "B": both[:, 2 * n :], "M": mass, "K": -mass @ lower[:, :n],
        "C": -mass @ lower[:, n:], "Cy": np.zeros((0, 2 * n)), "D": np.zeros((0, n)),
    }  # fmt: skip
    return OperatingPoint(
        name="home, held by forces",
        position=position,
        hold=hold,
        matrices=matrices,
        amplitude=target.amplitude,
        push=target.push,
    )


def _motion_from_rest(system: TreeSystem, drawn: Segments, seconds: float) -> Motion | str:
    """Solve the motion from rest at the first of the sampled positions, or return why not."""
    scenario = Scenario(
        "motion",
        "from rest, under gravity and the mechanism's own forces",
        q={c: float(q) for c, q in zip(system.coordinates, drawn.start[0], strict=False)},
        v=dict.fromkeys(system.coordinates, 0.0),
        inputs={},
        duration=seconds,
    )
    try:
        return solve(TreeEquations(system), scenario)
    except (DeclarationError, ReferenceError) as error:
        return str(error)


def scaled(motions: Mapping[str, Motion]) -> dict[str, Motion]:
    """Return the motions of a system, each with its scale, which depends on the others."""
    return {
        name: replace(
            motion,
            scale=component_scale(motion, [m for other, m in motions.items() if other != name]),
        )
        for name, motion in motions.items()
    }


def _from_energies(folder: Path, system: System, *, described: bool) -> PreparedSystem:
    """Derive, linearize and solve every scenario.

    Raises:
        DeclarationError, ReferenceError: naming what is wrong and where.
    """
    equations = derive(system)
    with with_location(folder):
        linear = tuple(linearize(equations, e) for e in system.equilibria)
        follow = solve_events if system.interactions else solve
        motions = scaled({s.name: follow(equations, s) for s in system.scenarios})
    pushes = [np.max(np.abs(m.inputs(m.t)), axis=0, initial=0.0) for m in motions.values()]
    push = np.max(pushes, axis=0)
    push = np.where(push > 0, push, 1.0)
    amplitude = nonzero_scale(np.max([m.amplitude for m in motions.values()], axis=0))
    with with_location(folder):
        record = system_record(folder, equations, linear, motions, described=described)
    return PreparedSystem(
        place=folder,
        record=record,
        reads={},
        system=system,
        motions=motions,
        amplitude=amplitude,
        push=push,
        numeric_power=equations.numeric_power,
        equilibria=tuple(
            OperatingPoint(
                name=e.equilibrium,
                position=e.position,
                hold=np.zeros(len(push)),
                matrices=e.arrays,
                amplitude=amplitude,
                push=push,
            )
            for e in linear
        ),
        steps=None if system.interactions else stepped_equations(equations),
        # Numbers of a file explain motions that switch; free constants of one mode would mislead.
        variants=Variants((), equations.numeric_acceleration)
        if system.interactions
        else variants(equations, amplitude),
    )
