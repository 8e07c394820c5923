"""What the command line of pytest says of how cases are run."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.jobs.limits import Limits


@dataclass(frozen=True)
class Terms:
    """How cases are run.

    Attributes:
        resolution: relative discrepancy to resolve.
        limits: of a task.
        baseline: folder where known differences are looked up.
    """

    resolution: float
    limits: Limits
    baseline: Path


def terms(config: pytest.Config) -> Terms:
    """What the options say.

    Raises:
        pytest.UsageError: for one that is out of range.
    """
    try:
        return Terms(
            resolution=arguments.resolution(config.getoption("crosscheck_resolution")),
            limits=Limits(
                seconds=arguments.seconds(config.getoption("crosscheck_limit")),
                memory=arguments.memory(config.getoption("crosscheck_memory")),
                options="--crosscheck-",
            ),
            baseline=config.rootpath / config.getoption("crosscheck_baseline"),
        )
    except (argparse.ArgumentTypeError, ValueError) as error:
        raise pytest.UsageError(f"--crosscheck: {error}") from None
