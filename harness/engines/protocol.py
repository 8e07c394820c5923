"""The engine protocol: the interface of an adapter, without knowledge of a system's equations.

An adapter turns a model file into a `LoadedModel` that rolls out. All engine knowledge belongs
there. An adapter never sees a system's constants, never interpolates, and counts steps in integers.
Required methods are abstract; everything else has a default. Third parties add an adapter through
the entry point `crosscheck.engines`. `harness.engines.known_answer` is an example, and
`harness.engines.conformance` checks an adapter.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.errors import FileError
from physics_crosscheck.reference.mechanism.laws import ContactPoint, Laws, Rules, Substeps
from physics_crosscheck.reference.mechanism.planar import PlanarContact, PlanarLaws
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia
from .compiled import CompiledTree
from .remark import Remark


@dataclass(frozen=True, kw_only=True)
class StepRule:
    """M(q) a = f(q, v), with the engine's documented step.

    Velocities of a ball or free joint are angular, about the axes of the child body; the velocity
    of its origin is along the axes of the parent body. A step rotates the body about one axis.

    Attributes:
        scheme: v' = v + h a, then q' = q + h v'; or the classical Runge-Kutta method of order 4,
            with the forces of each stage.
        damping: D, (nz, nz), N s/m or N m s/rad, evaluated at the step's end: (M + h D) a = f.
            None: all forces are evaluated at the start.
        stiffness: K, (nz, nz), N/m or N m/rad, of springs that are evaluated there too, with v' as
            the velocity: (M + h D + h^2 K) a = f - h K v. None: all are evaluated at the start.
        by_velocity: D is -df/dv of all forces instead.
        coupled: pairs of coordinates to which D is restricted, (nz, nz). None: all.
        substeps: division of a step in which drives act joint by joint, for slides and hinges.
        besides: other effects that vanish with the step, such as "soft equalities".
    """

    scheme: Literal["semi-implicit Euler", "Runge-Kutta 4"]
    damping: NDArray[np.float64] | None = None
    stiffness: NDArray[np.float64] | None = None
    by_velocity: bool = False
    coupled: NDArray[np.bool_] | None = None
    substeps: Substeps | None = None
    besides: str = ""

    @property
    def name(self) -> str:
        """The rule in words, such as: semi-implicit Euler, dampers at the step's end."""
        if self.substeps is not None:
            return f"{self.scheme} in {self.substeps.count} substeps, drives joint by joint"
        if self.by_velocity:
            return f"{self.scheme}, forces by velocity at the step's end"
        implicit_terms = {"springs": self.stiffness, "dampers": self.damping}
        names = " and ".join(name for name, one in implicit_terms.items() if one is not None)
        return f"{self.scheme}, {names} at the step's end" if names else self.scheme


@dataclass(frozen=True, kw_only=True)
class DefaultLeftOn:
    """An engine's default behaviour, left on.

    Attributes:
        name: of the mistake.
        setting, value: the adapter's setting that reproduces it.
        cause: the name that a diagnosis reports, as in `Model.corrective_settings`.
        whole: whether only whole steps depend on it.
    """

    name: str
    setting: str
    value: object
    cause: str
    whole: bool = False


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A value that a user must state because the engine's default differs, left out.

    Attributes:
        name: of the mistake.
        within: tag of the elements whose children state the value, as attributes.
        defaults: attribute, and setting of the adapter, -> the engine's default.
        cause: the name that a diagnosis reports, as in `Model.corrective_settings`.
    """

    name: str
    within: str
    defaults: Mapping[str, object]
    cause: str


Array = NDArray[np.float64]


class EngineError(FileError, RuntimeError):
    """A model file that an engine cannot load or run; the message names file, place and remedy.

    If memory runs out, an adapter raises MemoryError instead, since the file is not the cause.
    """


class ShapeError(EngineError):
    """A shape of the file with which an engine does not simulate its body."""


class UnsupportedError(EngineError):
    """A valid model file that this engine or its adapter does not support.

    A mistake in the file or in its sidecar is a plain `EngineError`.
    """

    kind = "unsupported"


@dataclass(frozen=True)
class Spring:
    """A spring and damper on a linear combination s of joints: force -k (s - rest) - c ds/dt.

    `joints` maps joint names to coefficients.
    """

    joints: Mapping[str, float]
    stiffness: float
    damping: float
    rest: float


@dataclass(frozen=True)
class ModelSpec:
    """A model file with its sidecar's additions for one engine; `settings` are the engine's own."""

    path: Path
    springs: tuple[Spring, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A small mechanism as a file that an adapter runs, for the conformance suite.

    Its coordinates must be independent of each other near `Model.home`.

    Attributes:
        file: name of the file, with its suffix.
        text: its content.
        springs, settings: as in `ModelSpec`.
    """

    file: str
    text: str
    springs: tuple[Spring, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class StateForce:
    """Inputs whose force on the engine's coordinates depends on the state.

    Attributes:
        inputs: u at the start of each step, (B, n, inputs).
        evaluate: force on the engine's coordinates at one state, (z, u) -> nz numbers. It takes
            plain sequences: small arrays would take most of the time of one call per step.
    """

    inputs: Array
    evaluate: Callable[[Sequence[float], Sequence[float]], Sequence[float]]


Force = Array | StateForce | None
"""Forces on the engine's coordinates, held over each step: (B, n, nz), by state, or None."""


def clip_ranges(free: Array, limits: Array) -> Array:
    """Restrict ranges (nz, 2) to limits; if nothing remains, return the limits."""
    bounded = np.stack(
        [np.maximum(free[:, 0], limits[:, 0]), np.minimum(free[:, 1], limits[:, 1])], 1
    )
    return np.where((bounded[:, 0] < bounded[:, 1])[:, None], bounded, limits)


ARMATURES = "armatures"
"""The setting with `Engine.armatures`."""


def held_joints(spec: ModelSpec) -> tuple[str, ...]:
    """Return the setting `held`: joints to fix at their drawn positions.

    Raises:
        EngineError: if it is not a list of names.
    """
    held = spec.settings.get("held", [])
    if isinstance(held, list) and all(isinstance(name, str) for name in held):
        return tuple(held)
    problem = f"[settings] held is {held!r}; expected a list of joints"
    raise EngineError(f"{spec.path}.toml: {problem}")


class LoadedModel(ABC):
    """A model file, loaded by an engine.

    Attributes:
        coordinates: names of the engine's coordinates, in the order of its states: nz of them.
        step: the time step of the file or its sidecar, seconds.
        integrator: name of the time-stepping method.
        gravity: its components, m/s^2, two in a planar engine; empty if unknown.
        lost_turn: rotation of a step, rad, below which the engine drops its cubic term.
        epsilon: relative rounding of the engine's numbers.
        steps_itself: whether the engine has an integrator; otherwise the adapter has.
    """

    coordinates: tuple[str, ...]
    step: float
    integrator: str
    gravity: tuple[float, ...] = ()
    lost_turn: float = 0.0
    epsilon: float = float(np.finfo(np.float64).eps)
    steps_itself: bool = True

    @abstractmethod
    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return the leading exponent of h in the error of a motion, and the increment to the next.

        `varying_input` is true if an input changes over time and is held over each step.
        """

    @abstractmethod
    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Take n steps of h seconds from B states (q, v), each (B, nz).

        Return positions and velocities after every `every` steps, each (B, n // every, nz). The
        result must not depend on earlier calls. Return values that are not finite unchanged.
        """

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return accelerations at B states without a step, (B, nz), or None if not available.

        For slides and hinges they are second derivatives. For balls and a floating root they are
        the derivatives of the velocities: angular about the body's axes, linear along the world's.
        They are NaN in a state where a soft constraint acts, such as a contact.

        Args:
            z: positions, (B, nz).
            w: their rates, (B, nz).
            force: on the coordinates, (B, nz).
        """
        return None

    def equality_errors(self, z: Array) -> Array | None:
        """Return the distance of B positions from those that equalities require, (B, nz).

        The equalities are those that the engine makes soft and that `accelerations` holds exactly:
        this tests their own numbers. Zero for unconstrained coordinates; None without such
        equalities.

        Args:
            z: positions, (B, nz).
        """
        return None

    @property
    def home(self) -> Array:
        """Positions of the drawn configuration, (nz,)."""
        return np.zeros(len(self.coordinates))

    @property
    def sampling_range(self) -> Array:
        """Range in which positions are sampled at random, (nz, 2)."""
        return np.tile([-1.0, 1.0], (len(self.coordinates), 1))

    @property
    def limits(self) -> Array:
        """Positions between which no joint limit acts, (nz, 2); infinite without a limit."""
        return np.tile([-np.inf, np.inf], (len(self.coordinates), 1))

    def turning_rates(self, z: Array, w: Array) -> Array:
        """Return the rates of rotations that `lost_turn` concerns, (K,), rad/s."""
        return np.zeros(len(z))

    @property
    def corrective_settings(self) -> Mapping[str, Mapping[str, object]]:
        """The engine's own assumptions that the settings leave active: cause -> correcting
        settings.
        """
        return {}

    @property
    def precision_limits(self) -> Mapping[str, Mapping[str, object]]:
        """Documented losses of precision that no number of the file corrects: words -> settings
        without them.
        """
        return {}

    @property
    def integrators(self) -> Mapping[str, Mapping[str, object]]:
        """Other valid integrators of this model: name -> settings that choose it."""
        return {}

    @property
    def step_rule(self) -> StepRule | None:
        """The rule by which the next state follows from the forces, or None if unknown."""
        return None

    @property
    def warnings(self) -> tuple[str, ...]:
        """The engine's warnings so far, one sentence each; they may explain why a motion ends."""
        return ()

    @property
    def reservations(self) -> tuple[str, ...]:
        """Numbers that the engine did not compute from the file itself, one sentence each."""
        return ()

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies and frames with a pose, as `kind:name`, such as `body:rod`; empty if unknown."""
        return ()

    @property
    def inertias(self) -> Mapping[str, SpatialInertia]:
        """Mass and inertia of each body in its frame, by name; empty if unknown.

        Bodies that are fixed to others may be part of these.
        """
        return {}

    @property
    def shapes(self) -> Mapping[str, tuple[float, ...]]:
        """Shapes and sites, as `kind:name`, each with its size in the order of the format, m, or
        with the scale of a mesh.
        """
        return {}

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return the poses of some `places` or `shapes` in the engine's world.

        Positions z are (K, nz).

        Origins are (K, F, 3), m. Rotations are (K, F, 3, 3); their columns are the axes. A planar
        engine uses the plane of x and y.
        """
        raise NotImplementedError(f"{type(self).__name__} has places and no poses")

    def remarks(self, z: Array, w: Array) -> Iterable[Remark]:
        """Yield changes that the engine or the format makes, read from the model without a motion.

        Args:
            z: positions along the motions, (K, nz).
            w: velocities there, (K, nz).
        """
        return ()


class WholeState(NamedTuple):
    """A state of a model with all its forces.

    Velocities are those that the engine stores: angular about a body's axes, linear along the axes
    of its parent. Positions z and velocities m are (nz,).
    """

    z: Array
    m: Array
    controls: Array
    activations: Array

    def driven_by(self, controls: Array, activations: Array) -> WholeState:
        """Return a state with other inputs and states of drives, where these are finite."""
        chosen = np.isfinite(controls) & np.isfinite(self.controls)  # NaN: off
        return self._replace(
            controls=np.where(chosen, controls, self.controls),
            activations=np.where(np.isfinite(activations), activations, self.activations),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class EngineStep:
    """Forces, contacts and the next state that an engine computes at one state.

    Attributes:
        acceleration: derivative of the stored velocities, (nz,).
        unbalanced: force that its solver left, (nz,); of impulses, an error of accelerations.
        contacts: as its collision detector finds them.
        after: the state after one step of the file.
        converged: whether its solver left little.
        solver_residual: force that its solver left, (nz,), with the forces that it does not report;
            None if `unbalanced` is all that is known.
    """

    acceleration: Array
    unbalanced: Array
    contacts: tuple[ContactPoint, ...]
    after: WholeState
    converged: bool = True
    solver_residual: Array | None = None


class WholeModel(ABC):
    """A model file with all its forces, loaded for single steps.

    Attributes:
        coordinates: as in `LoadedModel`.
        step: of the file, s.
        controls, activations: number of inputs and states of actuators.
        edits: options of the file that are changed, as `name=value`.
        uncovered: features of the engine that are switched off, since no law describes them.
        speed: typical velocity to add at a drawn state, m/s and rad/s.
        rules: of an engine whose constraints have settings of its own; None if the file has the
            whole law.
        floor: height of the floor under a floating root, m; None without one.
        point_share: where a contact's position is between its two surfaces, 0 on the first one;
            None if that depends on other numbers.
        standing_cosine: by which a cosine differs from 1 where a tilted cylinder counts as upright.
        frame_errors: largest errors of places of shapes that the engine knows of, m and rad.
        shape_error: by which contacts that it does not compute by a closed form are early, m.
        peer: name of an engine that finds contacts of the same file, as `peer_contacts`.
    """

    coordinates: tuple[str, ...]
    step: float
    controls: int
    activations: int
    edits: tuple[str, ...]
    uncovered: tuple[str, ...] = ()
    speed: float = 0.1
    rules: Rules | None = None
    floor: float | None = None
    point_share: float | None = None
    standing_cosine: float = 0.0
    frame_errors: tuple[float, float] = (0.0, 0.0)
    shape_error: float = 0.0
    peer: str = ""

    def contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts at a state, without forces where that is quicker."""
        return self.evaluate(state).contacts

    def peer_contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts that the other engine finds."""
        return ()

    def finds_exactly(self, first: str, other: str) -> bool:
        """Return whether it computes contacts of two kinds of shapes by a closed form."""
        return True

    def applied(self, laws: Laws) -> Laws:
        """Return the laws of a file with the choices that the engine documents otherwise."""
        return laws

    @property
    @abstractmethod
    def starts(self) -> Iterable[WholeState]:
        """States of the file at rest: its drawn configuration first."""

    @abstractmethod
    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps."""

    @abstractmethod
    def evaluate(self, state: WholeState) -> EngineStep:
        """Return accelerations, contacts and the next state."""

    def set_step(self, h: float) -> bool:
        """Take steps of h seconds from now on; return False if the model can't."""
        return False


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarEngineStep:
    """A step of bodies in a plane.

    Attributes:
        contacts: of the step, in the order in which the engine corrects them.
        places, velocities: after it: origins and angles of the bodies, and their rates, (N, 3).
    """

    contacts: tuple[PlanarContact, ...]
    places: Array
    velocities: Array


class PlanarWhole(ABC):
    """A file of bodies in a plane with all its forces, loaded for steps from given states.

    Attributes:
        laws: the file's numbers.
        home, speeds: places of the bodies as built, and their rates, (N, 3).
        numbers: values of whole steps by the cause of a wrong one, as in `DefaultLeftOn`.
        edits, uncovered: as in `WholeModel`; nothing is compared if something is uncovered.
    """

    laws: PlanarLaws
    home: Array
    speeds: Array
    numbers: Mapping[str, float] = MappingProxyType({})
    edits: tuple[str, ...] = ()
    uncovered: tuple[str, ...] = ()

    @property
    @abstractmethod
    def acts(self) -> bool:
        """True if shapes can touch, or joints have limits or motors."""

    @property
    @abstractmethod
    def pairs(self) -> Iterator[tuple[int, int]]:
        """Pairs of shapes that can touch, by index."""

    @abstractmethod
    def moved(self, places: Array, velocities: Array, steps: int) -> tuple[Array, Array]:
        """Return places and velocities, (N, 3) each, after some steps."""

    @abstractmethod
    def evaluate(self, places: Array, velocities: Array) -> tuple[PlanarEngineStep, ...]:
        """Return the steps from a state without impulses."""


class Engine(ABC):
    """An adapter: its names, formats and capabilities, and how to load a model file.

    Attributes:
        name: short name, as in sidecars and results.
        title: the name in sentences.
        formats: suffixes of the files that it reads, such as ".urdf".
        extra: the extra of this package that installs its engine, if it is not in the extra
            `engines`; if it is missing, sidecars that name it run without it.
        distribution: the engine's name in a package index, if it differs from `name`.
        syntax: for an own format, the suffix of a format with the same syntax: ".xml", ".py" or
            ".toml". Its numbers then have addresses, for bindings and causes.
        capabilities: short phrases for `crosscheck engines`.
        preferred: the formats for which it precedes other engines.
        on_request: whether robot files without a reference run in it only if the user names it,
            since it compiles each for minutes.
        banner: the beginning of a line that it prints in every process; empty for no such line.
        default_settings_note: its default step and gravity, for files and sidecars without them.
        stated_settings: settings that a new sidecar states although they have defaults.
        massless_link_default: its mass for a fixed URDF link without one; empty for no mass.
        takes_springs: the formats in which it applies a sidecar's springs; in others they are
            refused before a file is loaded.
        ignores: numbers of its formats that it ignores, such as "dynamics@friction".
        non_physical: the purpose of numbers that need not affect a motion, by a regular expression
            of the tags that lead to them, as in `robot/link/visual/.*`.
        choices: a regular expression of whole numbers that select options and measure nothing.
        compiles: the formats that `compiled` reads.
        places: the formats whose shapes and sites its models report.
        switches: the settings that it supports, among `smooth`, `couplings`, `held` (joints fixed
            at their drawn positions), `actuators` (whether they act), `controls` (held inputs) and
            `activations` (initial states of actuators, which then move).
        usual_mistakes: typical mistakes of its users that are not caused by a format.
        unfollowed: kinds of advice about a file that are faults here, since another model moves.
        compilers: engines whose `compiled` reads a format, by suffix; set by the registry. An
            adapter that edits a file may use inertias that one of them compiles.
    """

    name: str
    title: str
    formats: tuple[str, ...]
    extra: str = ""
    distribution: str = ""
    syntax: Mapping[str, str] = MappingProxyType({})
    capabilities: tuple[str, ...] = ()
    preferred: tuple[str, ...] = ()
    on_request: bool = False
    banner: str = ""
    default_settings_note: str = ""
    stated_settings: Mapping[str, object] = MappingProxyType({})
    massless_link_default: str = ""
    takes_springs: tuple[str, ...] = ()
    ignores: frozenset[str] = frozenset()
    non_physical: Mapping[str, str] = MappingProxyType({})
    choices: str = ""
    compiles: tuple[str, ...] = ()
    places: tuple[str, ...] = ()
    switches: frozenset[str] = frozenset()
    usual_mistakes: tuple[DefaultLeftOn | LeftOut, ...] = ()
    unfollowed: frozenset[str] = frozenset()
    compilers: Mapping[str, Engine] = MappingProxyType({})

    @abstractmethod
    def version(self) -> str | None:
        """Return the version of the engine, or None if it is not installed."""

    @abstractmethod
    def load(self, spec: ModelSpec) -> LoadedModel:
        """Load a model file.

        Raises:
            EngineError: with file, place and remedy.
        """

    def load_whole(self, spec: ModelSpec) -> WholeModel | None:
        """Load a file with all its forces; None if their law is not documented here.

        Raises:
            EngineError: with file, place and remedy.
        """
        return None

    def load_planar(self, spec: ModelSpec, model: LoadedModel | None = None) -> PlanarWhole | None:
        """Load a file of bodies in a plane with all its forces; None for other engines.

        Args:
            spec: the file.
            model: it, if it is loaded.

        Raises:
            EngineError: with file, place and remedy.
        """
        return None

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return settings that files of a format can't state and a run needs, at ordinary
        values.
        """
        return {}

    def armatures(self, path: Path) -> Mapping[str, float]:
        """Return inertias that a file adds to its joints' own motions in this engine alone, by
        joint, kg or kg m^2.
        """
        return {}

    def caveats(self, path: Path) -> tuple[str, ...]:
        """Return known losses of the file's precision in the engine, one sentence each."""
        return ()

    def parts(self, path: Path) -> tuple[Path, ...]:
        """Return a file of the formats in `compiles`, and its includes.

        Raises:
            EngineError: with file and reason.
        """
        return (path,)

    def file_remarks(self, path: Path) -> Iterable[Remark]:
        """Yield changes that the engine makes to a file's numbers, independent of a model's
        settings.

        Raises:
            EngineError: with file and reason.
        """
        return ()

    def compiled(self, path: Path, texts: Mapping[Path, bytes] | None = None) -> CompiledTree:
        """Return a file of the formats in `compiles` as the numbers that the engine compiles it to.

        Args:
            path: of the file.
            texts: replacements of some of its `parts`, by their paths.

        Raises:
            EngineError: with file and reason.
        """
        raise EngineError(f"{self.title} can't compile {path.suffix} files", file=path)

    def samples(self) -> tuple[Sample, ...]:
        """Return mechanisms for the conformance suite, at least one per format or integrator."""
        return ()
