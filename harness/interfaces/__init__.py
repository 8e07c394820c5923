"""Entry points: command line, Python functions, and the pytest plugin."""
