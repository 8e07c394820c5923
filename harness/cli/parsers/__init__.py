"""What each command takes: a module a command, which imports nothing that only its work needs.

So help, completion and a wrong word cost no sympy, no scipy and no engine.
"""
