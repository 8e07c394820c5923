"""The parsers, each with its contract, its seeds and its words."""

from __future__ import annotations

import ast
import json
import re
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import msgspec

from physics_crosscheck.harness.baseline.file import (
    BaselineFileError,
    SystemBaseline,
    file_text,
    read_file,
    sealed,
    snapshot_key,
)
from physics_crosscheck.harness.commands.compare.candidate import CompareError
from physics_crosscheck.harness.commands.compare.match import declared
from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.commands.scaffold.from_tree import tree_text
from physics_crosscheck.harness.documents.elements import read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import SourceFile
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.urdf import load_urdf
from physics_crosscheck.harness.modelfiles.bindings import bindings
from physics_crosscheck.harness.modelfiles.folders import builtin, template
from physics_crosscheck.harness.modelfiles.locations import find_in
from physics_crosscheck.harness.modelfiles.locations.attributes import Attribute, with_attributes
from physics_crosscheck.harness.modelfiles.locations.python import python_numbers, python_offset
from physics_crosscheck.harness.modelfiles.locations.toml import toml_offset
from physics_crosscheck.harness.modelfiles.locations.xml import xml_numbers, xml_offset
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError, read_sidecar
from physics_crosscheck.harness.records.baseline import BaselineFile
from physics_crosscheck.harness.records.read import ResultsError, read_results
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.reference.dynamics.notation import readings
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.declaration import DeclarationError, PublishedEquation
from physics_crosscheck.reference.mechanism.system import System
from soak.fuzz.target import ContractError, FuzzTarget
from tests.baseline.samples import baseline
from tests.records.examples import example

_SPLIT = b"\n---\n"
"""Separator of an address and the file that contains it."""

_NUMBERS = ("0", "-0", "1e999", "-1e999", "nan", "inf", "1_000", "0x10", "1e-400", "9" * 400,
            "+.5", "5.", "1e", "\u0661", "\u00b2")  # fmt: skip
_XML = ("<", ">", "/>", "<!--", "-->", "<![CDATA[", "]]>", "&#49;", "&lt;", "<!DOCTYPE x [", "<?",
        "?>", "xmlns:a=", "encoding=", "\ufeff", "<frame>", "<include file=", "<robot>",
        "<link name=", "<joint name=", "<gazebo reference=", "<mimic joint=", "<springStiffness>",
        "<body name=", "<inertial", "<option", "mass=", "pos=", "xyz=", "rpy=", "type=", "euler=",
        "axis=", "limit", "lower=", "upper=", '"""', "'''", "{", "\\", "\\n")  # fmt: skip
_TOML = ("[", "]", "[[", "]]", "{", "}", "=", ".", ",", "#", '"""', "'''", "\\u0041", "inf",
         "nan", "true", "1979-05-27", "0o7", "settings", "spring", "bindings", "coordinates",
         "readback", "engines", "step", "gravity", "sidecar:", "\r\n")  # fmt: skip
_MATHS = ("**", "^", "/0", "log(", "asin(", "sqrt(-1)", "atan2(", "pi", "(", ")", ",", "lambda",
          " if ", " else ", "[", "]", ".x", "1j", "__class__", "1e999", "0.1", "9**9**9", "'", "\0",
          "not ", "@", "f''", "±", "=", "d/dt(", "theta0")  # fmt: skip


def _read_files(*patterns: str) -> Iterator[bytes]:
    for folder in (*sorted(builtin().iterdir()), template()):
        for pattern in patterns:
            for path in sorted(folder.glob(pattern)):
                yield path.read_bytes()


@cache
def _temporary_folder() -> Path:
    """Return the folder for parsers that read files. It is removed at the end of the process."""
    folder = tempfile.TemporaryDirectory(prefix="soak-fuzz-")
    _FOLDERS.append(folder)
    return Path(folder.name)


_FOLDERS: list[tempfile.TemporaryDirectory[str]] = []


@cache
def _load_pendulum() -> System:
    return load_system(builtin() / "simple_pendulum")


def _write_input(name: str, data: bytes = b"") -> Path:
    path = _temporary_folder() / name
    path.write_bytes(data)
    return path


def _parse_sidecar(data: bytes) -> object:
    _write_input("model.xml")
    return read_sidecar(_write_input("model.xml.toml", data))


def _parse_expression(data: bytes) -> object:
    """Parse and evaluate a binding's expression as `run` does."""
    model = _write_input("model.py", b"MASS = 1.5\n")
    text = data.decode("utf-8", errors="replace")
    sidecar = Sidecar(
        model=model,
        engines=("pymunk",),
        settings={},
        engine_settings={},
        coordinates={},
        readback={},
        springs=(),
        bindings={"MASS": text},
    )
    return bindings(_load_pendulum(), sidecar)


def _expression_seeds() -> Iterator[bytes]:
    yield from (b"-m", b"m * l**2", b"180 / pi * atan2(l, g)", b"sqrt(m) + 1.5e-3", b"-(m + 2) / 3")


def _find_number(suffix: str, data: bytes) -> object:
    address, _, text = data.partition(_SPLIT)
    file, name = Path(f"model{suffix}"), address.decode("utf-8", errors="replace")
    locations = find_in(text, file, [name])
    location = locations[name]
    # The text at the reported location must be the reported number.
    if float(text[location.start : location.end]) != location.value:
        raise ContractError(f"{name!r} is reported as {location.value!r}")
    return locations


def _parse_xml(data: bytes) -> object:
    address, _, text = data.partition(_SPLIT)
    source, name = SourceFile(Path("model.xml"), text), address.decode("utf-8", errors="replace")
    elements = read_elements(source)
    text.decode("utf-8")
    xml_offset(source, name)
    list(xml_numbers(source, re.compile(r".*")))
    for element in elements[:2]:
        with_attributes(text, source.file, [Attribute(element.start, "name", "a")])
    return _find_number(".xml", data)


def _parse_toml(data: bytes) -> object:
    address, _, text = data.partition(_SPLIT)
    text.decode("utf-8")
    toml_offset(SourceFile(Path("m.toml"), text), address.decode("utf-8", errors="replace"))
    return _find_number(".toml", data)


def _parse_python(data: bytes) -> object:
    address, _, text = data.partition(_SPLIT)
    source = SourceFile(Path("model.py"), text)
    text.decode("utf-8")
    python_offset(source, address.decode("utf-8", errors="replace"))
    list(python_numbers(source, re.compile(r".*")))
    return _find_number(".py", data)


def _addressed_files(address: str, *patterns: str) -> Iterator[bytes]:
    for text in _read_files(*patterns):
        yield address.encode() + _SPLIT + text


def _parse_urdf(data: bytes) -> object:
    path = _write_input("model.urdf", data)
    file = load_urdf(path)
    return file.springs, file.mimics


def _write_system(data: bytes, suffix: str) -> object:
    """Return the system.py that `new --from` would write. The file's text must not become code."""
    path = _write_input(f"model{suffix}", data)
    robot = read_robot(path)
    if robot.body_model is None:
        return None
    text = tree_text("new", "new", path.name, robot.body_model, {}, "")
    _check_calls(ast.parse(text))
    return text


def _check_calls(tree: ast.Module) -> None:
    """Reject a call of a name that the text neither imports nor defines, such as `open`."""
    nodes = list(ast.walk(tree))
    defined = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    for node in nodes:
        if isinstance(node, ast.ImportFrom | ast.Import):
            defined |= {alias.asname or alias.name for alias in node.names}
    for node in nodes:
        match node:
            case ast.Call(func=ast.Name(id=name)) if name not in defined:
                raise ContractError(f"the written system.py calls {name!r}")


def _parse_results(data: bytes) -> object:
    return read_results(_write_input("results.json", data))


def _results_seeds() -> Iterator[bytes]:
    yield json.dumps(example(Results)).encode()
    yield b'{"schema": 2}'


def _parse_baseline(data: bytes) -> object:
    """Parse a baseline file. If it is rejected, parse it again with valid seals."""
    try:
        return read_file(data, "spring")
    except BaselineFileError:
        file = _unsealed(data)
        if file is None:
            raise
    snapshots = {snapshot_key(one): one for one in file.snapshots.values()}
    renamed = {old: snapshot_key(one) for old, one in file.snapshots.items()}
    cases = {
        one.id: sealed(msgspec.structs.replace(one, snapshot=renamed.get(one.snapshot, "")))
        for one in file.cases
    }
    if any(one.snapshot not in snapshots for one in cases.values()):
        raise BaselineFileError("its snapshot is not there")
    whole = SystemBaseline(declared=sealed(file.declared), snapshots=snapshots, cases=cases)
    return read_file(file_text(whole).encode(), "spring")


def _unsealed(data: bytes) -> BaselineFile | None:
    try:
        return msgspec.json.decode(data, type=BaselineFile)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return None


def _baseline_seeds() -> Iterator[bytes]:
    yield file_text(baseline()).encode()


def _parse_notation(data: bytes) -> object:
    text = data.decode("utf-8", errors="replace")
    equation = PublishedEquation("1", text, "linear part", of="theta", driven=False, note="")
    return readings(equation, _load_pendulum(), _load_pendulum().coordinates[0])


def _notation_seeds() -> Iterator[bytes]:
    for equation in _load_pendulum().published:
        yield equation.text.encode()


def _parse_joints(data: bytes) -> object:
    joints, _, table = data.partition(_SPLIT)
    path = _write_input("map.toml", table) if table else None
    return declared(joints.decode("utf-8", errors="replace"), path)


def _joints_seeds() -> Iterator[bytes]:
    yield b"hip=j1,knee=-j2"
    yield _SPLIT + b'[joints]\nhip = "j1 - j2"\n'


TARGETS = {
    target.name: target
    for target in (
        FuzzTarget(
            name="sidecar", parse=_parse_sidecar, errors=(SidecarError,),
            seeds=lambda: _read_files("*.toml"), words=(*_TOML, *_NUMBERS),
        ),
        FuzzTarget(
            name="expression", parse=_parse_expression, errors=(SidecarError,),
            seeds=_expression_seeds, words=(*_MATHS, *_NUMBERS, "m", "l", "g"), share=1.5,
        ),
        FuzzTarget(
            name="xml", parse=_parse_xml, errors=(LocationError, UnicodeDecodeError),
            seeds=lambda: _addressed_files("body[pendulum]/inertial@pos[2]", "*.xml", "*.urdf"),
            words=(*_XML, *_NUMBERS), share=1.5,
        ),
        FuzzTarget(
            name="toml", parse=_parse_toml, errors=(LocationError, UnicodeDecodeError),
            seeds=lambda: _addressed_files("settings.gravity[2]", "*.toml"),
            words=(*_TOML, *_NUMBERS), share=1.5,
        ),
        FuzzTarget(
            name="python", parse=_parse_python, errors=(LocationError, UnicodeDecodeError),
            seeds=lambda: _addressed_files("MASS", "*.py"),
            words=(*_MATHS, *_NUMBERS, "def ", "class ", "global ", "# coding: latin-1", "\f"),
        ),
        FuzzTarget(
            name="urdf", parse=_parse_urdf, errors=(EngineError,),
            seeds=lambda: _read_files("*.urdf"), words=(*_XML, *_NUMBERS),
        ),
        FuzzTarget(
            name="new_urdf", parse=lambda data: _write_system(data, ".urdf"), errors=(NewError,),
            seeds=lambda: _read_files("*.urdf"), words=(*_XML, *_NUMBERS), share=1.5,
        ),
        FuzzTarget(
            name="new_mjcf", parse=lambda data: _write_system(data, ".xml"), errors=(NewError,),
            seeds=lambda: _read_files("*.xml"), words=(*_XML, *_NUMBERS), share=1.5,
        ),
        FuzzTarget(
            name="results", parse=_parse_results, errors=(ResultsError,),
            seeds=_results_seeds, words=('"', ":", "null", "[", "{", "NaN", *_NUMBERS), share=0.5,
        ),
        FuzzTarget(
            name="baseline", parse=_parse_baseline, errors=(BaselineFileError,),
            seeds=_baseline_seeds, words=('"', ":", "null", "[", "{", "NaN", *_NUMBERS), share=0.5,
        ),
        FuzzTarget(
            name="notation", parse=_parse_notation, errors=(DeclarationError,), bounded=False,
            seeds=_notation_seeds, words=(*_MATHS, "f(", "'", "''", ", ", "theta", "m", "l"),
        ),
        FuzzTarget(
            name="joints", parse=_parse_joints, errors=(CompareError,),
            seeds=_joints_seeds, words=("=", ",", "[joints]", *_TOML), share=0.5,
        ),
    )
}  # fmt: skip
"""Every parser under attack, by its name."""
