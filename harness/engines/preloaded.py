"""Import, once for all worker processes, engines that print nothing and start no thread.

An engine that is missing or broken is left to the tasks that need it.
"""

import contextlib

with contextlib.suppress(Exception):
    import mujoco  # noqa: F401
