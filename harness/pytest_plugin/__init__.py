"""The part of the pytest plugin that does something; `pytest_crosscheck` has its options.

`-p harness.pytest_plugin` loads the plugin where the package is not installed, and is the same as
the entry point where it is.
"""

pytest_plugins = ["pytest_crosscheck"]
