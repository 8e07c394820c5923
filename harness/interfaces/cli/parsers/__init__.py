"""Arguments and help of the commands, a module each: `add` and `ABOUT`.

These modules import only what parsing needs, so help and completion load no sympy and no engine.
"""
