"""The statement of each engine about its own file: against the file's equations, as `run` does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.compare.candidate import Candidate, Facts
from physics_crosscheck.harness.commands.compare.execute import ask_each
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.outcome import Outcome


@dataclass(frozen=True, kw_only=True)
class OwnFile:
    """An engine against the equations of its file; both None without equations.

    Attributes:
        case: the verdict.
        diagnosis: the causes of a difference.
    """

    case: Case | None = None
    diagnosis: Diagnosis | None = None

    @property
    def explains(self) -> bool:
        """True if a cause of a difference is known."""
        return self.diagnosis is not None and self.diagnosis.explained


def check_own_files(
    executor: Executor,
    models: tuple[Facts, Facts],
    resolution: float,
) -> tuple[OwnFile, OwnFile]:
    """Judge and diagnose both engines, each against its own file.

    A file with a sidecar has none: its settings and springs are not in the file's equations.
    """
    prepared: dict[object, PreparedTree] = {}
    checked: dict[object, OwnFile] = {}
    keys = []
    for model_facts in models:
        model = model_facts.candidate
        settings = model.settings
        floating = bool(settings.get("floating", False))
        place = model.sidecar.model, floating, str(settings.get("model", ""))
        keys.append((*place, model.engine))
        robot = model_facts.robot
        if not model.bare or robot is None or robot.tree is None or keys[-1] in checked:
            continue
        if place not in prepared:
            read = partial(prepare_tree, floating=floating, model=place[-1])
            (target,) = ask_each(executor, model, read, [model.sidecar.model])
            if isinstance(target, Failure):
                continue  # no joint moves, or one moves no mass; the comparison reports it
            prepared[place] = target
        checked[keys[-1]] = _check(executor, model, prepared[place], resolution)
    a, b = (checked.get(key, OwnFile()) for key in keys)
    return a, b


def _check(
    executor: Executor, model: Candidate, target: PreparedTree, resolution: float
) -> OwnFile:
    task = model_task(target, model.engine, resolution=resolution)
    (case,) = ask_each(executor, model, run_case, [task])
    if isinstance(case, Failure):
        return OwnFile(case=failed_case(task.id, str(task.file), case))
    if case.outcome is not Outcome.DIFFERS:
        return OwnFile(case=case)
    diagnose = partial(diagnose_robot, is_reference=True)
    (causes,) = ask_each(executor, model, diagnose, [task])
    diagnosis = Diagnosis(failure=causes.reason) if isinstance(causes, Failure) else causes
    return OwnFile(case=case, diagnosis=diagnosis)
