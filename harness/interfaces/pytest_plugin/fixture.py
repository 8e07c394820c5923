"""The fixture `crosscheck`: models that a test of a project runs."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import pytest

from physics_crosscheck.harness.interfaces.api import Results, check
from physics_crosscheck.harness.interfaces.pytest_plugin.terms import terms


class Checker:
    """Runs models as `check` does, on the terms of the command line; the same ones once."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._terms = config, terms(config)
        self._found: dict[tuple[tuple[str, ...], tuple[str, ...], float], Results] = {}

    def __call__(
        self,
        *paths: str | PathLike[str],
        engines: Sequence[str] = (),
        resolution: float | None = None,
    ) -> Results:
        """What became of the models of system folders; true where all of them agree.

        Args:
            paths: system folders, from the root folder, or names of built-in ones.
            engines: only these; none: every engine that the sidecars name.
            resolution: relative discrepancy to resolve; None: that of the command line.

        Raises:
            FolderError: for a path that is no system folder, or an engine that nobody knows.
        """
        root, terms = self._config.rootpath, self._terms
        # What is no path there is a built-in system's name, as for `check`.
        named = [str(root / path) if (root / path).exists() else str(path) for path in paths]
        wanted = terms.resolution if resolution is None else resolution
        key = tuple(named), tuple(engines), wanted
        if key not in self._found:
            self._found[key] = check(
                *named,
                engines=engines,
                resolution=wanted,
                limit=terms.limits.seconds,
                memory=terms.limits.memory,
                baseline=terms.baseline,
            )
        found = self._found[key]
        if found.untested and not self._config.getoption("crosscheck_require_engines"):
            pytest.skip(found.untested)
        return found
