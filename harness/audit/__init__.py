"""The audit: what a model file says and what an engine makes of it, without any motion.

Three readings: every bound literal against its expression; the compiled mass matrix, damping,
stiffness, rest forces and accelerations against the equations; and what the engine or the format
adds or drops on its own.
"""
