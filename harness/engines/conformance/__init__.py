"""Protocol checks for an engine adapter, one named check per requirement.

    for check in conform(MyEngine(), ModelSpec(Path("arm.sdf"), settings={"step": 0.002})):
        print(check)

Every check loads the model again and tests one requirement, so that one mistake in an adapter fails
one check. No check knows the model's equations: `crosscheck run` compares motions. The model needs
independent coordinates near its `home` and smooth dynamics there.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..protocol import Engine, ModelSpec
from . import adapter_checks
from .subject import ConformanceError, ConformanceSubject

CHECKS: tuple[Callable[[ConformanceSubject], None], ...] = (
    adapter_checks.engine_is_described,
    adapter_checks.model_is_described,
    adapter_checks.hooks_have_their_shapes,
    adapter_checks.the_step_stays_the_shipped_one,
    adapter_checks.rollouts_have_their_shape,
    adapter_checks.every_gives_the_ends_of_shorter_rollouts,
    adapter_checks.arguments_are_left_alone,
    adapter_checks.results_are_the_callers,
    adapter_checks.a_rollout_repeats_bitwise,
    adapter_checks.an_earlier_step_leaves_no_trace,
    adapter_checks.an_earlier_force_leaves_no_trace,
    adapter_checks.a_batch_is_its_rows_one_by_one,
    adapter_checks.a_force_acts_in_its_own_step,
    adapter_checks.impulses_are_in_proportion,
    adapter_checks.a_force_by_state_is_the_same_force,
    adapter_checks.a_force_by_state_sees_the_start_of_its_step,
    adapter_checks.what_is_not_finite_is_returned_so,
    adapter_checks.what_is_not_finite_spoils_nothing,
    adapter_checks.orders_are_as_claimed,
    adapter_checks.accelerations_are_those_of_small_steps,
    adapter_checks.errors_name_the_file,
    adapter_checks.an_unknown_setting_is_refused,
)
"""All checks, in the order in which they are reported."""


@dataclass(frozen=True)
class Check:
    """The result of one check of an adapter.

    Attributes:
        name: of the check.
        passed: whether the adapter meets the requirement.
        sentence: the problem and the requirement; for a passed check, the requirement.
    """

    name: str
    passed: bool
    sentence: str

    def __str__(self) -> str:
        return f"{'passed' if self.passed else 'FAILED'}  {self.name}: {self.sentence}"


def conform(engine: Engine, spec: ModelSpec) -> tuple[Check, ...]:
    """Check an adapter against the protocol, on one model that it loads."""
    return tuple(_checked(check, engine, spec) for check in CHECKS)


def conform_samples(engine: Engine) -> dict[str, tuple[Check, ...]]:
    """Run the checks on each of the adapter's samples; return them by file name."""
    checks = {}
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        for sample in engine.samples():
            path = Path(folder) / sample.file
            path.write_text(sample.text, encoding="utf-8")
            checks[sample.file] = conform(engine, ModelSpec(path, sample.springs, sample.settings))
    return checks


def _checked(check: Callable[[ConformanceSubject], None], engine: Engine, spec: ModelSpec) -> Check:
    name = check.__name__.replace("_", " ")
    try:
        check(ConformanceSubject(engine, spec))
    except ConformanceError as broken:
        return Check(name, False, str(broken))
    except Exception as error:
        return Check(name, False, f"it ended in {type(error).__name__}: {error}")
    return Check(name, True, " ".join((check.__doc__ or "").split()))
