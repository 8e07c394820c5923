"""Environment variables of engines in worker processes, unless the user sets others.

MuJoCo imports libraries for windows unless it draws none: a quarter of the time that it takes.

JAX takes a graphics processor by default, and reserves three quarters of its memory in each
process. One worker then exceeds its limit, and eight have no room. Models here are small, so they
run on the processor, unless the user sets another platform.
"""

VARIABLES = {
    "MUJOCO_GL": "disable",
    "JAX_PLATFORMS": "cpu",
    "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
}
