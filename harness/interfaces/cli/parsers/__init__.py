"""Arguments and help of each command, a module each: `add` and `ABOUT`.

They import nothing that only the work needs, so help and completion load no sympy and no engine.
"""
