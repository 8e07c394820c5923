"""The engine protocol: what an adapter offers, and nothing of the system's equations.

An adapter turns a model file into a `Model` that rolls out. It holds engine knowledge only, and all
of it: it never sees a system's constants, never interpolates, and counts steps in integers. What
must be there is abstract; everything else has a default, so that nothing is asked of an adapter
that the protocol does not declare. Third parties add one through the entry point
`crosscheck.engines`; `harness.engines.known_answer` is the one to read first, and
`harness.engines.conformance` tells what an adapter gets wrong.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.mistake import DefaultLeftOn, LeftOut
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.step_rule import StepRule

Array = NDArray[np.float64]


class FileError(Exception):
    """What is wrong with a file; as text, `FILE:LINE: sentence`.

    Attributes:
        sentence: what is wrong; it names the file itself where `file` is None.
        file: in which it stands; None where the sentence names it.
        line: of it, counted from 1; None where it is no line's.
        kind: which kind of failure a case reports (`harness.records.case.FailureKind`).
    """

    kind = "file"

    def __init__(self, sentence: str, *, file: Path | None = None, line: int | None = None) -> None:
        place = "" if file is None else f"{file}: " if line is None else f"{file}:{line}: "
        super().__init__(f"{place}{sentence}")
        self.sentence, self.file, self.line = sentence, file, line


class EngineError(FileError, RuntimeError):
    """A model file that an engine can't load or run; the message names file, place and remedy.

    Where memory runs out, an adapter raises MemoryError instead: that says nothing about the file.
    """


class UnsupportedError(EngineError):
    """A model file that an engine or its adapter does not take, though another engine may.

    A mistake in the file or in its sidecar is an `EngineError` alone.
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
    """A model file with what its sidecar adds for one engine; `settings` are the engine's own."""

    path: Path
    springs: tuple[Spring, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A small mechanism as a file that an adapter runs, for the conformance suite.

    Its coordinates are to be free of one another's constraints, near `Model.home`.

    Attributes:
        file: name of the file, with its ending.
        text: what stands in it.
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
        at: force on the engine's coordinates at one state, (z, u) -> nz numbers. It takes plain
            sequences: at a call a step, arrays of two or three numbers would cost most of the time.
    """

    inputs: Array
    at: Callable[[Sequence[float], Sequence[float]], Sequence[float]]


Force = Array | StateForce | None
"""Forces on the engine's coordinates, held over each step: (B, n, nz), by state, or none."""


def within(free: Array, limits: Array) -> Array:
    """Ranges (nz, 2) cut to limits; where these leave nothing, the limits alone."""
    cut = np.stack([np.maximum(free[:, 0], limits[:, 0]), np.minimum(free[:, 1], limits[:, 1])], 1)
    return np.where((cut[:, 0] < cut[:, 1])[:, None], cut, limits)


def held_joints(spec: ModelSpec) -> tuple[str, ...]:
    """The setting `held`: names of joints that are to stand still where the file draws them.

    Raises:
        EngineError: where it is no list of names.
    """
    held = spec.settings.get("held", [])
    if isinstance(held, list) and all(isinstance(name, str) for name in held):
        return tuple(held)
    told = f"[settings] held is {held!r}; expected a list of joints"
    raise EngineError(f"{spec.path}.toml: {told}")


class Model(ABC):
    """A model file, loaded by an engine.

    Attributes:
        coordinates: names of the engine's coordinates, in the order of its states: nz of them.
        step: the step the file (or its sidecar) ships with, seconds.
        integrator: name of the time-stepping method.
        gravity: its components, m/s^2, two in a planar engine; empty where the model doesn't tell.
        epsilon: relative rounding of the numbers that the engine computes with.
    """

    coordinates: tuple[str, ...]
    step: float
    integrator: str
    gravity: tuple[float, ...] = ()
    epsilon: float = float(np.finfo(np.float64).eps)

    @abstractmethod
    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Leading exponent of h in the error of a motion, and the increment to the next.

        `varying_input` tells whether an input changes over time and is held over each step.
        """

    @abstractmethod
    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """From B states (q, v), each (B, nz), take n steps of h seconds.

        Returns positions and velocities after every `every` steps, each (B, n // every, nz).
        Nothing that an earlier call left may matter. Values that are not finite are returned as
        they are.
        """

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """What it computes at B states without a step, (B, nz); None where it tells nothing.

        Of slides and hinges they are second derivatives; of what turns, and of a root that floats,
        those of its velocities: angular about its own axes, linear along the world's. Of a state
        where a soft constraint acts, such as a contact, they are nan.

        Args:
            z: positions, (B, nz).
            w: their rates, (B, nz).
            force: on the coordinates, (B, nz).
        """
        return None

    def equality_errors(self, z: Array) -> Array | None:
        """Return how far B positions are from where equalities put them, (B, nz).

        Of equalities that the engine itself makes soft, and that `accelerations` takes to hold
        exactly: their own numbers show here. Zero where nothing is held; None where it has none.

        Args:
            z: positions, (B, nz).
        """
        return None

    @property
    def home(self) -> Array:
        """Positions as the file draws the mechanism, (nz,)."""
        return np.zeros(len(self.coordinates))

    @property
    def reach(self) -> Array:
        """Where positions may be drawn at random, (nz, 2)."""
        return np.tile([-1.0, 1.0], (len(self.coordinates), 1))

    @property
    def limits(self) -> Array:
        """Between which positions no stop acts, (nz, 2); infinite where there is none."""
        return np.tile([-np.inf, np.inf], (len(self.coordinates), 1))

    @property
    def remedies(self) -> Mapping[str, Mapping[str, object]]:
        """What the engine does on its own and the settings let stand: cause -> what undoes it."""
        return {}

    @property
    def integrators(self) -> Mapping[str, Mapping[str, object]]:
        """Other ways to step this model, just as sound: name -> settings that choose it."""
        return {}

    @property
    def step_rule(self) -> StepRule | None:
        """How its very next state follows from the forces, or None where that isn't known."""
        return None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the engine has warned of so far, a sentence each; it may be why a motion ends."""
        return ()

    @property
    def reservations(self) -> tuple[str, ...]:
        """Numbers that the engine did not work out from the file itself, a sentence each."""
        return ()

    @property
    def places(self) -> tuple[str, ...]:
        """What has a pose, as `kind:name`, such as `body:rod`; none where the engine can't say."""
        return ()

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Where some of `places` are in the engine's world, at positions z, (K, nz).

        Returns origins, (K, F, 3), m, and rotations, (K, F, 3, 3), whose columns are their axes. A
        plane is that of x and y.
        """
        raise NotImplementedError(f"{type(self).__name__} has places and no poses")

    def remarks(self, z: Array, w: Array) -> Iterable[Remark]:
        """What the engine or the format adds or drops, read from the model and not from a motion.

        Args:
            z: positions that the motions pass, (K, nz).
            w: velocities there, (K, nz).
        """
        return ()


class Engine(ABC):
    """An adapter: its name, whether its engine is there, and how to load a model file.

    Attributes:
        name: short name, as in sidecars and results.
        title: as it is written in sentences.
        formats: endings of the files it reads, such as ".urdf".
        extra: by which extra of this package its engine is installed, and not by that of the
            standing ones; where it isn't there, sidecars that name it run without it.
        distribution: what a package index calls the engine itself, where that is not its name.
        written_like: for a format of its own, the ending of one that it is written like: ".xml",
            ".py" or ".toml". Its numbers have addresses then, for bindings and for causes.
        capabilities: what it can do, one short phrase each, for `crosscheck engines`.
        preferred: the formats for which it comes before others that read them.
        on_request: whether robots' files alone are run in it only where it is asked for by name,
            since it compiles each for minutes.
        unstated: the step and gravity that it takes where neither a file nor its sidecar says.
        stated_settings: those that a new sidecar states, though it has a default for each.
        bare_link: the mass that it takes for a URDF's resting link without one; empty: none.
        takes_springs: the formats in which it heeds the springs of a sidecar; in others they are
            refused before a file is loaded.
        ignores: numbers of its formats that it reads over, such as "dynamics@friction".
        idle: what numbers are for on which no motion need depend, by a regular expression of the
            tags that lead to them, as in `robot/link/visual/.*`.
        choices: whole numbers that choose and measure nothing, likewise; empty: none.
        compiles: the formats that `compiled` takes apart.
        switches: which of the settings `smooth`, `couplings`, `held` (names of joints that are to
            stand still, where the file draws them), `actuators` (whether they act), `controls`
            (at which they are held) and `activations` (states of actuators, which then move) it
            has.
        usual_mistakes: those that its users make and no format is to blame for.
        compilers: engines whose `compiled` takes a format apart, by its ending; the registry sets
            them. An adapter that edits a file may state inertias as one of them compiles them.
    """

    name: str
    title: str
    formats: tuple[str, ...]
    extra: str = ""
    distribution: str = ""
    written_like: Mapping[str, str] = MappingProxyType({})
    capabilities: tuple[str, ...] = ()
    preferred: tuple[str, ...] = ()
    on_request: bool = False
    unstated: str = ""
    stated_settings: Mapping[str, object] = MappingProxyType({})
    bare_link: str = ""
    takes_springs: tuple[str, ...] = ()
    ignores: frozenset[str] = frozenset()
    idle: Mapping[str, str] = MappingProxyType({})
    choices: str = ""
    compiles: tuple[str, ...] = ()
    switches: frozenset[str] = frozenset()
    usual_mistakes: tuple[DefaultLeftOn | LeftOut, ...] = ()
    compilers: Mapping[str, Engine] = MappingProxyType({})

    @abstractmethod
    def version(self) -> str | None:
        """Version of the engine, or None where it is not installed."""

    @abstractmethod
    def load(self, spec: ModelSpec) -> Model:
        """Load a model file.

        Raises:
            EngineError: naming file, place and remedy.
        """

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """What files of a format can't say and must run with, at ordinary values."""
        return {}

    def caveats(self, path: Path) -> tuple[str, ...]:
        """What the engine is known to lose of a file's digits, a sentence each."""
        return ()

    def parts(self, path: Path) -> tuple[Path, ...]:
        """A file of the formats in `compiles`, and those that it includes.

        Raises:
            EngineError: naming file and reason.
        """
        return (path,)

    def file_remarks(self, path: Path) -> Iterable[Remark]:
        """What the engine makes of a file's numbers as it reads it, without a model's settings.

        Raises:
            EngineError: naming file and reason.
        """
        return ()

    def compiled(self, path: Path, texts: Mapping[Path, bytes] | None = None) -> CompiledTree:
        """A file of the formats in `compiles` as the numbers that the engine makes of it.

        Args:
            path: of the file.
            texts: what is read instead of some of its `parts`, by their paths.

        Raises:
            EngineError: naming file and reason.
        """
        raise EngineError(f"{self.title} can't compile {path.suffix} files", file=path)

    def samples(self) -> tuple[Sample, ...]:
        """Mechanisms that the conformance suite runs, one a format or integrator at least."""
        return ()
