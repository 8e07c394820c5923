"""Completion with Tab: `eval "$(crosscheck completion bash)"` in a shell's start-up file.

The shell asks `crosscheck` itself, through argcomplete, so engines and built-in systems are
current.
"""

import argparse
import os
import shlex
from collections.abc import Callable, Iterable

COMPLETING = "_ARGCOMPLETE"
"""Environment variable that a shell sets to request completions."""

SHELLS = ("bash", "zsh", "fish", "powershell")

Completer = Callable[..., Iterable[str]]
"""Returns completions of its argument `prefix`; it ignores its other arguments."""


def main(options: argparse.Namespace) -> int:
    """Print the script."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["crosscheck"], shell=options.shell))
    return 0


def words_before() -> list[str]:
    """Return the typed words without the program's name."""
    line = os.environ.get("COMP_LINE", "")[: int(os.environ.get("COMP_POINT", "0"))]
    try:
        return shlex.split(line)[1:]
    except ValueError:  # an open quotation
        return line.split()[1:]


def complete(parser: argparse.ArgumentParser) -> None:
    """Print completions for the shell, and end the process."""
    import argcomplete

    argcomplete.autocomplete(parser)


def engine_names(**_: object) -> Iterable[str]:
    """Return the names of engines."""
    from physics_crosscheck.harness.engines.registry import engines

    return sorted(engines())


def systems_and_files(prefix: str, **_: object) -> Iterable[str]:
    """Return the names of built-in systems, and files."""
    from argcomplete.completers import FilesCompleter

    from physics_crosscheck.harness.modelfiles.folders import system_folders

    systems = [folder.name for folder in system_folders([])]
    return [*systems, *FilesCompleter()(prefix)]
