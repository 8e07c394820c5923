"""URDFs that xacro expands from sources, and the line of the source of each of their elements."""

import hashlib
import os
import re
import shlex
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote, urlsplit
from xml.dom import expatbuilder
from xml.dom.minidom import Node

import msgspec

from .document import Document
from .elements import XmlElement
from .errors import LocationError
from .reading import read_regular

XACRO = ".xacro"

_MARK = "crosscheck-source"
"""Key of an element's file and line, through macros."""

_LINES: dict[str, dict[int, tuple[str, int]]] = {}
"""Source file and line by the line of an expanded file, by its path."""

_SOURCES: dict[str, str] = {}
"""Source, as the user named it, by the path of its expanded file."""

ARGUMENTS = "CROSSCHECK_XACRO_ARGS"
"""The environment variable with arguments of sources, such as `gripper:=true`."""

_PREFIX_PATHS = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")
"""Environment variables with folders whose `share` contains packages."""

LEVELS = 4
"""Number of folders, from that of a package upwards, in which other packages are looked for."""

MAX_SOURCES = 500
"""Number of files or folders of one search."""

RENAMED = {".mjcf": ".xml", ".world": ".sdf"}
"""Suffixes by those that engines know."""

STAND_INS = "stand-ins"
"""Folder in the user's cache of copies with inertias that their files lack."""

_WEIGHT = re.compile(rb"<(mass|inertia)\b[^>]*=\s*[\"'][^\"']*[^-+.0\s\"']")
"""A mass or a tensor that is not written as zero."""

SEARCH_SECONDS = 10.0
"""Time after which a package is looked for again."""

T = TypeVar("T")


class ExpansionError(ValueError):
    """A source that can't be expanded; the message names the file, the reason and a remedy."""


def expand(source: Path) -> Path:
    """Expand a source for xacro into a URDF in the user's cache, and note the lines.

    `$(find package)` means the packages of `package_folders`. Meshes that exist are named by their
    whole paths, since the copy is elsewhere. Arguments come from `ARGUMENTS`.

    Raises:
        ExpansionError: naming the file, the reason and a remedy.
        ImportError: without xacro.
    """
    import xacro
    from xacro import substitution_args

    whole = source.absolute()
    words = shlex.split(os.environ.get(ARGUMENTS, ""))
    absent: list[str] = []  # xacro wraps an error within an expression

    def find(package: str) -> str:
        folder = next((one for one in package_folders(package, whole) if one.is_dir()), None)
        if folder is None:
            absent.append(
                f"needs the ROS package {package}, neither beside its own package"
                " nor in AMENT_PREFIX_PATH or ROS_PACKAGE_PATH. Put its folder beside"
                f" {package_root(whole)}, or source the setup file of its workspace"
            )
            raise ExpansionError(absent[0])
        return str(folder)

    try:
        with (
            _marked_parser(xacro),
            replaced(substitution_args, "_eval_find", find),
            replaced(
                substitution_args, "_eval_dict", {**substitution_args._eval_dict, "find": find}
            ),
        ):
            given = dict(word.split(":=", 1) for word in words)
            tree = xacro.process_file(str(whole), mappings=given)
    except Exception as error:  # macros evaluate any Python expression
        reason = absent[0] if absent else f"xacro: {_reason(error)}"
        raise ExpansionError(f"{_place(error, source)}: {reason}") from None
    if not tree.getElementsByTagName("link") and b"xacro:macro" in whole.read_bytes():
        raise ExpansionError(f"{source}: it defines macros, not a robot. {_users(whole)}")
    for mesh in tree.getElementsByTagName("mesh"):
        file = locate_file(whole, mesh.getAttribute("filename"))
        if file is not None:
            mesh.setAttribute("filename", str(file.resolve()))
    marks = [element.getUserData(_MARK) for element in tree.getElementsByTagName("*")]
    target = cached_copy(whole, words, expanded_name(source))
    write_copy(source, target, tree.toprettyxml(indent="  ").encode(), marks)
    return target


def write_copy(
    source: Path, target: Path, data: bytes, marks: Sequence[tuple[str, int] | None]
) -> None:
    """Write a copy of a source, and note the source's file and line of each of its elements."""
    _write(target, data)
    document = Document(target)
    lines = {document.line(one): mark for one, mark in zip(document.elements, marks, strict=True)}
    _LINES[str(target)] = {
        line: in_source(*mark) or mark for line, mark in lines.items() if mark is not None
    }
    _SOURCES[str(target)] = str(source_of(source))


def completed(file: Path) -> Path | None:
    """Return a copy of a URDF with a link `world` that only its joints name, and stand-ins.

    If no link has mass or inertia, also if they are written as 0, 1 kg and 1 kg m^2 stand for each.
    Lines stay. Return None if the file lacks neither or has a sidecar, or isn't XML.
    """
    is_urdf = file.suffix == ".urdf" and file.is_file() and not Path(f"{file}.toml").exists()
    data = without_comments(read_regular(file)) if is_urdf else b""
    lacks_inertia = b"<inertial" not in data or not _WEIGHT.search(data)
    if b"<link" not in data or not (lacks_inertia or re.search(rb"""["']world["']""", data)):
        return None
    if (robot := _root_copy(file)) is None:
        return None
    parents = {one.get("link") for one in robot.findall("joint/parent")}
    lacks_world = "world" in parents - {one.get("name") for one in robot.findall("link")}
    if not (lacks_world or lacks_inertia):
        return None
    if lacks_world:
        robot.add("link", {"name": "world"})
    for link in robot.findall("link") if lacks_inertia else ():
        if link.get("name") != "world":
            inertial = link.find("inertial") or link.add("inertial")
            (inertial.find("mass") or inertial.add("mass")).set("value", "1")
            tensor = inertial.find("inertia") or inertial.add("inertia")
            for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
                tensor.set(key, "1" if key[1] == key[2] else "0")
    for mesh in robot.iter("mesh"):
        if (shape := locate_file(file, mesh.get("filename", ""))) is not None:
            mesh.set("filename", str(shape.resolve()))
    return _copied(file, robot, STAND_INS if lacks_inertia else "completed", file.name)


def renamed(file: Path) -> Path | None:
    """Return a copy with the suffix that engines know, of a file with one of `RENAMED`, or None.

    Lines stay. Names of files are those of the file's folder.
    """
    suffix = RENAMED.get(file.suffix)
    if suffix is None or not file.is_file() or (root := _root_copy(file)) is None:
        return None
    folder = file.absolute().parent
    if suffix == ".xml":
        compiler = next(root.iter("compiler"), None) or root.add("compiler")
        for key in ("meshdir", "texturedir"):
            inner = compiler.get(key) or compiler.get("assetdir", "")
            compiler.set(key, str(folder / inner))
        for part in (*root.iter("include"), *root.findall("asset/model")):
            part.set("file", str(folder / part.get("file", "")))
    for uri in list(root.iter("uri")):
        place = next((one for one in _places(file, uri.text.strip()) if one.exists()), None)
        if place is not None and uri.parent is not None:
            uri.parent.remove(uri)
            uri.parent.add("uri", text=str(place.resolve()))
    return _copied(file, root, "renamed", f"{file.stem}{suffix}")


def without_comments(data: bytes) -> bytes:
    """Return XML without its comments."""
    return re.sub(rb"(?s)<!--.*?-->", b"", data)


def _root_copy(file: Path) -> XmlElement | None:
    with suppress(LocationError):  # reading the file reports the error
        return Document(file).root.copy()
    return None


def _copied(file: Path, root: XmlElement, kind: str, name: str) -> Path:
    """Write a changed copy with the lines of a file into the user's cache."""
    data, target = root.written(), cached_copy(file.absolute(), [], name, kind)
    _write(target, data)
    source = str(source_of(file))
    lines = {line: (source, line) for line in range(1, data.count(b"\n") + 2)}
    _LINES[str(target)] = _LINES.get(str(file), lines)
    _SOURCES[str(target)] = source
    return target


def has_stand_ins(file: Path) -> bool:
    """Return whether a file is such a copy."""
    return file.parent.parent.name == STAND_INS


def _write(target: Path, data: bytes) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    temporary.write_bytes(data)
    os.replace(temporary, target)  # another process may read it


def _place(error: BaseException, source: Path) -> str:
    """Return the source, and file and line of the innermost element that xacro evaluated."""
    nodes = (frame.f_locals.get("node") for frame, _ in traceback.walk_tb(error.__traceback__))
    marks = [node.getUserData(_MARK) for node in nodes if isinstance(node, Node)]
    for file, line in filter(None, reversed(marks)):
        return f"{source}:{line}" if file == str(source.absolute()) else f"{source}: {file}:{line}"
    return str(source)


def _reason(error: BaseException) -> str:
    """Return the innermost cause of an error of xacro, in one line with a remedy."""
    text = " ".join(str(error).split()).split(" [Errno ")[0] or type(error).__name__
    if missing := re.search(r"Undefined substitution argument (\S+)", text):
        name = missing[1].strip("'\"")
        return f"the argument {name} has no default. Add {name}:=VALUE to the command"
    return f"{text}; correct the source"


def _users(source: Path) -> str:
    """Return a remedy that names the robots of the package that include a source of macros."""
    others = sorted(package_root(source).rglob(f"*{XACRO}"))[:MAX_SOURCES]
    texts = {one: one.read_text(encoding="utf-8", errors="replace") for one in others}

    def includes(file: Path) -> list[Path]:
        name = re.compile(rf"""["'/]{re.escape(file.name)}["']""")
        return [one for one, text in texts.items() if one != file and name.search(text)]

    seen, new = {source}, {source}
    while new := {user for file in new for user in includes(file)} - seen:
        seen |= new
    robots = sorted(str(one) for one in seen - {source} if not includes(one))
    return f"Name a robot that uses it: {', '.join(robots[:4])}" if robots else "Name a robot"


def package_root(source: Path) -> Path:
    """Return the folder of the package that holds a file; without a `package.xml`, its parent."""
    above = [one for one in source.absolute().parents if (one / "package.xml").is_file()]
    return above[0] if above else source.absolute().parent


def package_folders(package: str, file: Path) -> Iterator[Path]:
    """Yield the possible folders of a ROS package that a file names.

    First the folders above the file and those beside its package, then the environment, as ROS 2
    and ROS 1 look it up.
    """
    root = package_root(file)
    above = [root, *root.parents][:LEVELS]
    for folder in file.absolute().parents:
        if folder.name == package or _package_name(folder) == package:
            yield folder
    for folder in above:
        yield folder / package
    for folder in above[1:]:
        neighbors = sorted(folder.glob("*"))[:MAX_SOURCES] if folder != Path(folder.root) else []
        yield from (p for one in neighbors if os.path.isfile((p := one / package) / "package.xml"))
        yield from (one for one in neighbors if _package_name(one) == package)
    for variable in _PREFIX_PATHS:
        for name in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield Path(name, "share", package)
    for name in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield from (Path(name, package), *([Path(name)] * (Path(name).name == package)))


@lru_cache(maxsize=64)
def _existing_folders(package: str, model: Path, _period: int) -> tuple[Path, ...]:
    """Return the folders of a package; many meshes of a file ask for the same one."""
    return tuple(filter(Path.is_dir, package_folders(package, model)))


def _package_name(folder: Path) -> str:
    with suppress(OSError):
        name = re.search(rb"<name>\s*(.*?)\s*</name>", (folder / "package.xml").read_bytes())
        return name[1].decode(errors="replace") if name else ""
    return ""


def locate_file(model: Path, name: str) -> Path | None:
    """Return the file that a model file means by a name, or None if it does not exist.

    A name with a scheme, such as `package://robot/meshes/arm.stl`, means a file of a package.
    """
    return next((path for path in _places(model, name) if path.is_file()), None)


def is_irregular(model: Path, name: str) -> bool:
    """Return whether a name that `locate_file` rejects means a pipe, a device or a folder."""
    return any(path.exists() for path in _places(model, name))


def _places(model: Path, name: str) -> Iterator[Path]:
    scheme, _, rest = name.partition("://")
    if not rest:
        yield model.parent / name
        return
    if scheme == "file":
        yield Path(unquote(urlsplit(name).path))
        return
    # Engines read `package:///arm` as `package://arm`; exporters without a package name a file so.
    package, _, inner = rest.lstrip("/").partition("/")
    if not inner:
        yield model.parent / package
        return
    for folder in _existing_folders(package, model, int(time.monotonic() / SEARCH_SECONDS)):
        yield folder / inner
    for above in list(model.absolute().parents)[:6]:  # a copy of the package under another name
        yield above / inner


def expanded_name(source: Path) -> str:
    """Return the name of the URDF of a source: `arm.urdf` of `arm.urdf.xacro` or `arm.xacro`."""
    return f"{source.name.removesuffix(XACRO).removesuffix('.urdf')}.urdf"


def cached_copy(source: Path, words: Sequence[str], name: str, kind: str = "xacro") -> Path:
    """Return the path of a source's copy in the cache, by words that it depends on."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = hashlib.sha256("\0".join([str(source), *words]).encode()).hexdigest()[:12]
    return cache / "physics-crosscheck" / kind / folder / name


@contextmanager
def _marked_parser(xacro: Any) -> Iterator[None]:
    """Make xacro parse files such that each element states its file and line."""

    def parse(text: Any, filename: str | None = None) -> Any:
        if text is not None or filename is None:
            return original(text, filename)
        builder = _MarkingBuilder(filename)
        try:
            with open(filename, "rb") as file:
                return builder.parseFile(file)
        except OSError:
            return original(text, filename)  # raises the error that xacro expects

    original = xacro.parse
    with replaced(xacro, "parse", parse):
        yield


@contextmanager
def replaced(module: Any, name: str, value: object) -> Iterator[None]:
    """Replace an attribute of a library that has no parameter for it; not for several threads."""
    original = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, original)


class _MarkingBuilder(expatbuilder.ExpatBuilderNS):
    """A parser that gives each element its file and line; copies of an element keep them."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self._file = file

    def start_element_handler(self, name: str, attributes: Any) -> None:
        super().start_element_handler(name, attributes)
        mark = self._file, self.getParser().CurrentLineNumber
        self.curNode.setUserData(_MARK, mark, self)

    def handle(self, _operation: int, key: str, mark: object, _node: object, copy: Any) -> None:
        """Give a copied element its mark, as minidom's handlers of user data do."""
        if copy is not None:
            copy.setUserData(key, mark, self)


def source_of(file: Path) -> Path:
    """Return the source of an expanded file, or the file itself."""
    return Path(_SOURCES.get(str(file), file))


def in_source(file: str, line: int | None) -> tuple[str, int] | None:
    """Return file and line of the source of a line of an expanded file, or None."""
    lines = _LINES.get(file)
    if lines is None or line is None:
        return None
    before = [one for one in lines if one <= line]
    return lines[max(before)] if before else None


def relocated(value: T, line_type: type[msgspec.Struct]) -> T:
    """Return a record whose lines of expanded files are those of their sources.

    Args:
        value: a record, or a tuple of records.
        line_type: type of the lines, with the fields `file`, `line`, `span` and `text`.
    """

    def moved(part: Any) -> Any:
        if isinstance(part, line_type):
            place = in_source(part.file, part.line)  # type: ignore[attr-defined]
            return part if place is None else line_type(file=place[0], line=place[1])
        return part

    return _mapped(value, moved) if _LINES else value


def with_sources(value: T) -> T:
    """Return a record that names sources in place of expanded files, also in its texts."""

    def renamed(part: Any) -> Any:
        if type(part) is str:
            for target, source in _SOURCES.items():
                if target in part:
                    pattern = re.escape(target) + r"(?::(\d+))?"
                    part = re.sub(pattern, partial(_source_place, target, source), part)
        elif isinstance(part, msgspec.Struct):
            folder = getattr(part, "folder", "")
            if folder in _SOURCES and hasattr(part, "model"):
                part = _mapped(part, partial(_with_source_lines, folder))
                return msgspec.structs.replace(part, model=Path(_SOURCES[folder]).name)
        return part

    return _mapped(value, renamed) if _SOURCES else value


def _with_source_lines(target: str, part: Any) -> Any:
    """Return a text with file and line of the source in place of `line 12` of an expanded file."""

    def place(match: re.Match[str]) -> str:
        mark = in_source(target, int(match[1]))
        return match[0] if mark is None else f"{Path(mark[0]).name}:{mark[1]}"

    return re.sub(r"\bline (\d+)", place, part) if type(part) is str else part


def _source_place(target: str, source: str, match: re.Match[str]) -> str:
    place = in_source(target, int(match[1])) if match[1] else None
    return source if place is None else f"{place[0]}:{place[1]}"


def _mapped(value: Any, function: Callable[[Any], Any]) -> Any:
    """Return a record with a function applied to each of its parts, outermost first."""
    value = function(value)
    if isinstance(value, tuple):
        return type(value)(_mapped(one, function) for one in value)
    if isinstance(value, msgspec.Struct):
        fields = {name: getattr(value, name) for name in value.__struct_fields__}
        changed = {key: _mapped(one, function) for key, one in fields.items()}
        different = {key: one for key, one in changed.items() if one is not fields[key]}
        return msgspec.structs.replace(value, **different) if different else value
    return value
