"""A robot file in a sweep, with the numbers of the file as constants.

The file is read and its states are chosen once. A draw changes digits in a copy and makes the same
changes in the tree. The reference states of a draw are computed from those of the file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.engines.registry import engines_reading, engines_to_run
from physics_crosscheck.harness.extras.sweep.known import CaseRecord, Timed
from physics_crosscheck.harness.extras.sweep.planned import Planned
from physics_crosscheck.harness.extras.sweep.recent import RecentValues
from physics_crosscheck.harness.extras.sweep.source import Source
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.robot_system import RobotError
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.resolved import ReusedSegments
from physics_crosscheck.reference.solving.segments import Segments


@dataclass(frozen=True)
class _Draw:
    """The tree of a draw, and the reference states of its equations."""

    tree: Tree
    samples: Segments


class SweptRobot(Source):
    """A robot file, and the data that its cases share.

    Args:
        file: the model file.

    Raises:
        RobotError, ReferenceError: naming file, line and remedy.
    """

    signed = False

    def __init__(self, file: Path) -> None:
        self._prepared = prepare_tree(file)
        self._numbers = robot_numbers(file, self._prepared.settings)
        self._index = {
            self._numbers.numerals[i].address: i for i in reversed(self._numbers.relevant_numbers)
        }
        self._varied = frozenset[str]()
        self._resolved: ReusedSegments | None = None
        self._ways: dict[str, tuple[str, Mapping[str, Mapping[str, object]]]] = {}
        self._draws = RecentValues[_Draw]()

    def varying(self, varied: frozenset[str]) -> SweptRobot:
        """Return the same file with other varied numbers, by their addresses."""
        other = copy(self)
        other._varied, other._draws = varied & self._index.keys(), RecentValues[_Draw]()
        return other

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._prepared.record.name

    @property
    def constants(self) -> Mapping[str, float]:
        """Every number that affects bodies and joints, by its address."""
        numerals = self._numbers.numerals
        return {numerals[i].address: numerals[i].value for i in sorted(self._index.values())}

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of its states."""
        return (self._prepared.scenario,)

    def runs(self, only: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Yield the file with every engine that reads it, or with the selected engines."""
        file = self._prepared.place
        for engine in (engines_reading if only else engines_to_run)(file.suffix):
            if not only or engine.name in only:
                yield file.name, engine.name

    def prepare(self, model: str, engine: str) -> tuple[str, Mapping[str, Mapping[str, object]]]:
        """Load the unchanged file, and solve the equations that its draws start from."""
        if self._resolved is None:
            self._resolved = ReusedSegments(self._prepared.system, self._prepared.samples)
        if engine not in self._ways:
            loaded_model, _ = self._task(engine).load()
            self._ways[engine] = loaded_model.integrator, loaded_model.integrators
        return self._ways[engine]

    def run(self, case: Planned, resolution: float, place: Path, record: CaseRecord) -> None:
        """Run every segment of the drawn robot; accelerations decide what motions can't resolve."""
        values = {self._index[name]: case.constants[name] for name in sorted(self._varied)}
        with record.timing("reference_seconds"):
            drawn = self._draws.get(tuple(values.values()), lambda: self._solved(values))
        task = self._task(case.engine, resolution).with_settings(**case.settings)
        task = task.with_target(
            system=replace(self._prepared.system, tree=drawn.tree), samples=drawn.samples
        )
        if values:
            task = task.with_file(copy_with_texts(task.file, self._numbers.texts(values), place))
        with record.timing("loading_seconds"):
            loaded, coordinates = task.load()
            model = Timed(loaded)
        record.check_step(model, case)
        with record.stepping(model):
            verdict = judge(task, (model, coordinates))
        if verdict.outcome is Outcome.UNRESOLVED:
            verdict = judge(task)
        record.tell_verdict(verdict)

    def _task(self, engine: str, resolution: float = 0.0) -> TreeTask:
        return model_task(self._prepared, engine, resolution=resolution)

    def _solved(self, values: Mapping[int, float]) -> _Draw:
        scenarios = self._prepared
        if not values or self._resolved is None:
            return _Draw(scenarios.system.tree, scenarios.samples)
        tree = self._numbers.tree(values)
        same = tree is not None and [(one.name, one.kind) for one in tree.links] == [
            (one.name, one.kind) for one in scenarios.system.tree.links
        ]
        if tree is None or not same:
            raise RobotError(
                f"{scenarios.place}: with these numbers it makes other joints, or none"
            )
        return _Draw(tree, self._resolved.for_tree(tree))
