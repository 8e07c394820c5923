"""A text search for physical numbers in model files, which bindings must cover."""

import ast
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from physics_crosscheck.harness.documents.elements import Number as FileNumber
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar

Number = tuple[str, str, str]
"""File, key, and the number as written."""

# Attributes of appearance, of the layout of the mechanism, or of the computation.
NO_PHYSICS = {
    "geom": "contype conaffinity size pos euler fromto rgba",
    "site": "size pos rgba",
    "spatial": "width rgba",
    "material": "rgba texrepeat",
    "texture": "rgb1 rgb2 width height",
    "headlight": "ambient diffuse",
    "global": "offwidth offheight",
    "light": "pos dir diffuse",
    "camera": "pos xyaxes",
    "replicate": "count offset",
    "color": "rgba",
    "box": "size",
    "cylinder": "radius length",
    "sphere": "radius",
    "body": "pos",
    "axis": "xyz",
    "limit": "lower upper effort velocity",
    "option": "timestep",
    "joint": "axis solref solimp",
    "?xml": "version",
    "sdf": "version",
}
LAYOUT = ("size", "radius", "length", "max_step_size")
"""Elements whose text describes layout or computation."""

# The index of the first physical argument of each call.
FIRST = {"Body": 0, "DampedSpring": 4, "DampedRotarySpring": 2}
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


def xml_numbers(text: str) -> Iterator[tuple[int, str, str]]:
    """Yield (offset, `tag attribute`, number) of possibly physical numbers, except zeros."""
    # Replace comments by blanks, which keeps all offsets.
    text = re.sub(r"<!--.*?-->", lambda m: re.sub(r"[^\n]", " ", m[0]), text, flags=re.DOTALL)
    inertials = [m.span() for m in re.finditer(r"<inertial>.*?</inertial>", text, re.DOTALL)]
    for tag in re.finditer(r"<(\??\w+)((?:\s+\w+\s*=\s*\"[^\"]*\")*)", text):
        for attribute in re.finditer(r"(\w+)\s*=\s*\"([^\"]*)\"", tag[2]):
            if attribute[1] in NO_PHYSICS.get(tag[1], "").split():
                continue
            if tag[1] == "origin" and not any(a < tag.start() < b for a, b in inertials):
                continue  # the place of a joint or of visual geometry
            first = tag.start(2) + attribute.start(2)
            for number in re.finditer(rf"(?<!\S){NUMBER}(?!\S)", attribute[2]):
                if float(number[0]):
                    yield first + number.start(), f"{tag[1]} {attribute[1]}", number[0]
    for element in re.finditer(rf"<(\w+)>\s*({NUMBER}(?:\s+{NUMBER})*)\s*</", text):
        is_layout = element[1] in ("pose", "xyz") and not any(
            a < element.start() < b for a, b in inertials
        )  # a place, or visual geometry
        for number in re.finditer(NUMBER, element[2]) if element[1] not in LAYOUT else ():
            if float(number[0]) and not is_layout and element[1] != "diffuse":
                yield element.start(2) + number.start(), element[1], number[0]


def python_numbers(text: str) -> Iterator[tuple[int, str, str]]:
    """Yield the same for `space.py`: names, and unnamed arguments of bodies and springs."""
    for line in re.finditer(rf"^([A-Z_0-9]+) = ({NUMBER})", text, re.MULTILINE):
        if float(line[2]):
            yield line.start(2), line[1], line[2]
    starts = [0, *(m.end() for m in re.finditer("\n", text))]
    for node in ast.walk(ast.parse(text)):
        for name, value in _given(node):
            for inner in ast.walk(value):
                match inner:
                    case ast.Constant(value=int() | float() as number) if number:
                        yield starts[inner.lineno - 1] + inner.col_offset, name, str(number)


def _given(node: ast.AST) -> list[tuple[str, ast.expr]]:
    """Return named values that a statement or call gives to bodies, springs or the space."""
    if isinstance(node, ast.Call):
        name = getattr(node.func, "attr", "")
        if name in FIRST:
            arguments = [(name, value) for value in node.args[FIRST[name] :]]
            return arguments + [(str(k.arg), k.value) for k in node.keywords]
    elif isinstance(node, ast.Assign):
        name = getattr(node.targets[0], "attr", "")
        if name in ("gravity", "damping", "mass", "moment"):
            return [(name, node.value)]
    return []


def sidecar_numbers(path: Path) -> Iterator[Number]:
    """Yield (address, key, number) of a sidecar's settings and springs, except zeros."""
    data = tomllib.loads(path.read_text())

    def walk(value: object, address: str) -> Iterator[tuple[str, str]]:
        if isinstance(value, dict):
            for key, inner in value.items():
                yield from walk(inner, f"{address}.{key}" if address else key)
        elif isinstance(value, list):
            for i, inner in enumerate(value):
                yield from walk(inner, f"{address}[{i}]")
        elif isinstance(value, (int, float)) and value:
            yield address, str(value)

    tables = {key: data[key] for key in ("settings", "spring") if key in data}
    for address, number in walk(tables, ""):
        key = re.sub(r"\[\d+\]", "", address)
        if key.split(".")[-1] not in ("step", "solref", "solimp"):
            yield f"sidecar:{address}", key, number


def unaccounted(
    sidecar: Sidecar, places: Mapping[str, FileNumber], excepted: Collection[Number]
) -> list[Number]:
    """Return the numbers that are neither bound nor excepted: (file, key, number)."""
    path = Path(f"{sidecar.model}.toml")
    starts = {p.start for p in places.values() if p.file == sidecar.model}
    text = sidecar.model.read_bytes().decode("latin-1")  # one character per byte
    numbers = python_numbers if sidecar.model.suffix == ".py" else xml_numbers
    remaining = [(sidecar.model.name, key, n) for at, key, n in numbers(text) if at not in starts]
    remaining += [(path.name, key, n) for at, key, n in sidecar_numbers(path) if at not in places]
    return [item for item in remaining if item not in excepted]
