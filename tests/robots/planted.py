"""An MJCF that is prepared once, with wrong numbers to detect and to locate by line."""

from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.checks.case import judge, run_case, stepped_model
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.mechanism.tree import Tree
from tests.diagnosis.test_robot import check_named

STATES = 12
"""States of a file; a few suffice, since each of these robots has few numbers."""


@dataclass(frozen=True)
class PreparedFile:
    """A file, its equations, and the task that compares an engine with them."""

    file: Path
    prepared: PreparedTree
    task: TreeTask

    @property
    def left_out(self) -> tuple[str, ...]:
        """The elements of the file that the equations leave out."""
        return self.prepared.left_out

    def outcome(self, **settings: object) -> tuple[Outcome, str]:
        """Return outcome and reason of a run with these settings."""
        case = run_case(self.task.with_settings(**settings))
        return case.outcome, case.reason

    def accelerations(self) -> Outcome:
        compared = stepped_model(self.task, *self.task.load())
        assert compared is not None
        comparison = compared.accelerations(*self.prepared.states(self.task.scenario))
        assert comparison is not None
        return comparison.judgement.outcome

    def outcome_with(self, old: str, new: str) -> Outcome:
        """Return the outcome of comparing accelerations after a change of the file."""
        text = self._write(old, new)
        try:
            return self.accelerations()
        finally:
            self.file.write_text(text)

    def assert_named(self, old: str, new: str, address: str, line: int) -> None:
        """Check that the diagnosis names a wrong number; both texts are attributes of numbers."""
        words, others = old.split('"')[1].split(), new.split('"')[1].split()
        (which,) = [i for i, (a, b) in enumerate(zip(words, others, strict=True)) if a != b]
        text = self._write(old, new)
        try:
            assert judge(self.task).outcome is Outcome.DIFFERS
            diagnosis = diagnose_robot(self.task, is_reference=False)
        finally:
            self.file.write_text(text)
        right, wrong = float(words[which]), float(others[which])
        check_named(diagnosis, address, line, self.file.name, right, wrong)

    def _write(self, old: str, new: str) -> str:
        text = self.file.read_text()
        assert text.count(old) == 1, old
        self.file.write_text(text.replace(old, new))
        return text


def prepare_file(folder: Path, text: str, engine: str = "") -> PreparedFile:
    file = folder / "model.xml"
    file.write_text(text)
    prepared = prepare_tree(file, states=STATES)
    name = engine or next(one.name for one in engines_reading(".xml") if one.version())
    return PreparedFile(file, prepared, model_task(prepared, name))


def tree_of(file: Path) -> Tree:
    from physics_crosscheck.harness.modelfiles.mjcf.read import read_compiled_robot

    tree = read_compiled_robot(file).tree
    assert tree is not None
    return tree
