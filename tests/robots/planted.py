"""An MJCF that is prepared once, and numbers made wrong in it: caught, and named by their line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.checks.case import judge, run_case, stepped_model
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.tree import Tree
from tests.diagnosis.test_robot import check_named

STATES = 12
"""Of a file: each of these robots has few numbers."""


@dataclass(frozen=True)
class Checked:
    """A file, what its equations say, and how an engine is held against these."""

    file: Path
    prepared: PreparedTree
    task: TreeTask

    @property
    def left_out(self) -> tuple[str, ...]:
        """What the equations do not have."""
        return self.prepared.left_out

    def outcome(self, **settings: object) -> tuple[Outcome, str]:
        """What a run says, and why; with other settings too."""
        case = run_case(self.task.with_settings(**settings))
        return case.outcome, case.reason

    def accelerations(self) -> Outcome:
        """What accelerations at the states say of the file."""
        compared = stepped_model(self.task, *self.task.load())
        assert compared is not None
        found = compared.accelerations(*self.prepared.states(self.task.scenario))
        assert found is not None
        return found.judgement.outcome

    def differs(self, old: str, new: str) -> Outcome:
        """What accelerations say of the file with another number."""
        text = self._write(old, new)
        try:
            return self.accelerations()
        finally:
            self.file.write_text(text)

    def is_named(self, old: str, new: str, address: str, line: int) -> None:
        """Hold what is said of a wrong number against what was done; both texts are numbers."""
        words, others = old.split('"')[1].split(), new.split('"')[1].split()
        (which,) = [i for i, (a, b) in enumerate(zip(words, others, strict=True)) if a != b]
        text = self._write(old, new)
        try:
            assert judge(self.task).outcome is Outcome.DIFFERS
            found = diagnose_robot(self.task, is_reference=False)
        finally:
            self.file.write_text(text)
        right, wrong = float(words[which]), float(others[which])
        check_named(found, address, line, self.file.name, right, wrong)

    def _write(self, old: str, new: str) -> str:
        text = self.file.read_text()
        assert text.count(old) == 1, old
        self.file.write_text(text.replace(old, new))
        return text


def checked(folder: Path, text: str, engine: str = "") -> Checked:
    """A file of that text."""
    file = folder / "model.xml"
    file.write_text(text)
    prepared = prepare_tree(file, states=STATES)
    name = engine or next(one.name for one in engines_reading(".xml") if one.version())
    return Checked(file, prepared, model_task(prepared, name))


def tree_of(file: Path) -> Tree:
    """Its tree."""
    from physics_crosscheck.harness.modelfiles.mjcf.read import read_compiled_robot

    tree = read_compiled_robot(file).tree
    assert tree is not None
    return tree
