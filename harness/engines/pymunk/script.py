"""Execution of the Python file that builds a Space; errors name its lines."""

from __future__ import annotations

import hashlib
import sys
import traceback
import types
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.source import one_line, read_source


def run_file(path: Path) -> Any:
    """Run the file and return it as a module.

    Raises:
        EngineError: naming file and line.
    """
    text = read_source(path)
    digest = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
    name = f"_crosscheck_space_{digest}"
    module = types.ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    with script_errors(path, ""):
        # Compile from the text: a bytecode cache would miss a file that was rewritten within a
        # second.
        exec(compile(text, str(path), "exec"), module.__dict__)
    if not callable(getattr(module, "build", None)):
        raise EngineError(f"{path}: it must define build() -> (Space, {{name: Body}})")
    return module


@contextmanager
def script_errors(path: Path, what: str) -> Iterator[None]:
    """Convert any exception of a script into an error with its line.

    An exit, or an interruption that the script raises itself, must not end other work in this
    process.
    """
    try:
        yield
    except EngineError as error:
        raise error if str(path) in str(error) else EngineError(str(error), file=path) from None
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and not _raised_by(error, path):
            raise
        raise script_error(error, path, what) from None


def script_error(error: BaseException, path: Path, what: str) -> EngineError:
    """Return an error of a script, at its line."""
    message = one_line(error)
    kind = type(error).__name__
    sentence = f"{what} fails: {message or kind}" if what else f"{kind}: {message}".rstrip(": ")
    return EngineError(sentence, file=path, line=_line(error, path))


def _line(error: BaseException, path: Path) -> int:
    if isinstance(error, SyntaxError) and error.lineno:
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return lines[-1] or 1 if lines else 1


def _raised_by(error: BaseException, path: Path) -> bool:
    """Return whether the script itself raised the error, as opposed to Ctrl-C."""
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1] if frames else None
    return last is not None and last.filename == str(path) and "raise" in (last.line or "")
