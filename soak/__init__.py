"""Attacks on this project: hostile inputs, faults while running, and fuzzing of its parsers."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fnmatch import fnmatchcase


def argument_parser(module: str, description: str | None) -> argparse.ArgumentParser:
    """Return a parser that shows the docstring of `python -m MODULE` as it is."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=description)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    return parser


def is_selected(name: str, patterns: Sequence[str]) -> bool:
    """Return whether a name is one of the patterns, or matches one; True without patterns."""
    return not patterns or name in patterns or any(fnmatchcase(name, one) for one in patterns)
