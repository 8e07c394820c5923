"""A robot file, or a folder that declares bodies, in a sweep: the numbers of files are constants.

Each file is read and its states are chosen once. A draw changes digits in a copy and makes the same
changes in the tree. The reference states of a draw are computed from those of the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.followers import Followers
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.modelfiles.folders import FORMATS
from physics_crosscheck.harness.modelfiles.numbers import ModelFile, copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import RobotError, robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.paths import RESOLUTION
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.assemble import tree_system
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.flows import ReusedSegments
from physics_crosscheck.reference.solving.samples import solved
from .planned import KEPT, Block, CaseRecord, Integrators, Planned, Source, StepClock

_READ = ("floating", "held", "controls", "model", "gravity")
"""Settings that decide how a file is read, apart from the engine that runs it."""


class _FileNumbers:
    """A model file with its numbers, and the equations for other values of these."""

    def __init__(self, file: Path, declared: PreparedTree, settings: Mapping[str, object]) -> None:
        self._file, self._declared, self._settings = file, declared, settings
        self.numbers: ModelFile | None = None
        if file.suffix in FORMATS:
            self.numbers = robot_numbers(file, settings)
        self._solved = lru_cache(maxsize=KEPT)(self._solve)

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Index of every number that affects bodies and joints, by its address, in order."""
        if self.numbers is None:
            return {}
        relevant = sorted(self.numbers.relevant_numbers)
        first = {self.numbers.numerals[i].address: i for i in reversed(relevant)}
        return dict(sorted(first.items(), key=lambda item: item[1]))

    @property
    def constants(self) -> Mapping[str, float]:
        """These numbers, by address."""
        if self.numbers is None:
            return {}
        return {name: self.numbers.numerals[i].value for name, i in self.index.items()}

    @cached_property
    def nominal(self) -> PreparedTree:
        """The equations of the file, at the states of the folder.

        Raises:
            RobotError: if these differ from the declared equations.
        """
        return self._declared if self._declared.place.is_file() else self._of_file()

    @cached_property
    def segments(self) -> ReusedSegments:
        """Their segments, from which those of a draw are computed."""
        return ReusedSegments(self.nominal.system, self.nominal.samples)

    def drawn(self, values: Mapping[int, float]) -> PreparedTree:
        """Return the equations for other values of some numbers.

        Raises:
            RobotError, ReferenceError: if they do not exist or cannot be solved.
        """
        return self._solved(tuple(sorted(values.items()))) if values else self._declared

    def _solve(self, values: tuple[tuple[int, float], ...]) -> PreparedTree:
        tree, system = self._tree(dict(values)), self.nominal.system
        links = [(one.name, one.kind) for one in system.tree.links]
        if tree is None or [(one.name, one.kind) for one in tree.links] != links:
            raise RobotError(f"{self._file}: with these numbers it makes other joints, or none")
        samples = self.segments.for_tree(tree)
        return replace(self.nominal, system=replace(system, tree=tree), samples=samples)

    def _tree(self, values: Mapping[int, float]) -> Tree | None:
        tree = None if self.numbers is None else self.numbers.tree(values)
        if tree is not None and "gravity" in self._settings:
            return replace(tree, gravity=self._declared.tree.gravity)
        return tree

    def _of_file(self) -> PreparedTree:
        """Solve the file's equations from the states of the folder, in the file's joint order."""
        declared, tree = self._declared, self._tree({})
        if tree is None:
            raise RobotError(f"{self._file}: no tree of bodies can be read from it")
        about = declared.system
        system = tree_system(name=about.name, title=about.title, source=about.source, tree=tree)
        names = [one.name for one in system.coordinates]
        if sorted(names) != sorted(declared.names):
            joints = f"{', '.join(names)}; system.py declares {', '.join(declared.names)}"
            raise RobotError(f"{self._file}: its joints are {joints}")
        order = [declared.names.index(name) for name in names]
        both = [*order, *(len(names) + i for i in order)]
        there = declared.samples
        start, forces = there.start[:, both], there.start_inputs[:, order]
        here = solved(TreeEquations(system), start, forces, there.length, there.fastest)
        target = replace(
            declared,
            system=system,
            samples=here,
            followers=Followers.build(tree),
            home=declared.home[order],
        )
        apart = np.max(np.abs(here.end - there.end[:, both]), axis=0)
        self._check_same(target, (apart - here.bound - there.bound[both]) / target.scale)
        return target

    def _check_same(self, target: PreparedTree, apart: Array) -> None:
        """Raise a RobotError if the file's equations are not the declared ones."""
        worst = int(np.argmax(apart))
        if apart[worst] > RESOLUTION:
            raise RobotError(
                f"{self._file}: the file alone differs from system.py by {apart[worst]:.0e} in"
                f" {target.components[worst]}. Check the folder with `crosscheck run`; a model with"
                " springs in its sidecar can only be swept with --standalone"
            )


class SweptTree(Source):
    """A robot file, or a folder that declares bodies, and the data that its cases share.

    Args:
        place: the model file or the folder.

    Raises:
        DeclarationError, RobotError, ReferenceError: naming file, line and remedy.
    """

    signed = False

    def __init__(self, place: Path) -> None:
        super().__init__(place)
        prepared = prepare(place)
        assert isinstance(prepared, PreparedTree)
        self._prepared = prepared
        self._files: dict[tuple[str, str], _FileNumbers] = {}
        self._integrators: dict[tuple[str, str], Integrators] = {}
        self._varied = frozenset[str]()

    def varying(self, varied: frozenset[str]) -> SweptTree:
        """Return the same files with other varied numbers, by their addresses.

        Raises:
            SidecarError: if two files have different numbers at one of these addresses.
        """
        other = copy(self)
        other._varied = varied & self.constants.keys()
        files = [self._file(*one).constants for one in self.runs(())]
        for name in sorted(other._varied):
            values = sorted({constants[name] for constants in files if name in constants})
            if len(values) > 1:
                raise SidecarError(
                    f"{self._prepared.place}: {name} is {' or '.join(map(str, values))}, depending"
                    " on the model file; sweep one of these files by its path"
                )
        return other

    @property
    def name(self) -> str:
        """Name of the robot or system."""
        return self._prepared.record.name

    @property
    def constants(self) -> Mapping[str, float]:
        """Every number that affects bodies and joints, by its address; of several files, all."""
        every: dict[str, float] = {}
        for model, engine in self.runs(()):
            every = {**self._file(model, engine).constants, **every}
        return every

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of its states."""
        return (self._prepared.scenario,)

    def follows(self, model: str, engine: str) -> bool:
        """Return whether the file has any of the varied numbers."""
        return not self._varied or bool(self._varied & self._file(model, engine).index.keys())

    def prepare(self, model: str, engine: str) -> Integrators:
        """Load the unchanged file, and solve the equations that its draws start from."""
        if self._varied:
            _ = self._file(model, engine).segments
        if (model, engine) not in self._integrators:
            loaded_model, _ = self._task(model, engine).load()
            self._integrators[model, engine] = loaded_model.integrator, loaded_model.integrators
        return self._integrators[model, engine]

    def run(self, case: Planned, block: Block, place: Path, record: CaseRecord) -> None:
        """Run every segment of the drawn file; accelerations decide what motions can't resolve.

        A few coarse steps of a tree cost less than its equations at the states of single steps.
        """
        row = case.row
        file = self._file(row.model, row.engine)
        constants = {name: v for name, v in row.constants.items() if name in file.index}
        record.update(constants=constants)
        values = {file.index[name]: value for name, value in constants.items()}
        with record.timing("reference_seconds"):
            target = file.drawn(values)
        task = self._task(row.model, row.engine).with_settings(**case.settings)
        task = replace(task, target=target, resolution=block.resolution)
        if values and file.numbers is not None:
            task = task.with_file(copy_with_texts(task.file, file.numbers.texts(values), place))
        with record.timing("loading_seconds"):
            model, coordinates = task.load()
        record.check_step(model, case)
        with record.stepping(StepClock(model)):
            verdict = judge(task, (model, coordinates))
        if verdict.outcome is Outcome.UNRESOLVED:
            verdict = judge(task)
        record.set_verdict(verdict)

    def _task(self, model: str, engine: str) -> TreeTask:
        return model_task(self._prepared, engine, self._declared(model))

    def _declared(self, model: str) -> Sidecar | None:
        return self.sidecar(model) if self._sidecars else None

    def _file(self, model: str, engine: str) -> _FileNumbers:
        """Return the numbers of a file, which engines share that read it alike."""
        sidecar, declared = self._declared(model), self._prepared
        settings = declared.settings if sidecar is None else sidecar.spec(engine).settings
        read = {name: settings[name] for name in _READ if name in settings}
        key = model, repr(read)
        if key not in self._files:
            file = declared.place if sidecar is None else sidecar.model
            self._files[key] = _FileNumbers(file, declared, read)
        return self._files[key]
