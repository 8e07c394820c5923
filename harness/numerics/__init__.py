"""Extrapolation of engine motions to a zero time step, and the error of a finite one."""
