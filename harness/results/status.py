"""Status of a test of a case or an audit, and number formats of all texts."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from physics_crosscheck.harness.records.case import Case, TimeStep
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.scene import UnreadMesh


class TestStatus(StrEnum):
    """Status of the test of a case or an audit."""

    __test__ = False  # keep pytest from collecting this class

    PASS = "pass"
    FAIL = "fail"
    SKIP = "skip"


@dataclass(frozen=True)
class Decision:
    """Status of a test, and its reason; empty for a pass."""

    status: TestStatus
    reason: str


def status_of(
    record: Case | Model,
    *,
    require_engines: bool,
    demands: Sequence[str] = (),
    judged_by: Sequence[str] = (),
) -> Decision:
    """Decide the test status of a case or of a model's audit.

    An accepted result passes unless it is a crash.

    Args:
        record: the case, or the model with its audit.
        require_engines: whether an engine that is not installed is a failure.
        demands: the project's further requirements that this case does not meet.
        judged_by: other engines with a verdict on the robot file that this engine rejects.
    """
    if isinstance(record, Model):
        if record.passes:
            return Decision(TestStatus.PASS, "")
        failed = "; ".join(f"{what} failed: {why}" for what, why in record.failures)
        return Decision(TestStatus.FAIL, failed or counted(len(record.findings), "finding"))
    if record.outcome is Outcome.ABSENT and (record.kind == "no joint" or not require_engines):
        return Decision(TestStatus.SKIP, record.reason)
    if record.outcome is Outcome.REFUSED and judged_by:
        names = " and ".join(judged_by)
        return Decision(TestStatus.SKIP, f"REFUSED, but {names} ran it: {record.reason}")
    if not record.passes:
        return Decision(TestStatus.FAIL, record.reason)
    if demands and not record.accepted:
        return Decision(TestStatus.FAIL, "; ".join(demands))
    return Decision(TestStatus.PASS, "")


def unsettled_steps(case: Case) -> str:
    """Return how whole steps differ, unless they decide the case, or are unresolved; else ""."""
    step = case.whole_step
    if step is None or step.outcome not in (Outcome.DIFFERS, Outcome.UNRESOLVED):
        return ""
    deciding = case.verdict is not None and case.verdict.decided_by == "whole steps"
    if step.outcome is Outcome.DIFFERS:
        off = f"{step.component} off by {percent(step.discrepancy or 0.0)} of its largest value"
        states = counted(step.states, "state")
        return "" if deciding else f"differ at {states}: {off}, uncertainty {step.uncertainty:.1e}"
    states = counted(step.unresolved or step.states, "state")
    return f"unresolved at {states}: uncertainty {step.uncertainty:.1e} of {step.component}"


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a count with its noun: `1 finding`, `2 findings`, `2 bodies`.

    Args:
        number: the count.
        noun: singular.
        plural: plural; empty: the noun with an s.
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def listed(names: Sequence[str], limit: int) -> str:
    """Return names in a sentence, up to a limit: `a, b and 3 more`."""
    more = len(names) - limit
    return ", ".join(names[:limit]) + (f" and {more} more" if more > 0 else "")


def percent(share: float) -> str:
    """Return a share in percent with two digits: `0.50 %`, `12 %`, `210 %`.

    A share below 0.01 % has a power of ten instead, such as `8.5e-07`.
    """
    value = 100 * share
    if value == 0:
        return "0 %"
    if value < 0.01:
        return f"{share:.1e}"
    if value < 10:
        return f"{value:.2f} %" if value < 1 else f"{value:.1f} %"
    scale = 10 ** (len(f"{value:.0f}") - 2)
    return f"{round(value / scale) * scale:.0f} %"


def duration(seconds: float) -> str:
    """Return a time with two or three digits and a unit: `2 ms`, `0.18 ms`, `76 µs`, `21 s`."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size or unit == "µs":
            value = float(f"{seconds / size:.2g}")
            return f"{round(seconds / size) if value >= 100 else f'{value:g}'} {unit}"
    raise AssertionError("every time has a unit")


LEAST, TENTH = 1e-4, 1e-3
"""Smallest error of a time step that is stated, and the one for which a step is."""


NOT_FOLLOWED = "no time step that was run follows 1 s of this motion"
"""Instead of an error that halving the step does not reduce as the order of the engine demands."""


def step_words(step: TimeStep) -> str:
    """Return the error of a time step in words, or that it is unstable."""
    size = duration(step.step or 0.0)
    if step.finding is not None:
        stable = step.largest_stable
        return f"{size} is unstable{f', {duration(stable)} is stable' if stable else ''}"
    motion = f"(smooth motion, {duration(step.duration or 0.0)})"
    if step.error is None:
        return f"{size} blows up {motion}"
    if not step.order:
        return NOT_FOLLOWED
    off = percent(step.error) if step.error >= LEAST else f"less than {100 * LEAST:g} %"
    target = next((one.step for one in step.steps_for if one.target == TENTH), None)
    if step.error <= TENTH:
        target = None
    gives = f", {duration(target)} gives {100 * TENTH:g} %" if target else ""
    return f"{size} is {off} off{gives} {motion}"


def unread_words(meshes: Sequence[UnreadMesh]) -> str:
    """Return meshes in words by problem: `a.stl and 3 more are missing; c.stl is empty`.

    A mesh without a reader names the package to install.
    """
    problems: dict[str, list[str]] = {}
    for mesh in meshes:
        problems.setdefault(mesh.problem, []).append(mesh.name)
    remedy = {"without a reader": " (run `pip install 'physics-crosscheck[meshes]'`)"}
    return "; ".join(
        f"{listed(names, 3)} {'is' if len(names) == 1 else 'are'} {problem}"
        f"{remedy.get(problem, '')}"
        for problem, names in problems.items()
    )
