"""Collect and run cases under pytest; `physics_crosscheck.pytest_plugin` declares the options.

`-p harness.pytest_plugin` loads the plugin without installing the package.
"""

pytest_plugins = ["physics_crosscheck.pytest_plugin"]
