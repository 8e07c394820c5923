"""Environment variables of engines in worker processes; values of the user stay.

They must be set before any engine is imported, so this module imports none.

MuJoCo imports graphics libraries unless they are disabled: a quarter of its import time.

JAX selects a GPU by default, and reserves three quarters of its memory in each process. One worker
then exceeds its memory limit, and several do not fit. Models are small, so they run on the CPU.
"""

VARIABLES = {
    "MUJOCO_GL": "disable",
    "JAX_PLATFORMS": "cpu",
    "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
}
