"""The fixture `crosscheck`, with which tests of a project run models."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from physics_crosscheck.harness.interfaces.api import Results, Target, check, target_names
from physics_crosscheck.harness.interfaces.pytest_plugin.terms import run_settings


class Checker:
    """Runs models as `check` does, with the settings of the command line; each model once."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._settings = config, run_settings(config)
        self._results: dict[tuple[object, ...], Results] = {}

    def __call__(
        self,
        *paths: Target | Sequence[Target],
        engines: Sequence[str] = (),
        resolution: float | None = None,
        floating: bool = False,
        model: str = "",
    ) -> Results:
        """Run models as `check` does; the results are true if all of them agree.

        Args:
            paths: as for `check`, relative to the root folder.
            engines, floating, model: as for `check`.
            resolution: smallest relative discrepancy to detect; None: that of the command line.

        Raises:
            FolderError: for a path without a target, or an unknown engine.
        """
        root, settings = self._config.rootpath, self._settings
        names = target_names(paths)
        # As for `check`, a name without a path is a built-in system.
        named = [str(root / name) if (root / name).exists() else name for name in names]
        wanted = settings.resolution if resolution is None else resolution
        key = tuple(named), tuple(engines), wanted, floating, model
        if key not in self._results:
            self._results[key] = check(
                *named,
                engines=engines,
                resolution=wanted,
                limit=settings.limits.seconds,
                memory=settings.limits.memory,
                baseline=settings.baseline,
                thorough=settings.thorough,
                floating=floating,
                model=model,
            )
        results = self._results[key]
        if results.untested and not self._config.getoption("crosscheck_require_engines"):
            pytest.skip(results.untested)
        return results
