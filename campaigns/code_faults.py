"""Faults planted in this project's own code, one at a time: does a test fail for each?

`python -m campaigns.code_faults draw COVERAGE FAULTS.json --count 60` draws changes of one
expression each, over all folders of harness and reference, in lines that tests execute. COVERAGE
is what this command measures, with coverage and pytest-cov installed:

    COVERAGE_FILE=COVERAGE python -m pytest -m "not slow and not release" tests \\
        --cov=harness --cov=reference --cov-context=test --cov-report=

`python -m campaigns.code_faults run FAULTS.json` plants each in the working folder, a copy of the
checkout without changes, and stores which test fails. Run it before and after tests change: the
test that caught a fault comes first, then those that execute its line, their files, changed files.
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
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
SEED, SECONDS, TESTS = 55, 150, 40  # TESTS that execute the line run, the least extensive first

_FLIPPED: dict[type, Any] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And,
}  # fmt: skip


class CodeFault(NamedTuple):
    kind: str
    line: int
    columns: tuple[int, int]
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
                    yield CodeFault(kind, old.lineno, (old.col_offset, old.end_col_offset), shown)


def draw(coverage_file: Path, count: int, seed: int) -> list[dict[str, Any]]:
    """Return changes of executed lines, from each folder in turn."""
    data = importlib.import_module("coverage").CoverageData(str(coverage_file))
    data.read()
    seen: dict[str, dict[int, list[str]]] = {}
    for measured in data.measured_files():
        name = re.sub(r"^.*?/(?=(harness|reference)/)", "", measured)
        by_line = data.contexts_by_lineno(measured).items()
        seen[name] = {i: sorted({re.split(r"\||\[", c)[0] for c in tests}) for i, tests in by_line}
    lists = (tests for file in seen.values() for tests in file.values())
    extent = Counter(test for tests in lists for test in tests)
    generator, rooms = random.Random(seed), defaultdict[str, list[str]](list)
    for name in sorted(seen):
        rooms["/".join(name.split("/")[:2])].append(name)
    faults: list[dict[str, Any]] = []
    while len(faults) < count:
        for room in sorted(rooms):
            name = generator.choice(rooms[room])
            text = (ROOT / name).read_text(encoding="utf-8")
            drawn = {fault["line"] for fault in faults if fault["file"] == name}
            lines = seen[name].keys() - drawn
            executed = [c for c in changes(text) if c.line in lines and any(seen[name][c.line])]
            if executed:
                change = generator.choice(executed)
                tests = sorted(filter(None, seen[name][change.line]), key=extent.__getitem__)
                faults.append(_fault(name, text, change, tests))
    return faults[:count]


def _fault(name: str, text: str, change: CodeFault, tests: list[str]) -> dict[str, Any]:
    old = text.splitlines()[change.line - 1].encode()
    start, end = change.columns
    new = old[:start] + change.text.encode() + old[end:]
    return {
        "file": name, "line": change.line, "kind": change.kind, "old": old.decode(),
        "new": new.decode(), "tests": tests[:TESTS], "executing": len(tests),
        "caught": [], "files": list(dict.fromkeys(test.split("::")[0] for test in tests))[:4],
    }  # fmt: skip


def planted(text: str, fault: dict[str, Any]) -> str | None:
    """Return a module with a fault in the line nearest to where it was, or None without it."""
    lines = text.splitlines(keepends=True)
    places = [i for i, line in enumerate(lines, start=1) if line.rstrip("\n") == fault["old"]]
    for place in sorted(places, key=lambda i: abs(i - int(fault["line"]))):
        return "".join([*lines[: place - 1], fault["new"] + "\n", *lines[place:]])
    return None


def failing(tests: Sequence[str]) -> str | None:
    """Return the first of these tests, or files of tests, that fails, "timeout", or None."""
    present = list(filter(_is_there, tests))
    if not present:
        return None
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow and not release"]
    command += ["-p", "no:cacheprovider", *present]
    try:
        run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return "timeout"
    if run.returncode in (0, 4, 5):  # 4, 5: no such test
        return None
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", run.stdout, flags=re.MULTILINE)
    return failed[1] if failed else f"exit code {run.returncode}"


def _is_there(test: str) -> bool:
    """Return whether a test file, or a test in one, still exists."""
    path, function = ROOT / test.split("::")[0], test.split("::")[-1].split("[")[0]
    return path.is_file() and ("::" not in test or f"def {function}(" in path.read_text("utf-8"))


def caught(fault: dict[str, Any], edited: list[str]) -> str | None:
    """Return the test that fails with the fault in place, and passes without it."""
    path = ROOT / fault["file"]
    text = path.read_text(encoding="utf-8")
    if (changed := planted(text, fault)) is None:
        return "the line is gone"
    last = [test for test in fault["caught"][-1:] if test]
    attempts = [last, fault["tests"][:10], fault["tests"][10:], fault["files"], edited]
    for attempt in filter(None, attempts):
        path.write_text(changed, encoding="utf-8")
        try:
            test = failing(attempt)
        finally:
            path.write_text(text, encoding="utf-8")
        if test and not failing(attempt if test == "timeout" else [test]):
            return test
    return None


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mode", choices=("draw", "run"))
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--since", default="HEAD", help="commit at which the faults were drawn")
    options = parser.parse_args(arguments)
    store = options.paths[-1]
    if options.mode == "draw":
        store.write_text(json.dumps(draw(options.paths[0], options.count, SEED), indent=1))
        return
    changed, since = (
        subprocess.run(["git", "diff", "--name-only", commit], capture_output=True, text=True)
        for commit in ("HEAD", options.since)
    )
    if changed.stdout:
        sys.exit("this checkout has changes; plant faults in a copy without any")
    edited = [name for name in since.stdout.split() if re.match(r"tests/.*test_\w+\.py", name)]
    faults = json.loads(store.read_text(encoding="utf-8"))
    for number, fault in enumerate(faults, start=1):
        fault["caught"].append(test := caught(fault, edited))
        store.write_text(json.dumps(faults, indent=1), encoding="utf-8")
        print(f"{number:3} {fault['file']}:{fault['line']} {fault['kind']}: {test or 'not caught'}")


if __name__ == "__main__":
    main()
