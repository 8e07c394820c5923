"""Load the `system.py` of a system folder."""

import ast
import hashlib
import os
import re
import sys
import traceback
import types
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
from physics_crosscheck.reference.mechanism.declaration import DeclarationError, LocatedError
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.mechanism.tree import TreeError


def load_system(folder: Path) -> System:
    """Return the energy-based system that `folder/system.py` declares.

    Raises:
        DeclarationError: with the file, the line and the remedy; also where the file declares
            bodies.
    """
    system = load_declaration(folder)
    if isinstance(system, MultibodySystem):
        raise DeclarationError(
            f"{folder / 'system.py'}: it declares bodies instead of energies, so "
            "this is not available; use `crosscheck run` or `crosscheck gate`"
        )
    return system


def load_declaration(folder: Path) -> System | MultibodySystem:
    """Return the object named `system` that `folder/system.py` defines.

    The file is executed as code. Its module name is unique to its path, and its folder is not added
    to `sys.path`, so two folders never share a module.

    Raises:
        DeclarationError: with the file, the line and the remedy.
    """
    path = folder / "system.py"
    if not path.is_file():
        what = "not a file" if os.path.lexists(path) else "no such file"
        raise DeclarationError(f"{path}: {what}; a system folder needs it to declare the physics")
    digest = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
    name = f"_crosscheck_system_{digest}"
    module = types.ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        # Compile from source: a bytecode cache misses a change made within the same second.
        exec(compile(path.read_bytes(), str(path), "exec"), module.__dict__)
    except Exception as error:
        line = _line_of(error, path) or _line(error, path)
        located = DeclarationError(f"{path}:{line}: {_sentence(error)}")
        located.file, located.line = path, line
        raise located from error
    system = getattr(module, "system", None)
    if not isinstance(system, (System, MultibodySystem)):
        raise DeclarationError(
            f"{path}: it must end with `system = System(...)`, or with `MultibodySystem(...)`"
        )
    return system


@contextmanager
def with_location(folder: Path) -> Iterator[None]:
    """Add file and line to the message of any `LocatedError` raised within the block."""
    path = folder / "system.py"
    try:
        yield
    except LocatedError as error:
        line = _line_of(error, path)
        place = f"{path}:{line}" if line else str(path)
        located = type(error)(f"{place}: {error}")
        located.about, located.file, located.line = error.about, path, line
        raise located from error


def _line_of(error: Exception, path: Path) -> int | None:
    """Return the line of the call that the error is about, such as `Scenario("free", ...)`."""
    if not isinstance(error, LocatedError) or error.about is None:
        return None
    kind, name = error.about
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Call) and isinstance(node.func, (ast.Name, ast.Attribute)):
            called = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            first = node.args[:1] or [k.value for k in node.keywords if k.arg == "name"]
            if called == kind and [getattr(value, "value", None) for value in first] == [name]:
                return node.lineno
    return None


def _line(error: Exception, path: Path) -> int:
    if isinstance(error, SyntaxError) and error.lineno:
        return error.lineno
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == str(path) and frame.lineno
    ]
    return lines[-1] if lines else 1


def _sentence(error: Exception) -> str:
    if isinstance(error, (DeclarationError, TreeError)):
        return str(error)
    try:
        message = str(error)
    except Exception as worse:
        message = f"its message can't be shown ({type(worse).__name__})"
    if isinstance(error, TypeError) and "missing" in message:
        message = message.replace(".__init__()", "")
        return re.sub("required (positional|keyword-only) argument", "field", message)
    return f"{type(error).__name__}: {message}"
