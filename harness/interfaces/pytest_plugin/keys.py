"""Keys of the plugin's data in pytest's configuration."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.interfaces.pytest_plugin.runner import CaseRunner

RUNNER = pytest.StashKey[CaseRunner]()
