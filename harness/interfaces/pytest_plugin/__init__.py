"""Collect and run cases under pytest; `physics_crosscheck.pytest_plugin` declares the options.

`-p harness.pytest_plugin` loads the plugin where the package is not installed, and is the same as
the entry point where it is.
"""

pytest_plugins = ["physics_crosscheck.pytest_plugin"]
