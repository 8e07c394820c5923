"""Edits that turn A's file into B's: numbers, words, whole elements."""

import ast
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import accumulate, pairwise
from pathlib import Path

from physics_crosscheck.harness.documents.elements import (
    Number,
    XmlElement,
    attribute_spans,
    end_offset,
    read_elements,
    text_span,
)
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES, SourceFile, Span, apply_edits
from physics_crosscheck.harness.modelfiles.locations import MARKUP, find, read_source
from physics_crosscheck.harness.modelfiles.locations.xml import find_words
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.comparison import FileEdit
from .candidate import Candidate


@dataclass(frozen=True, kw_only=True)
class SourceEdit:
    """One difference between the files of A and B.

    Attributes:
        record: the difference, by an address of `harness.modelfiles.locations` if it has one.
        changes: replacements of bytes in A's model file, (first, after the last, new bytes).
        settings: new values of settings in A's sidecar, by key; None removes one.
    """

    record: FileEdit
    changes: tuple[tuple[int, int, bytes], ...] = ()
    settings: tuple[tuple[str, object], ...] = ()


_Change = tuple[int, int, bytes]


def _edit(
    what: str,
    where_a: SourceLine,
    where_b: SourceLine,
    a: str,
    b: str,
    changes: tuple[tuple[int, int, bytes], ...] = (),
    settings: tuple[tuple[str, object], ...] = (),
) -> SourceEdit:
    record = FileEdit(what=what, a=a, b=b, where_a=where_a, where_b=where_b)
    return SourceEdit(record=record, changes=changes, settings=settings)


def edits(a: Candidate, b: Candidate) -> tuple[SourceEdit, ...]:
    """Return all differences that an engine may read; () for unlike formats without bindings.

    Comments and white space are ignored.

    Raises:
        LocationError: for an unreadable file, with its line.
    """
    file_a, file_b = a.sidecar.model, b.sidecar.model
    if file_a.suffix != file_b.suffix:
        return tuple(_bound(a, b))
    differences: list[SourceEdit] = []
    if file_a.suffix in MARKUP:
        source_a, source_b = read_source(file_a), read_source(file_b)
        roots = read_elements(source_a)[0], read_elements(source_b)[0]
        differences += _Xml(source_a, source_b).edits(*roots)
    elif file_a.suffix == ".py":
        differences += _python(file_a, file_b)
    return (*differences, *_settings(a, b))


@dataclass(frozen=True)
class _Xml:
    """Two XML files, element by element."""

    a: SourceFile
    b: SourceFile

    def edits(self, a: XmlElement, b: XmlElement) -> Iterator[SourceEdit]:
        """Yield the differences of two elements and of their content."""
        spans, end = attribute_spans(a, self.a)
        others, _ = attribute_spans(b, self.b)
        label = _label(a)
        for name in dict.fromkeys([*a.attributes, *b.attributes]):
            what, old, new = f"{label}@{name}", a.attributes.get(name), b.attributes.get(name)
            here = self.a.line(spans[name][1][0] if name in spans else a.start)
            there = self.b.line(others[name][1][0] if name in others else b.start)
            if old is None or new is None:
                added = f" {self.b.text(others[name][0]).strip()}" if name in others else ""
                change = (*spans[name][0], b"") if name in spans else (end, end, added.encode())
                yield self._edit(what, here, there, old, new, change)
            elif old.split() != new.split():
                inner = spans[name][1], others[name][1]
                yield from self._values(what, (old, new), inner, (here, there))
        old, new = ("" if one.children else one.text for one in (a, b))
        if old.split() != new.split():
            texts = self._text(a, self.a), self._text(b, self.b)
            yield from self._values(
                label, (old, new), (texts[0][0], texts[1][0]), (texts[0][1], texts[1][1])
            )
        pairs, gone, added_elements = _aligned(a.children, b.children)
        for element, partner in pairs:
            yield from self.edits(element, partner)
        for element in gone:
            whole = element.start, end_offset(element, self.a)
            here, there = self.a.line(element.start), self.b.line(b.start)
            text = _short(self.a.text(whole))
            yield self._edit(_label(element), here, there, text, None, (*whole, b""))
        closed = end_offset(a, self.a) > self.a.data.index(b">", end) + 1
        for element in added_elements:
            text = self.b.text((element.start, end_offset(element, self.b)))
            here, there = self.a.line(a.start), self.b.line(element.start)
            inserted = (a.end, a.end, text.encode()) if closed else None
            yield self._edit(_label(element), here, there, None, _short(text), inserted)

    def _text(self, element: XmlElement, source: SourceFile) -> tuple[Span, int]:
        """Return the bytes of an element's text and their line; those of its tag without text."""
        if element.children or not element.text.strip():
            end = attribute_spans(element, source)[1]
            return (end, end), source.line(element.start)
        span = text_span(element, source)
        return span, source.line(span[0])

    def _values(
        self, label: str, texts: tuple[str, str], spans: tuple[Span, Span], lines: tuple[int, int]
    ) -> Iterator[SourceEdit]:
        """Compare word by word if both hold equally many numbers, else as a whole."""
        old, new = texts[0].split(), texts[1].split()
        edit = partial(self._edit, here=lines[0], there=lines[1])
        numbers = all(map(_is_number, [*old, *new]))
        if numbers and list(map(float, old)) == list(map(float, new)):
            return
        try:
            words = find_words(self.a, *spans[0], "a value")
        except LocationError:
            words = []
        if (
            not numbers
            or re.search(r"axis(@xyz|/xyz)?$", label)
            or len(old) != len(new)
            or len(words) != len(old)
        ):
            change = (*spans[0], self.b.data[slice(*spans[1])])
            yield edit(label, a=_short(texts[0]), b=_short(texts[1]), change=change)
            return
        for i, (x, y) in enumerate(zip(old, new, strict=True)):
            if float(x) != float(y):
                index = f"[{i}]" if len(old) > 1 else ""
                yield edit(label + index, a=x, b=y, change=(*words[i], y.encode()))

    def _edit(
        self, what: str, here: int, there: int, a: str | None, b: str | None, change: _Change | None
    ) -> SourceEdit:
        return _edit(
            what,
            SourceLine(file=str(self.a.file), line=here),
            SourceLine(file=str(self.b.file), line=there),
            "nothing" if a is None else a,
            "nothing" if b is None else b,
            () if change is None else (change,),
        )


def _label(element: XmlElement) -> str:
    steps, named = 1, element
    while (
        "name" not in named.attributes
        and named.parent is not None
        and named.parent.parent is not None
    ):
        steps, named = steps + 1, named.parent
    return element.spelled(steps)


_Key = tuple[str, str | None, int]


def _keyed(elements: Sequence[XmlElement]) -> dict[_Key, XmlElement]:
    """Return elements by tag, name, and index among those with both equal."""
    counts, keyed = Counter[tuple[str, str | None]](), dict[_Key, XmlElement]()
    for element in elements:
        like = element.tag, element.identity
        keyed[*like, counts[like]] = element
        counts[like] += 1
    return keyed


def _aligned(
    a: Sequence[XmlElement], b: Sequence[XmlElement]
) -> tuple[list[tuple[XmlElement, XmlElement]], list[XmlElement], list[XmlElement]]:
    """Pair children that correspond, also if only a name differs; return the unpaired ones too."""
    ours_by_key, remaining = _keyed(a), _keyed(b)
    pairs = [(one, remaining.pop(key)) for key, one in ours_by_key.items() if key in remaining]
    paired = {id(child) for child, _ in pairs}
    gone = [child for child in a if id(child) not in paired]
    new = list(remaining.values())
    for tag in dict.fromkeys(child.tag for child in gone):
        ours = [child for child in gone if child.tag == tag]
        theirs = [child for child in new if child.tag == tag]
        if len(ours) == len(theirs):
            pairs += zip(ours, theirs, strict=True)
            gone = [child for child in gone if child.tag != tag]
            new = [child for child in new if child.tag != tag]
    return pairs, gone, new


def _python(a: Path, b: Path) -> Iterator[SourceEdit]:
    """Yield differing numbers of two files whose code is otherwise the same."""
    tree_a, tree_b = _parsed(a), _parsed(b)
    names = {
        id(s.value): s.targets[0].id
        for s in tree_a.body
        if isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name)
    }
    numbers_a, numbers_b = _Numbers(), _Numbers()
    code_a, code_b = (
        [(ast.dump(numbers.visit(s)), s.lineno) for s in tree.body]
        for numbers, tree in ((numbers_a, tree_a), (numbers_b, tree_b))
    )
    data = a.read_bytes()
    if [text for text, _ in code_a] != [text for text, _ in code_b]:
        same = zip(code_a, code_b, strict=False)
        least = min(len(code_a), len(code_b))
        first = next((i for i, (x, y) in enumerate(same) if x[0] != y[0]), least)
        yield _edit(
            what="code",
            where_a=_code_line(a, code_a, first),
            where_b=_code_line(b, code_b, first),
            a="this",
            b="other code than numbers",
            changes=((0, len(data), b.read_bytes()),),
        )
        return
    starts = [0, *accumulate(map(len, data.splitlines(keepends=True)))]
    for number_a, number_b in zip(numbers_a.nodes, numbers_b.nodes, strict=True):
        if ast.literal_eval(number_a) != ast.literal_eval(number_b):
            first = starts[number_a.lineno - 1] + number_a.col_offset
            last = starts[(number_a.end_lineno or 1) - 1] + (number_a.end_col_offset or 0)
            old, new = ast.unparse(number_a), ast.unparse(number_b)
            yield _edit(
                what=names.get(id(number_a), "number"),
                where_a=SourceLine(file=str(a), line=number_a.lineno),
                where_b=SourceLine(file=str(b), line=number_b.lineno),
                a=old,
                b=new,
                changes=((first, last, new.encode()),),
            )


def _parsed(path: Path) -> ast.Module:
    try:
        return _without_docstrings(ast.parse(path.read_bytes(), filename=str(path)))
    except SyntaxError as error:
        sentence = f"no Python: {error.msg}"
        raise LocationError(sentence, file=path, line=error.lineno or 1) from None


def _code_line(file: Path, code: Sequence[tuple[str, int]], index: int) -> SourceLine:
    return SourceLine(file=str(file), line=code[min(index, len(code) - 1)][1] if code else 1)


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            value = body[0].value
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                value.value = ""
    return tree


class _Numbers(ast.NodeTransformer):
    """Replaces numbers by zeros, and keeps the originals with their signs."""

    def __init__(self) -> None:
        self.nodes: list[ast.expr] = []

    def visit(self, node: ast.AST) -> ast.AST:
        signed = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd)
        inner = node.operand if isinstance(node, ast.UnaryOp) and signed else node
        if isinstance(inner, ast.Constant) and type(inner.value) in (int, float):
            assert isinstance(node, ast.expr)
            self.nodes.append(node)
            return ast.Constant(0)
        return self.generic_visit(node)


def _settings(a: Candidate, b: Candidate) -> Iterator[SourceEdit]:
    if a.bare and b.bare and a.sidecar.model.suffix in USD_SUFFIXES:
        return  # stages state them
    stated_a, stated_b = _stated(a), _stated(b)
    for key in dict.fromkeys([*stated_a, *stated_b]):
        old, new = stated_a.get(key), stated_b.get(key)
        if old != new:
            yield _edit(
                what=f"sidecar:{key}",
                where_a=_toml_line(a, key),
                where_b=_toml_line(b, key),
                a="nothing" if old is None else str(old),
                b="nothing" if new is None else str(new),
                settings=((key, new),),
            )


def _stated(candidate: Candidate) -> dict[str, object]:
    spec = candidate.sidecar.spec(candidate.engine)
    stated = ((key, value) for key, value in spec.settings.items() if key not in candidate.given)
    values = {f"settings.{key}": value for key, value in stated}
    for i, spring in enumerate(spec.springs):
        values[f"spring[{i}]"] = spring
    return values


def _toml_line(candidate: Candidate, key: str) -> SourceLine:
    file = Path(f"{candidate.sidecar.model}.toml")
    specific = key.replace("settings.", f"settings.{candidate.engine}.", 1)
    for name in (specific, f"{specific}[0]", key, f"{key}[0]", f"{key}.stiffness"):
        try:
            return _line(find(file, [name])[name])
        except LocationError:
            continue
    return SourceLine(file=str(file))


def _line(location: Number) -> SourceLine:
    return SourceLine(file=str(location.file), line=location.line)


def _bound(a: Candidate, b: Candidate) -> Iterator[SourceEdit]:
    bound_a, bound_b = _by_expression(a.sidecar.bindings), _by_expression(b.sidecar.bindings)
    for expression in (one for one in bound_a if one in bound_b):
        try:
            ours = _find_bound(a, bound_a[expression])
            theirs = _find_bound(b, bound_b[expression])
        except LocationError:
            continue
        for address, place in ours.items():
            for named, there in theirs.items():
                if abs(place.value - there.value) > 1e-12 * abs(there.value):
                    change = (place.start, place.end, there.text.encode())
                    yield _edit(
                        what=f"{address} and {named}, both {expression}",
                        where_a=_line(place),
                        where_b=_line(there),
                        a=place.text,
                        b=there.text,
                        changes=(change,),
                    )


def _find_bound(candidate: Candidate, addresses: list[str]) -> dict[str, Number]:
    """Return locations in the model file; literals of the sidecar are compared as settings."""
    in_model = [address for address in addresses if not address.startswith("sidecar:")]
    return dict(find(candidate.sidecar.model, in_model))


def _by_expression(bindings: Mapping[str, str]) -> dict[str, list[str]]:
    addresses: dict[str, list[str]] = {}
    for address, expression in bindings.items():
        try:
            spelled = ast.unparse(ast.parse(expression.strip(), mode="eval"))
        except SyntaxError:
            continue
        addresses.setdefault(spelled, []).append(address)
    return addresses


def applied(data: bytes, differences: tuple[SourceEdit, ...]) -> bytes:
    """Return the bytes of A's model file with some edits.

    Raises:
        ValueError: for overlapping edits.
    """
    changes = sorted(change for edit in differences for change in edit.changes)
    for (_, end, _), (start, _, _) in pairwise(changes):
        if start < end:
            raise ValueError("these edits overlap")
    return apply_edits(data, changes)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
