"""Settings for running cases, from pytest's command line."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.jobs.limits import Limits


@dataclass(frozen=True)
class RunSettings:
    """Settings for running cases.

    Attributes:
        resolution: smallest relative discrepancy to detect.
        limits: limits of a task.
        baseline: folder of the accepted differences.
        thorough: whether every check of a case runs.
    """

    resolution: float
    limits: Limits
    baseline: Path
    thorough: bool


def run_settings(config: pytest.Config) -> RunSettings:
    """Return the settings of the options.

    Raises:
        pytest.UsageError: if one is out of range.
    """
    try:
        return RunSettings(
            resolution=arguments.resolution(config.getoption("crosscheck_resolution")),
            limits=Limits(
                seconds=arguments.seconds(config.getoption("crosscheck_limit")),
                memory=arguments.memory(config.getoption("crosscheck_memory")),
                options="--crosscheck-",
            ),
            baseline=config.rootpath / config.getoption("crosscheck_baseline"),
            thorough=config.getoption("crosscheck_thorough"),
        )
    except (argparse.ArgumentTypeError, ValueError) as error:
        raise pytest.UsageError(f"--crosscheck: {error}") from None
