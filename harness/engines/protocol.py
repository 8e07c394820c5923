"""The engine protocol: the interface of an adapter, without any equations of a system.

An adapter turns a model file into a `Model` that runs steps. It contains all knowledge about its
engine. It never receives a system's constants, never interpolates, and counts steps in integers.
Required methods are abstract; all others have a default. Third parties register an adapter by the
entry point `crosscheck.engines`. `harness.engines.known_answer` is an example, and
`harness.engines.conformance` tests an adapter.
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
    """A problem of a file; its text is `FILE:LINE: sentence`.

    Attributes:
        sentence: the problem; it names the file if `file` is None.
        file: path; None if the sentence names it.
        line: number, from 1; None without a line.
        kind: type of the failure that a case reports (`harness.records.case.FailureKind`).
    """

    kind = "file"

    def __init__(self, sentence: str, *, file: Path | None = None, line: int | None = None) -> None:
        place = "" if file is None else f"{file}: " if line is None else f"{file}:{line}: "
        super().__init__(f"{place}{sentence}")
        self.sentence, self.file, self.line = sentence, file, line


class EngineError(FileError, RuntimeError):
    """A model file that an engine cannot load or run; the message names file, place and remedy.

    If memory runs out, an adapter raises MemoryError instead, which is not a fault of the file.
    """


class UnsupportedError(EngineError):
    """A model file that this engine or adapter does not support, but another engine may.

    A mistake in the file or its sidecar is an `EngineError`.
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
    """A model file with the sidecar's springs and the engine's own settings."""

    path: Path
    springs: tuple[Spring, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A small mechanism as a file that an adapter runs, for the conformance suite.

    No constraint may couple its coordinates near `Model.home`.

    Attributes:
        file: name of the file, with its ending.
        text: content of the file.
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
            sequences, because small arrays would take most of the time of a step.
    """

    inputs: Array
    at: Callable[[Sequence[float], Sequence[float]], Sequence[float]]


Force = Array | StateForce | None
"""Forces on the engine's coordinates, held over each step: (B, n, nz), by state, or none."""


def within(free: Array, limits: Array) -> Array:
    """Return ranges (nz, 2) clipped to limits; an empty range is replaced by its limits."""
    cut = np.stack([np.maximum(free[:, 0], limits[:, 0]), np.minimum(free[:, 1], limits[:, 1])], 1)
    return np.where((cut[:, 0] < cut[:, 1])[:, None], cut, limits)


def held_joints(spec: ModelSpec) -> tuple[str, ...]:
    """Return the setting `held`: names of joints to fix where the file draws them.

    Raises:
        EngineError: if it is not a list of names.
    """
    held = spec.settings.get("held", [])
    if isinstance(held, list) and all(isinstance(name, str) for name in held):
        return tuple(held)
    told = f"[settings] held is {held!r}; expected a list of joints"
    raise EngineError(f"{spec.path}.toml: {told}")


class Model(ABC):
    """A model file, loaded by an engine.

    Attributes:
        coordinates: names of the nz engine coordinates, in the order of the states.
        step: time step of the file or its sidecar, s.
        integrator: name of the time-stepping method.
        gravity: components, m/s^2, two in a planar engine; empty if unknown.
        epsilon: relative rounding of the engine's numbers.
    """

    coordinates: tuple[str, ...]
    step: float
    integrator: str
    gravity: tuple[float, ...] = ()
    epsilon: float = float(np.finfo(np.float64).eps)

    @abstractmethod
    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return the leading exponent of h in the error of a motion, and the increment to the next.

        `varying_input` is True if an input changes over time and is constant over each step.
        """

    @abstractmethod
    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Run n steps of h seconds from B states (q, v), each (B, nz).

        Return positions and velocities after each `every` steps, each (B, n // every, nz).
        The result must not depend on earlier calls. Values that are not finite are returned too.
        """

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return the accelerations at B states without a step, (B, nz); None if unsupported.

        For slides and hinges they are second derivatives. For ball joints and a floating root they
        are derivatives of the velocities: angular about body axes, linear along world axes. They
        are nan in a state in which a soft constraint acts, such as a contact.

        Args:
            z: positions, (B, nz).
            w: their rates, (B, nz).
            force: on the coordinates, (B, nz).
        """
        return None

    def equality_errors(self, z: Array) -> Array | None:
        """Return the violation of equalities at B positions, (B, nz).

        This covers equalities that the engine treats as soft and `accelerations` as exact.
        The violation is zero without an equality; None if the model has none.

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
        """Range of random positions, (nz, 2)."""
        return np.tile([-1.0, 1.0], (len(self.coordinates), 1))

    @property
    def limits(self) -> Array:
        """Joint limits, (nz, 2); infinite without one."""
        return np.tile([-np.inf, np.inf], (len(self.coordinates), 1))

    @property
    def remedies(self) -> Mapping[str, Mapping[str, object]]:
        """Defaults of the engine that change the motion: cause -> settings that switch it off."""
        return {}

    @property
    def integrators(self) -> Mapping[str, Mapping[str, object]]:
        """Other valid integrators of this model: name -> settings that select it."""
        return {}

    @property
    def step_rule(self) -> StepRule | None:
        """The rule for the next state under given forces; None if unknown."""
        return None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the engine so far, one sentence each; one may explain why a motion ends."""
        return ()

    @property
    def reservations(self) -> tuple[str, ...]:
        """Numbers that the engine did not derive from the file, one sentence each."""
        return ()

    @property
    def places(self) -> tuple[str, ...]:
        """Names of poses, as `kind:name`, such as `body:rod`; empty if unsupported."""
        return ()

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses of some `places` in the engine's world, at positions z, (K, nz).

        Return origins, (K, F, 3), m, and rotations, (K, F, 3, 3), with the axes as columns.
        Planar engines use x and y.
        """
        raise NotImplementedError(f"{type(self).__name__} has places and no poses")

    def remarks(self, z: Array, w: Array) -> Iterable[Remark]:
        """Return what the engine or the format adds or drops, according to the loaded model.

        Args:
            z: positions on the motions, (K, nz).
            w: velocities there, (K, nz).
        """
        return ()


class Engine(ABC):
    """An adapter: loads model files into an engine and describes what the engine does.

    Attributes:
        name: short name, as in sidecars and results.
        title: name for sentences.
        formats: file endings that it reads, such as ".urdf".
        extra: extra of this package that installs the engine; empty for default engines. Sidecars
            that name a missing optional engine run without it.
        distribution: name of the engine in a package index, if it differs.
        written_like: for a new format, the ending of a format with the same syntax: ".xml", ".py"
            or ".toml". Its numbers then have addresses for bindings and causes.
        capabilities: one short phrase per topic, for `crosscheck engines`.
        preferred: formats for which it comes before other engines.
        on_request: True if it runs robot files only when named, because compiling takes minutes.
        unstated: default step and gravity, if neither the file nor its sidecar states them.
        stated_settings: settings that a new sidecar states although they have a default.
        bare_link: mass of a fixed URDF link without `<inertial>`; empty: none.
        takes_springs: formats in which it supports the springs of a sidecar. In others they are an
            error.
        ignores: numbers that the engine ignores, such as "dynamics@friction".
        idle: purpose of numbers that affect no motion, by a regular expression of their tags, such
            as `robot/link/visual/.*`.
        choices: regular expression of integers that select something; empty: none.
        compiles: formats that `compiled` supports.
        switches: supported settings of `smooth`, `couplings`, `held`, `actuators`, `controls` and
            `activations`.
        usual_mistakes: common mistakes of its users that no format causes.
        compilers: engines whose `compiled` supports a format, by its ending; set by the registry.
            An adapter that edits a file may use the inertias that one of them compiles.
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
        """Return the version of the engine, or None if it is not installed."""

    @abstractmethod
    def load(self, spec: ModelSpec) -> Model:
        """Load a model file.

        Raises:
            EngineError: with file, place and remedy.
        """

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return typical values of required settings that files of a format cannot state."""
        return {}

    def caveats(self, path: Path) -> tuple[str, ...]:
        """Return known losses of digits when the engine reads a file, one sentence each."""
        return ()

    def parts(self, path: Path) -> tuple[Path, ...]:
        """Return a file of a format in `compiles`, and the files that it includes.

        Raises:
            EngineError: with file and reason.
        """
        return (path,)

    def file_remarks(self, path: Path) -> Iterable[Remark]:
        """Return how the engine changes a file's numbers while reading, without settings.

        Raises:
            EngineError: with file and reason.
        """
        return ()

    def compiled(self, path: Path, texts: Mapping[Path, bytes] | None = None) -> CompiledTree:
        """Return the numbers that the engine compiles from a file of a format in `compiles`.

        Args:
            path: model file.
            texts: contents that replace some of its `parts`, by path.

        Raises:
            EngineError: with file and reason.
        """
        raise EngineError(f"{self.title} can't compile {path.suffix} files", file=path)

    def samples(self) -> tuple[Sample, ...]:
        """Return mechanisms for the conformance suite, at least one per format or integrator."""
        return ()
