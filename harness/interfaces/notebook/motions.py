"""Worker tasks that compute motions: of a model in an engine, and of the equations."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path

from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.checks.findings import settings_of
from physics_crosscheck.harness.checks.followers import Followers
from physics_crosscheck.harness.checks.not_run import not_of_a_tree
from physics_crosscheck.harness.checks.prepare import joints_of
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.engines.protocol import LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.modelfiles.parts import part_digests
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_system
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.full_run import simulated, why_no_run
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.load import load_declaration, with_location
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem, TreeSystem
from physics_crosscheck.reference.mechanism.declaration import Scenario
from physics_crosscheck.reference.mechanism.signal import numeric_inputs, pieces
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve, start_of
from .columns import Columns
from .subject import NotebookSubject, sidecar_of
from .trajectory import MotionError, Trajectory

Start = tuple[tuple[str, float], ...]
"""Values of coordinates and rates by name; missing ones are zero."""


@dataclass(frozen=True, kw_only=True)
class MotionRequest:
    """A requested motion of a mechanism.

    Attributes:
        subject: the mechanism.
        scenario: name of a declared scenario, or a start.
        duration: seconds; None: the scenario's.
        engine: engine that runs the file; empty for the equations.
        step: seconds; None: the file's own.
    """

    subject: NotebookSubject
    scenario: str | Start
    duration: float | None
    engine: str = ""
    step: float | None = None


@dataclass(frozen=True, kw_only=True)
class Solved:
    """A motion of the equations.

    Attributes:
        declaration: declaration of the mechanism.
        motion: its reference motion.
        reads: states of its input files, by name relative to the folder.
    """

    declaration: System | TreeSystem
    motion: Motion
    reads: Mapping[str, str]


def simulate(request: MotionRequest) -> Trajectory:
    """Run a model from a scenario's start to its end.

    Raises:
        MotionError, EngineError, DeclarationError, SidecarError, RobotError: in one sentence.
    """
    source = _source(request.subject)
    scenario = _scenario(source, request)
    model, coordinates = _loaded(source, request.subject, request.engine)
    step = model.step if request.step is None else request.step
    duration = float(scenario.duration)
    if why := why_no_run(duration, step):
        raise MotionError(f"{request.subject.file}: {why}")
    start = start_of(source.declaration, scenario)
    inputs = numeric_inputs(pieces(source.declaration, scenario))
    times, states = simulated(model, coordinates, start, inputs, duration, step)
    columns = Columns(source.declaration)
    engine = engines()[request.engine]
    file = request.subject.place.name
    return Trajectory(
        t=times,
        names=columns.names,
        units=columns.units,
        values=columns.values(times, states),
        uncertainty=None,
        system=source.declaration.name,
        scenario=scenario.name,
        origin=f"{file} in {engine.title} {engine.version()}, {model.integrator},"
        f" a step of {step:g} s",
        step=step,
    )


def solved(request: MotionRequest) -> Solved:
    """Solve the equations from a scenario's start to its end.

    Raises:
        MotionError, DeclarationError, ReferenceError, RobotError: in one sentence.
    """
    source = _source(request.subject)
    scenario = _scenario(source, request)
    declaration = source.declaration
    if isinstance(declaration, TreeSystem):
        motion = solve(TreeEquations(declaration), scenario)
    else:
        assert request.subject.folder is not None
        with with_location(request.subject.folder):
            motion = solve(derive(declaration), scenario)
    return Solved(declaration=declaration, motion=motion, reads=source.reads)


CONTENT = "(content)"
"""Name of the hash of all files of a folder, among its inputs."""


@dataclass(frozen=True, kw_only=True)
class _Source:
    """A mechanism that was read."""

    declaration: System | TreeSystem
    robot: Robot | None
    reads: Mapping[str, str]


def _source(subject: NotebookSubject) -> _Source:
    if subject.folder is None:
        assert subject.file is not None
        read = part_digests(subject.file.absolute())
        robot = read_robot(subject.file)
        return _Source(declaration=robot_system(robot), robot=robot, reads=read)
    content = folder_files(subject.folder).system
    with record_reads(subject.folder) as reads:
        declared = load_declaration(subject.folder)
    whole = declared.tree_system if isinstance(declared, MultibodySystem) else declared
    return _Source(declaration=whole, robot=None, reads={**reads.states, CONTENT: content})


def _scenario(source: _Source, request: MotionRequest) -> Scenario:
    """Return the requested scenario with the requested duration.

    Raises:
        MotionError: listing the alternatives.
    """
    declaration, place = source.declaration, request.subject.place
    if not isinstance(request.scenario, str):
        return _start_state(declaration, request.scenario, request.duration, place)
    for scenario in declaration.scenarios:
        if scenario.name == request.scenario:
            return (
                scenario
                if request.duration is None
                else replace(scenario, duration=request.duration)
            )
    names_of_scenarios = ", ".join(scenario.name for scenario in declaration.scenarios)
    there = (
        f"it has {names_of_scenarios}; or give" if names_of_scenarios else "it declares none; give"
    )
    first = declaration.coordinates[0].name
    raise MotionError(
        f"{place}: {declaration.name} has no scenario {request.scenario!r}; {there} a start, such"
        f' as {{"{first}": 0.1}}, with a duration'
    )


def _start_state(
    declaration: System | TreeSystem, start: Start, duration: float | None, place: Path
) -> Scenario:
    given = dict(start)
    names = [c.name for c in declaration.coordinates]
    allowed = (*names, *(f"{name}_dot" for name in names))
    for name in given:
        if name not in allowed:
            raise MotionError(
                f"{place}: a start has no {name!r}; {declaration.name} has {', '.join(allowed)}"
            )
    if duration is None:
        raise MotionError(f"{place}: set a duration in seconds, such as duration=10")
    return Scenario(
        format_start(start),
        "a start of its own",
        q={c: given.get(c.name, 0.0) for c in declaration.coordinates},
        v={c: given.get(f"{c.name}_dot", 0.0) for c in declaration.coordinates},
        inputs=dict.fromkeys(declaration.inputs, 0),
        duration=duration,
    )


def _loaded(
    source: _Source, subject: NotebookSubject, engine: str
) -> tuple[LoadedModel, CoordinateMap]:
    """Load a model, and return it with the map between its coordinates and the mechanism's."""
    file = subject.file
    assert file is not None
    if isinstance(source.declaration, System):
        return load(source.declaration, sidecar_of(file), engine)
    adapter = engines()[engine]
    if source.robot is None:
        sidecar = sidecar_of(file)
        if why := not_of_a_tree(sidecar):
            raise MotionError(why)
        spec = sidecar.spec(engine)
    else:
        settings = {**adapter.settings_for(file.suffix), **settings_of(source.robot)}
        spec = ModelSpec(path=file, settings=settings)
    model = adapter.load(spec)
    followers = Followers.build(source.declaration.tree)
    order = joints_of(followers, tuple(model.coordinates), file, engine)
    names = tuple(c.name for c in source.declaration.coordinates)
    return model, followers.map(order, names)


def format_start(start: Start) -> str:
    """Format a start."""
    return ", ".join(f"{name} = {value:g}" for name, value in start) or "from zero"


def is_number(value: object) -> bool:
    """Return whether a value is a real number of Python or numpy; a bool is not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def start_from(given: Mapping[str, float]) -> Start:
    """Convert a start for sending it to a worker.

    Raises:
        MotionError: unless it maps names to finite numbers.
    """
    if not isinstance(given, Mapping):
        raise MotionError(
            f'the scenario is {given!r}, expected a name, or a start such as {{"theta": 0.1}}'
        )
    for name, value in given.items():
        if not is_number(value) or not math.isfinite(value):
            raise MotionError(f"{name} starts at {value!r}, expected a finite number")
    return tuple((str(name), float(value)) for name, value in given.items())
