"""One of the two models: its file, its engine, its assumptions, and tasks on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.harness.engines.compiled import CompiledActuator, CompiledTree
from physics_crosscheck.harness.engines.protocol import Array, Engine, LoadedModel
from physics_crosscheck.harness.engines.registry import engines, engines_reading, missing
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.modelfiles.folders import (
    FORMATS,
    FolderError,
    similar_path,
    syntax_problem,
)
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler
from physics_crosscheck.harness.modelfiles.model_files import check_springs, only_model
from physics_crosscheck.harness.modelfiles.parts import PartError, check_parts
from physics_crosscheck.harness.modelfiles.readers import FOLLOWERS, names_of, read_as_it_runs
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.robot_targets import source_file
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.reference.mechanism.tree import Tree


class CompareError(ValueError):
    """Wrong usage: a missing file, an engine that cannot read it, or joints without a match."""

    usage = True


class UnreadableModelError(CompareError):
    """A rejected model file: invalid XML, a DTD, or a recursive include."""


class NotInstalledError(RuntimeError):
    """The engine that a comparison needs is not installed."""


@dataclass(frozen=True)
class Candidate:
    """A model file in an engine.

    Attributes:
        label: "A" or "B".
        sidecar: the file's own, or one with assumed values.
        engine: name of the engine that runs it.
        notes: assumptions, a sentence each.
        bare: whether the file has no sidecar.
        given: names of the settings that the comparison adds.
        others: engines that both models share, to try if the engine can't load one.
    """

    label: str
    sidecar: Sidecar
    engine: str
    notes: tuple[str, ...] = ()
    bare: bool = False
    given: frozenset[str] = frozenset()
    others: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The name in messages."""
        return f"{self.sidecar.model} [{self.engine}]"

    @property
    def floating(self) -> bool | None:
        """True if its root moves freely; None if neither sidecar nor settings state it."""
        floats = self.settings.get("floating")
        return None if floats is None else bool(floats)

    @property
    def settings(self) -> Mapping[str, object]:
        """The settings that it runs with."""
        return self.sidecar.spec(self.engine).settings

    def load(self) -> LoadedModel:
        """Load the model; in some engines this unloads the previous one.

        Raises:
            EngineError: with file, place and remedy.
        """
        return engines()[self.engine].load(self.sidecar.spec(self.engine))

    def with_settings(self, **settings: object) -> Candidate:
        """Return a copy with other settings."""
        merged = {**self.sidecar.engine_settings.get(self.engine, {}), **settings}
        changed = {**self.sidecar.engine_settings, self.engine: merged}
        sidecar = replace(self.sidecar, engine_settings=changed)
        return replace(self, sidecar=sidecar, given=self.given | set(settings))


COUPLED = ("mimic", "equality", FOLLOWERS)
"""Start of omissions that couple joints."""


def smooth(a: Candidate, b: Candidate) -> tuple[Candidate, Candidate]:
    """Return both models without contacts, limits and dry friction, which limit the accuracy.

    Couplings are removed only if neither file has a sidecar: a sidecar declares those that its
    model needs. Settings of a sidecar are kept.
    """
    wanted: dict[str, object] = {"smooth": True}
    if a.bare and b.bare:
        wanted["couplings"] = False
    return _switched(a, wanted), _switched(b, wanted)


def _switched(model: Candidate, wanted: Mapping[str, object]) -> Candidate:
    switches = engines()[model.engine].switches
    stated = model.settings
    settings = {k: v for k, v in wanted.items() if k in switches and k not in stated}
    return model.with_settings(**settings) if settings else model


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Properties of a loaded model, and its file as read without the engine.

    Attributes:
        candidate: as it was loaded.
        coordinates: of the engine, nz of them.
        integrator, step: of the engine.
        gravity: empty if the engine does not report it.
        home: positions in which the file draws the mechanism, (nz,).
        sampling_range: the engine's sampling range of positions, (nz, 2).
        limits: bounds of the positions, infinite where there is no limit, (nz, 2).
        places: frames with a pose in the engine, as `kind:name`.
        robot: the file as a tree of bodies, with the settings and springs that it runs with; None
            for a format without a reader.
        compiled: the file as compiled by an engine; None for a format that is not compiled.
    """

    candidate: Candidate
    coordinates: tuple[str, ...]
    integrator: str
    step: float
    gravity: tuple[float, ...]
    home: Array
    sampling_range: Array
    limits: Array
    places: tuple[str, ...]
    robot: Robot | None
    compiled: CompiledTree | None

    @property
    def states_move(self) -> bool:
        """True if actuator states move."""
        return bool(self.candidate.settings.get("activations"))

    @property
    def tree(self) -> Tree | None:
        """The file's tree; None if it lacks a coordinate of the engine."""
        tree = None if self.robot is None else self.robot.tree
        names = [] if tree is None else names_of(tree)
        is_unique = len(set(names)) == len(names)
        return tree if is_unique and set(self.coordinates) <= set(names) else None

    @property
    def whole_tree(self) -> Tree | None:
        """The file's tree; None if its coordinates are not exactly those of the engine."""
        tree = self.tree
        return tree if tree is not None and len(names_of(tree)) == len(self.coordinates) else None

    @property
    def sampled_tree(self) -> Tree | None:
        """The tree to sample states with; None if the engine couples more joints than the tree."""
        left_out = () if self.robot is None else self.robot.left_out
        coupled = any(one.what.startswith(COUPLED) for one in left_out)
        coupled = coupled and bool(self.candidate.settings.get("couplings", True))
        return None if coupled else self.whole_tree

    @property
    def actuators(self) -> tuple[CompiledActuator, ...]:
        """Actuators of the file."""
        return () if self.compiled is None else self.compiled.actuators


def facts(candidate: Candidate) -> Facts:
    """Load a model and read its properties.

    Raises:
        EngineError: with file, place and remedy.
    """
    model, file = candidate.load(), candidate.sidecar.model
    settings = candidate.settings
    robot = None
    if file.suffix in FORMATS:
        robot = read_as_it_runs(file, settings, candidate.sidecar.springs)
        if robot.tree is not None and len(model.gravity) == 3:
            tree = replace(robot.tree, gravity=np.array(model.gravity))
            robot = replace(robot, tree=tree)
    file_compiler = compiler(file.suffix)
    return Facts(
        candidate=candidate,
        coordinates=tuple(model.coordinates),
        integrator=model.integrator,
        step=model.step,
        gravity=model.gravity,
        home=model.home,
        sampling_range=model.sampling_range,
        limits=_limits(model, robot),
        places=tuple(model.places),
        robot=robot,
        compiled=None if file_compiler is None else file_compiler.compiled(file),
    )


def _limits(model: LoadedModel, robot: Robot | None) -> Array:
    """Return position bounds of the file, or of the engine for joints that the file leaves out.

    An engine that ignores limits may not report them.
    """
    limits = model.limits.copy()
    if robot is None or robot.tree is None:
        return limits
    file_limits = np.stack(robot.limits, axis=1)
    names = names_of(robot.tree)
    for name, bounds in zip(names, file_limits, strict=True):
        if name in model.coordinates:
            limits[model.coordinates.index(name)] = bounds
    return limits


def candidates(
    paths: tuple[Path, Path],
    requested: tuple[str | None, str | None],
    *,
    floating: bool | None = None,
) -> tuple[Candidate, Candidate]:
    """Return A and B; without a requested engine, in one that both files share.

    Arguments and errors as of `candidate`.
    """
    ways = [
        _usable(*_choices(label, path, name)[1:])
        for label, path, name in zip("AB", paths, requested, strict=True)
    ]
    shared = [name for name in ways[0] if name in ways[1]]
    a, b = (
        candidate(label, path, next(iter(shared), name), floating=floating)
        for label, path, name in zip("AB", paths, requested, strict=True)
    )
    return replace(a, others=tuple(shared[1:])), b


def fallbacks(a: Candidate, b: Candidate) -> Iterator[tuple[Candidate, Candidate]]:
    """Yield both models in the other engines that they share, then each in its usual one."""
    for name in a.others:
        first, other = (
            candidate(x.label, x.sidecar.model, name, floating=x.floating) for x in (a, b)
        )
        note = f"{a.engine} can't load both files: {name} runs them"
        yield replace(first, notes=(note, *first.notes)), other
    usual = [candidate(x.label, x.sidecar.model, None, floating=x.floating) for x in (a, b)]
    names = [one.engine for one in usual]
    if names not in ([a.engine, b.engine], *([name, name] for name in a.others)):
        note = f"{a.engine} can't load both files: {names[0]} runs A, and {names[1]} runs B"
        yield replace(usual[0], notes=(note, *usual[0].notes)), usual[1]


def candidate(
    label: str, path: Path, engine: str | None, *, floating: bool | None = None
) -> Candidate:
    """Return the model at `path`, in the given engine or in the one that fits its format.

    Args:
        label: "A" or "B".
        path: of the file, or of a folder with only one.
        engine: its name; None: the first installed one that reads the file, after all that follow
            their files one that adds numbers of its own.
        floating: whether a URDF's root moves freely; None: as in the other file, or by its legs. A
            sidecar overrides it.

    Raises:
        CompareError: for a wrong path or engine, with the remedy.
        UnreadableModelError: for a rejected file, with its line.
        NotInstalledError: if no suitable engine is installed.
        SidecarError: for an unreadable sidecar.
    """
    path, sidecar, wanted = _choices(label, path, engine)
    name = next(iter(_usable(sidecar, wanted)), None)
    if name is None:
        missing_engines = "; ".join(missing(engines()[name]) for name in wanted)
        raise NotInstalledError(f"{path}: no engine that reads it is installed: {missing_engines}")
    adapter = engines()[name]
    if sidecar is not None:
        check_springs(sidecar, adapter)
    caveats = adapter.caveats(path)
    if sidecar is None:
        bare, notes = _bare(path, adapter)
        model = Candidate(label, bare, name, (*notes, *caveats), bare=True)
        is_set = path.suffix == ".urdf" and floating is not None
        return model.with_settings(floating=floating) if is_set else model
    return Candidate(label, sidecar, name, caveats)


def _choices(label: str, path: Path, engine: str | None) -> tuple[Path, Sidecar | None, list[str]]:
    """Return a model's file, its sidecar, and the engines that may run it, the first one first."""
    try:
        path = source_file(str(path)) or (only_model(path) if path.is_dir() else path)
    except FolderError as error:
        raise CompareError(str(error)) from None
    if not path.is_file():
        raise CompareError(f"{path}: there is no such file{similar_path(path)}")
    sidecar_file = Path(f"{path}.toml")
    try:
        check_parts(path)
    except PartError as error:
        raise UnreadableModelError(str(error)) from None
    if why := syntax_problem(path):
        raise UnreadableModelError(why)
    sidecar = read_sidecar(sidecar_file) if sidecar_file.exists() else None
    return path, sidecar, _wanted(label, path, engine, sidecar)


def _usable(sidecar: Sidecar | None, wanted: list[str]) -> list[str]:
    installed = [name for name in wanted if engines()[name].version() is not None]
    if sidecar is None:
        adds = {name: bool(engines()[name].massless_link_default) for name in installed}
        installed.sort(key=lambda name: (adds[name], engines()[name].on_request))
    return installed


def _wanted(label: str, path: Path, requested: str | None, sidecar: Sidecar | None) -> list[str]:
    all_engines = engines()
    if requested is not None:
        if requested not in all_engines:
            names = ", ".join(sorted(all_engines))
            raise CompareError(f"no engine {requested!r} is known; known are {names}")
        if path.suffix not in all_engines[requested].formats:
            reads = ", ".join(all_engines[requested].formats)
            raise CompareError(
                f"{path}: {requested} reads {reads} files alone; choose another with"
                f" --engine-{label.lower()}"
            )
        return [requested]
    declared = () if sidecar is None else sidecar.engines
    reading = [engine.name for engine in engines_reading(path.suffix)]
    wanted = [name for name in declared if name in reading] or reading
    if not wanted:
        formats = sorted({suffix for engine in all_engines.values() for suffix in engine.formats})
        raise CompareError(f"{path}: no engine reads it; they read {', '.join(formats)} files")
    return wanted


def _bare(path: Path, engine: Engine) -> tuple[Sidecar, tuple[str, ...]]:
    settings = dict(engine.settings_for(path.suffix))
    stated = UsdStage(path, {}).settings if path.suffix in USD_SUFFIXES else {}
    assumed = [_spoken(key, value) for key, value in sorted(settings.items()) if key not in stated]
    settings.update(stated)
    sidecar = Sidecar(
        model=path,
        engines=(engine.name,),
        settings=settings,
        engine_settings={},
        coordinates={},
        readback={},
        springs=(),
    )
    if not assumed:
        return sidecar, ()
    note = f"{path.name} has no sidecar: {' and '.join(assumed)}"
    if len(assumed) == 1:
        return sidecar, (f"{note} is assumed",)
    note += f" are assumed; state others in {path.name}.toml, [settings]"
    return sidecar, (note,)


def _spoken(key: str, value: object) -> str:
    if key == "step":
        return f"a step of {value:g} s"
    shown = f"({', '.join(f'{x:g}' for x in value)})" if isinstance(value, list) else str(value)
    return f"{key} {shown}"


T = TypeVar("T")
V = TypeVar("V")


class FailureError(RuntimeError):
    """A comparison that could not run."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


def ask(executor: Executor, candidate: Candidate, function: Callable[[T], V], argument: T) -> V:
    """Run a function of a model.

    Raises:
        CompareError: for wrong usage.
        FailureError: if an engine fails, with its output.
    """
    (value,) = ask_each(executor, candidate, function, [argument])
    if isinstance(value, Failure):
        raise CompareError(value.reason) if value.usage else FailureError(value)
    return value


def ask_each(
    executor: Executor, candidate: Candidate, function: Callable[[T], V], arguments: Sequence[T]
) -> list[V | Failure]:
    """Run a function on each argument; failures have the model's name."""
    values = executor.outcomes(function, arguments)
    return [_named(candidate, one) if isinstance(one, Failure) else one for one in values]


def _named(candidate: Candidate, failure: Failure) -> Failure:
    """Prefix a failure with the model's name, unless the reason already names its file."""
    if failure.usage or str(candidate.sidecar.model) in failure.reason:
        return failure
    return replace(failure, reason=f"{candidate.name}: {failure.reason}")
