"""Numbers in Python, by their names at the top level."""

import ast
import re
import tokenize
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO

from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import Resolve, SourceFile, Span, nearest


def python_names(source: SourceFile) -> Resolve:
    """Return a resolver of numbers that are bound to a name once, at the top level."""
    tree, starts = parsed(source)
    simple: dict[str, ast.expr] = {}
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                simple[name] = value
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                simple[name] = value
    bound = _bound_names(tree)

    def offset(line: int, column: int) -> int:
        return starts[line - 1] + column

    def resolve(address: str) -> tuple[Span, float]:
        if not address.isidentifier():
            raise source.error(address, "is not an address; in Python use a name, such as 'MASS'")
        lines = bound.get(address, [])
        if not lines:
            near = nearest(address, simple) or "none"
            raise source.error(address, f"is not a name at the top level; nearest: {near}")
        where = offset(lines[0], 0)
        if len(lines) > 1:
            raise source.error(
                address,
                f"is bound several times (lines {', '.join(map(str, lines))}); bind "
                "a number that stands for a constant only once",
                where,
            )
        value = simple.get(address)
        number = None if value is None else _literal(value)
        if value is None or number is None:
            raise source.error(
                address,
                f"is not a plain number; write '{address} = 1.5' at the top level, "
                "and use it below",
                where,
            )
        assert value.end_lineno is not None
        assert value.end_col_offset is not None
        start = offset(value.lineno, value.col_offset)
        return (start, offset(value.end_lineno, value.end_col_offset)), number

    return resolve


_CALL = re.compile(r"(\w+)\(\)(?:\.(\w+))?")


def python_offset(source: SourceFile, address: str) -> int | None:
    """Return the first byte of the first statement or call of an address.

    Args:
        address: a name of the top level, `MASS`; a call, `PinJoint()`; or an attribute that is
            assigned on the result of a call, `Space().damping`.
    """
    tree, starts = parsed(source)
    match = _CALL.fullmatch(address)
    if match is None:
        lines = _bound_names(tree).get(address)
        return starts[lines[0] - 1] if lines else None
    nodes = _calls(tree, match[1]) if match[2] is None else _assigned(tree, match[1], match[2])
    return min((starts[node.lineno - 1] + node.col_offset for node in nodes), default=None)


def _called(node: ast.expr | None) -> str | None:
    """Return the last name of a called expression: `PinJoint` in `module.PinJoint(...)`."""
    match node:
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name
    return None


def _calls(tree: ast.Module, kind: str) -> list[ast.expr]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call) and _called(node) == kind]


def _assigned(tree: ast.Module, kind: str, attribute: str) -> list[ast.expr]:
    """Return attributes of names bound to such a call, or else of names bound to no call."""
    calls: dict[str, set[str | None]] = {}
    targets: list[ast.Attribute] = []
    for node in ast.walk(tree):
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call() as call):
                calls.setdefault(name, set()).add(_called(call))
            case ast.Attribute(attr=name, ctx=ast.Store()) if name == attribute:
                targets.append(node)
    called = {id(t): calls.get(t.value.id) for t in targets if isinstance(t.value, ast.Name)}
    matching: list[ast.expr] = [t for t in targets if kind in (called.get(id(t)) or ())]
    return matching or [t for t in targets if called.get(id(t)) is None]


def python_numbers(source: SourceFile, _kinds: re.Pattern[str]) -> Iterator[str]:
    """Yield names of numbers at the top level, of any kind, since a name does not define one."""
    resolve = python_names(source)
    for statement in ast.parse(source.data).body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
                with suppress(LocationError):
                    resolve(name)
                    yield name


def parsed(source: SourceFile) -> tuple[ast.Module, list[int]]:
    """Return the module, and the first byte of each line."""
    try:
        encoding, _ = tokenize.detect_encoding(BytesIO(source.data).readline)
        if encoding not in ("utf-8", "utf-8-sig"):
            raise LocationError(
                f"its encoding is {encoding}; save the file as UTF-8", file=source.file, line=1
            )
        tree = ast.parse(source.data, filename=str(source.file))
    except SyntaxError as error:
        raise LocationError(
            f"not Python: {error.msg}", file=source.file, line=error.lineno or 1
        ) from None
    mark = 3 if source.data.startswith(b"\xef\xbb\xbf") else 0
    starts = [mark]
    for line in source.data[mark:].splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    return tree, starts


def _literal(node: ast.expr) -> float | None:
    match node:
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=ast.Constant() as inner):
            number = _literal(inner)
            return -number if number is not None and isinstance(sign, ast.USub) else number
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)
    return None


def _bound_names(tree: ast.Module) -> dict[str, list[int]]:
    """Return the lines where each name of the module's scope is bound, in any way."""
    bound: dict[str, list[int]] = {}
    waiting: list[tuple[ast.AST, frozenset[str] | None]] = [(node, None) for node in tree.body]
    while waiting:
        # In a function or class only names that it declares global belong to the module.
        node, within = waiting.pop(0)
        names: list[str] = []
        match node:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()):
                names = [name]
            case (
                ast.FunctionDef(name=name)
                | ast.AsyncFunctionDef(name=name)
                | ast.ClassDef(name=name)
            ):
                names = [name]
            case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
                names = [(alias.asname or alias.name).split(".")[0] for alias in aliases]
        for name in names:
            if within is None or name in within:
                bound.setdefault(name, []).append(getattr(node, "lineno", 1))
        inner = within
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)):
            inner = frozenset(
                n for g in ast.walk(node) if isinstance(g, ast.Global) for n in g.names
            )
        waiting += [(child, inner) for child in ast.iter_child_nodes(node)]
    return {name: sorted(lines) for name, lines in bound.items()}
