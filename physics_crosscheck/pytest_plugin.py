"""The pytest plugin: `pytest --crosscheck PATH` makes a test of every case.

pytest imports this module in every project of an environment that has the package. So it holds the
options alone, and imports whatever costs time once there is something to check.

PYTEST_DONT_REWRITE: it asserts nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from physics_crosscheck.harness.interfaces.pytest_plugin.runner import Checker
    from physics_crosscheck.harness.records.case import Case


INI_OPTIONS = (
    "resolution", "thorough", "smooth", "limit", "memory", "baseline", "require_engines",
)  # fmt: skip
"""Options that the ini file and `[tool.crosscheck]` can set too, below the command line."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("crosscheck", "check physics models against their equations")
    group.addoption(
        "--crosscheck",
        action="append",
        default=[],
        metavar="PATH",
        help="test the system folders or robot files at or below PATH; repeatable",
    )
    group.addoption(
        "--require-engines",
        action="store_true",
        dest="crosscheck_require_engines",
        help="fail cases whose engine is not installed, instead of skipping them",
    )
    group.addoption(
        "--crosscheck-resolution",
        metavar="R",
        help="relative difference to resolve [1e-9]",
    )
    group.addoption(
        "--crosscheck-thorough",
        action="store_true",
        help="run every check, also where a cheaper one decides",
    )
    group.addoption(
        "--crosscheck-smooth",
        action="store_true",
        help="check robot files without limits, friction, contacts and drives only",
    )
    group.addoption(
        "--crosscheck-limit",
        metavar="S",
        help="processor seconds for each task [120]",
    )
    group.addoption(
        "--crosscheck-memory",
        metavar="GIB",
        help="memory limit of the worker in GiB [4]",
    )
    group.addoption(
        "--crosscheck-baseline",
        metavar="DIR",
        help="accepted baseline, in the root folder [reports/baseline]",
    )
    group.addoption(
        "--crosscheck-accept",
        metavar="REASON",
        help="accept the results of the selected cases; refused in CI",
    )
    for name in INI_OPTIONS:
        parser.addini(f"crosscheck_{name}", help=f"default of the option for {name}", default=None)
    parser.addini(
        "crosscheck_paths",
        type="paths",
        default=[],
        help="default paths for --crosscheck",
    )


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Declare the hook that a project may implement in its conftest.py."""
    pluginmanager.add_hookspecs(CrosscheckHooks)


class CrosscheckHooks:
    """Hooks that a project's conftest.py can implement."""

    @pytest.hookspec
    def pytest_crosscheck_case(self, record: Case) -> str | Iterable[str] | None:
        """Demand more of a case than that it agrees, such as a global error below one per cent.

        Called with the record of each case that agrees, as in results.json. The case fails with
        the returned sentences, one or a list. A conftest.py covers the system folders and robot
        files below it.
        """


@pytest.fixture(scope="session")
def crosscheck(request: pytest.FixtureRequest) -> Checker:
    """Return a function that runs models in a test, as `physics_crosscheck.check` does.

    `result = crosscheck("models/arm", engines=["NAME"])`, then `assert result, str(result)`. The
    resolution, limits and baseline are those of the command line, paths are from the root folder.
    The test is skipped where no engine of the models is installed, but under --require-engines.
    """
    from physics_crosscheck.harness.interfaces.pytest_plugin.runner import Checker

    return Checker(request.config)


# Last, so that every other plugin's markers are known when ours are named.
@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Register the rest, if there is something to check.

    Raises:
        pytest.UsageError: for a path without a target, or an option out of range.
    """
    try:
        if not (config.getoption("crosscheck") or config.getini("crosscheck_paths")):
            return
    except (TypeError, pytest.UsageError) as error:
        # pytest joins what stands there to its folder, whatever it is.
        message = f"{config.inipath}: crosscheck_paths must be a list of paths: {error}"
        raise pytest.UsageError(message) from None
    from physics_crosscheck.harness.interfaces.pytest_plugin.session import CrosscheckSession

    config.pluginmanager.register(CrosscheckSession(config), "crosscheck-session")
