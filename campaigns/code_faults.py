"""Faults planted in this project's own code, one at a time: does a test fail for each?

`python -m campaigns.code_faults draw COVERAGE FAULTS.json --count 60` draws changes of one
expression each, over all folders of harness and reference, in lines that tests execute. COVERAGE
is what these two commands measure, with coverage and pytest-cov installed:

    COVERAGE_FILE=COVERAGE python -m pytest -m "not slow and not release" \\
        --cov=harness --cov=reference --cov-context=test --cov-report= tests

`python -m campaigns.code_faults run FAULTS.json` plants each in this checkout, which has to be a
copy without changes, runs tests that execute the line, and stores which one fails. Run it before
and after tests change: a fault that a test caught is tried with that test first. Then come the
files of the tests that execute its line, and the test files that are not as they were.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import random
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
SEED = 55
SECONDS, TESTS = 150, 40
"""How long one attempt runs, and how many tests, those that execute the least first."""

_FLIPPED: dict[type, Any] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And,
}  # fmt: skip


class CodeFault(NamedTuple):
    kind: str
    line: int
    start: int
    end: int
    text: str


def flipped(node: ast.AST) -> tuple[str, ast.AST] | None:
    """Return the kind of a change and the changed expression, or None."""
    match node:
        case ast.Compare(left, [operator], right) if type(operator) in _FLIPPED:
            return "comparison", ast.Compare(left, [_FLIPPED[type(operator)]()], right)
        case ast.BinOp(left, operator, right) if type(operator) in _FLIPPED:
            return "arithmetic", ast.BinOp(left, _FLIPPED[type(operator)](), right)
        case ast.BoolOp(operator, values):
            return "and, or", ast.BoolOp(_FLIPPED[type(operator)](), values)
        case ast.UnaryOp(ast.Not(), operand):
            return "not", operand
        case ast.Constant(bool() | int() | float() as value):
            return "constant", ast.Constant(not value if isinstance(value, bool) else value + 1)
    return None


def changes(text: str) -> Iterator[CodeFault]:
    """Yield the possible changes of a module inside functions, each within one line."""
    for function in ast.walk(ast.parse(text)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in (inner for statement in function.body for inner in ast.walk(statement)):
            pairs: list[tuple[str, ast.expr, ast.AST]] = []
            if isinstance(node, ast.expr) and (changed := flipped(node)):
                pairs.append((changed[0], node, changed[1]))
            if isinstance(node, ast.Return) and node.value:
                pairs.append(("return value", node.value, ast.Constant(None)))
            if isinstance(node, ast.If | ast.IfExp | ast.While):
                pairs.append(("condition", node.test, ast.UnaryOp(ast.Not(), node.test)))
            for kind, old, new in pairs:
                if old.lineno == old.end_lineno and old.end_col_offset:
                    shown = f"({ast.unparse(ast.fix_missing_locations(new))})"
                    yield CodeFault(kind, old.lineno, old.col_offset, old.end_col_offset, shown)


def draw(coverage_file: Path, count: int, seed: int) -> list[dict[str, Any]]:
    """Return changes of executed lines, from each folder in turn."""
    data = importlib.import_module("coverage").CoverageData(str(coverage_file))
    data.read()
    contexts: dict[str, dict[int, list[str]]] = {}
    extent: dict[str, int] = defaultdict(int)
    for measured in data.measured_files():
        name = re.sub(r"^.*?/(?=(harness|reference)/)", "", measured)
        contexts[name] = {
            line: sorted({c.split("|")[0] for c in tests if c})
            for line, tests in data.contexts_by_lineno(measured).items()
        }
        for tests in contexts[name].values():
            for test in tests:
                extent[test] += 1
    generator, rooms = random.Random(seed), defaultdict[str, list[str]](list)
    for name in sorted(contexts):
        rooms["/".join(name.split("/")[:2])].append(name)
    faults: list[dict[str, Any]] = []
    while len(faults) < count:
        for room in sorted(rooms):
            name = generator.choice(rooms[room])
            text = (ROOT / name).read_text(encoding="utf-8")
            executed = [c for c in changes(text) if contexts[name].get(c.line)]
            if executed and len(faults) < count:
                change = generator.choice(executed)
                tests = sorted(contexts[name][change.line], key=lambda test: extent[test])
                faults.append(_fault(name, text, change, tests))
    return faults


def _fault(name: str, text: str, change: CodeFault, tests: list[str]) -> dict[str, Any]:
    old = text.splitlines()[change.line - 1].encode()
    new = old[: change.start] + change.text.encode() + old[change.end :]
    return {
        "file": name, "line": change.line, "kind": change.kind, "old": old.decode(),
        "new": new.decode(), "tests": tests[:TESTS], "executing": len(tests),
        "caught": [], "files": list(dict.fromkeys(test.split("::")[0] for test in tests))[:4],
    }  # fmt: skip


def planted(text: str, fault: dict[str, Any]) -> str | None:
    """Return a module with a fault in the line nearest to where it was, or None without it."""
    lines = text.splitlines(keepends=True)
    places = [i for i, line in enumerate(lines, start=1) if line.rstrip("\n") == fault["old"]]
    if not places:
        return None
    place = min(places, key=lambda i: abs(i - int(fault["line"])))
    return "".join([*lines[: place - 1], fault["new"] + "\n", *lines[place:]])


def failing(arguments: Sequence[str], seconds: float) -> str | None:
    """Return the first test that fails, "timeout", or None."""
    present = [argument for argument in arguments if _is_there(argument)]
    if not present:
        return None
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow and not release"]
    command += ["-p", "no:cacheprovider", *present]
    try:
        run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return "timeout"
    if run.returncode in (0, 4, 5):  # 4, 5: no such test
        return None
    failed = re.search(r"^(?:FAILED|ERROR) ([^\s]+)", run.stdout, flags=re.MULTILINE)
    return failed[1] if failed else f"exit code {run.returncode}"


def _is_there(test: str) -> bool:
    """Return whether a test file, or a test in one, still exists."""
    path, function = ROOT / test.split("::")[0], test.split("::")[-1].split("[")[0]
    return path.is_file() and ("::" not in test or f"def {function}(" in path.read_text("utf-8"))


def caught(fault: dict[str, Any], edited: list[str]) -> str | None:
    """Return the test that fails with the fault in place; the file is as it was afterwards."""
    path = ROOT / fault["file"]
    text = path.read_text(encoding="utf-8")
    changed = planted(text, fault)
    if changed is None:
        return "the line is gone"
    attempts = [[test] for test in fault["caught"][-1:] if test]
    attempts += [fault["tests"], fault["files"], edited]
    path.write_text(changed, encoding="utf-8")
    try:
        return next(filter(None, (failing(a, SECONDS) for a in attempts)), None)
    finally:
        path.write_text(text, encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mode", choices=("draw", "run"))
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--since", default="HEAD", help="commit at which the faults were drawn")
    options = parser.parse_args(arguments)
    store = options.paths[-1]
    if options.mode == "draw":
        faults = draw(options.paths[0], options.count, SEED)
        store.write_text(json.dumps(faults, indent=1), encoding="utf-8")
        return
    git = ["git", "-C", str(ROOT), "diff", "--name-only"]
    if subprocess.run([*git, "HEAD"], capture_output=True, text=True).stdout:
        sys.exit("this checkout has changes; plant faults in a copy without any")
    names = subprocess.run([*git, options.since], capture_output=True, text=True).stdout.split()
    edited = [name for name in names if re.match(r"tests/.*test_\w+\.py", name)]
    faults = json.loads(store.read_text(encoding="utf-8"))
    for number, fault in enumerate(faults, start=1):
        test = caught(fault, edited)
        fault["caught"].append(test)
        store.write_text(json.dumps(faults, indent=1), encoding="utf-8")
        print(f"{number:3} {fault['file']}:{fault['line']} {fault['kind']}: {test or 'not caught'}")


if __name__ == "__main__":
    main()
