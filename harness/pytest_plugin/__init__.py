"""The pytest plugin: `pytest --crosscheck PATH` makes a test of every case.

pytest imports this module in every project of an environment that has the package, so it holds the
options alone; whatever costs time is imported once there is something to check. The entry point has
this module's name, so that `-p harness.pytest_plugin` and the entry point never register it twice.
"""

from __future__ import annotations

import pytest

NAME = "crosscheck-session"
"""Under which the part that does something is registered, where there is something to do."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("crosscheck", "physics models against their equations")
    group.addoption(
        "--crosscheck", action="append", default=[], metavar="PATH",
        help="test every case of every system folder under PATH; repeatable",
    )  # fmt: skip
    group.addoption(
        "--require-engines", action="store_true", dest="crosscheck_require_engines",
        help="fail, not skip, the cases whose engine is not installed",
    )  # fmt: skip
    group.addoption(
        "--crosscheck-resolution", metavar="R", default="1e-9",
        help="relative discrepancy to resolve (1e-9)",
    )  # fmt: skip
    group.addoption(
        "--crosscheck-time-limit", metavar="S", default="120",
        help="seconds that one case may take (120)",
    )  # fmt: skip
    parser.addini(
        "crosscheck_paths", type="paths", default=[],
        help="paths for a run that names neither tests nor --crosscheck",
    )  # fmt: skip


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Declare the hook that a project may implement in its conftest.py."""
    from harness.pytest_plugin import hooks

    pluginmanager.add_hookspecs(hooks)


# Last, so that every other plugin's markers are known when ours are named.
@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Register the rest, if there is something to check.

    Raises:
        pytest.UsageError: for a path without a system folder, or an option out of range.
    """
    if config.getoption("crosscheck") or config.getini("crosscheck_paths"):
        from harness.pytest_plugin.session import CrosscheckSession

        config.pluginmanager.register(CrosscheckSession(config), NAME)
