"""Model files before an engine reads them: files that would hang or crash it are refused, by
line.
"""

import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.parsers import expat

from physics_crosscheck.harness.documents.document import Document, finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, RefusedFileError
from physics_crosscheck.harness.documents.expanded import locate_file
from physics_crosscheck.harness.documents.reading import MAX_MODEL_BYTES, read_regular
from physics_crosscheck.harness.documents.usd import UsdStage
from .protocol import EngineError, ModelSpec, Sample, UnsupportedError


class NoXmlError(EngineError):
    """A file that is not XML; `second_root` is true if only content after its root is wrong."""

    def __init__(self, sentence: str, *, file: Path, line: int, second_root: bool) -> None:
        super().__init__(sentence, file=file, line=line)
        self.second_root = second_root


def refused(element: XmlElement, sentence: str) -> EngineError:
    """Return an error about an element."""
    file, line = element.place
    return EngineError(sentence, file=file, line=line)


def read_document(path: Path) -> Document:
    """Parse XML, with entity expansion off.

    Raises:
        NoXmlError, EngineError: naming file and line.
    """
    try:
        return Document(path)
    except LocationError as error:
        if isinstance(error, RefusedFileError) or error.line is None:
            raise EngineError(error.sentence, file=path, line=error.line) from None
        second_root = error.sentence.endswith(expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT)
        raise NoXmlError(
            error.sentence, file=path, line=error.line, second_root=second_root
        ) from None


def refuse_problems(document: Document, *, unsupported: bool) -> None:
    """Refuse a file that breaks a rule of its format.

    Args:
        document: with its problems.
        unsupported: whether valid elements that have no equations are refused too; otherwise the
            engine decides.

    Raises:
        EngineError: naming file, line and remedy.
    """
    for problem in sorted(document.obstacles, key=lambda entry: entry.line):
        kind = UnsupportedError if problem.kind == "unsupported" else EngineError
        if kind is EngineError or unsupported:
            message = f"{problem.sentence}; {problem.remedy}"
            raise kind(message, file=problem.file, line=problem.line)


def read_source(path: Path) -> str:
    """Return the text of a model file.

    Raises:
        EngineError: for anything but a regular text file, such as a pipe, which would block.
    """
    try:
        return read_regular(path, MAX_MODEL_BYTES).decode("utf-8")
    except OSError as error:
        raise EngineError(f"can't be read: {error.strerror or error}", file=path) from None
    except UnicodeDecodeError as error:
        raise EngineError(f"can't be read: {error}", file=path) from None


def open_stage(spec: ModelSpec) -> UsdStage:
    """Open a stage of USD.

    Raises:
        EngineError: naming layer, line and remedy.
    """
    try:
        return UsdStage(spec.path, spec.settings)
    except LocationError as error:
        message = f"{error.sentence}; {error.remedy}"
        raise EngineError(message, file=error.file, line=error.line) from None


def with_stage_settings(spec: ModelSpec) -> ModelSpec:
    """Return a stage of USD with the settings that it states; the sidecar overrides them.

    Raises:
        EngineError: as `open_stage`.
    """
    return replace(spec, settings={**open_stage(spec).settings, **spec.settings})


@contextmanager
def temporary_file(data: bytes, path: Path) -> Iterator[Path]:
    """Yield a temporary file with some bytes, and the name of another file."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        file = Path(folder) / path.name
        file.write_bytes(data)
        try:
            yield file
        except Exception as error:
            # The engine's message names the copy, which is removed; name the user's file instead.
            error.args = tuple(
                one.replace(str(file), str(path)) if isinstance(one, str) else one
                for one in error.args
            )
            raise


def shortened(names: Sequence[str], limit: int = 6, separator: str = ", ") -> str:
    """Return the first names of a cause, and the number of the others."""
    more = len(names) - limit
    return separator.join(names[:limit]) + (f" and {more} more" if more > 0 else "")


def one_line(error: object) -> str:
    """Return an engine's message on one line."""
    return " ".join(str(error).split())


_NO_MEMORY = ("could not allocate memory", "cannot allocate memory", "out of memory", "bad_alloc")
"""Messages of engines after a failed allocation, in lower case."""


def check_memory(error: Exception) -> None:
    """Raise MemoryError if an engine's own error reports that memory ran out.

    An EngineError is about a file, and callers that vary numbers treat it as an answer. A lack of
    memory is not an answer.

    Raises:
        MemoryError: with the engine's message.
    """
    message = one_line(error)
    if isinstance(error, MemoryError) or any(words in message.lower() for words in _NO_MEMORY):
        raise MemoryError(message) from error


Reasons = Iterator[tuple[XmlElement, str]]


def _shape_reasons(robot: XmlElement, path: Path, message: str) -> Reasons:
    """Yield shapes, masses and meshes that are wrong, of the file, link or line in a message."""
    for link in robot.findall("link"):
        for part in link.iter(None):
            if not (link.get("name") in message or f"line {part.place[1]}" in message):
                continue
            for key in ("size", "radius", "length", "value"):
                words = part.get(key)
                if words and not min(finite_numbers(words) or [0.0]) > 0:
                    yield part, f"{key} {words!r} of <{part.tag}> is not positive; correct it"
        for mesh in link.iter("mesh"):
            name, is_missing = mesh.get("filename"), locate_file(path, mesh.get("filename")) is None
            if is_missing and (Path(name).name in message or link.get("name") in message):
                places = "the packages of this file and of ROS_PACKAGE_PATH"
                there = places if "://" in name else path.parent
                yield mesh, f"mesh {name!r} does not exist in {there}; add it, or correct the name"
            elif Path(name).name in message:
                yield mesh, f"mesh {name!r} can't be read; convert it to binary STL or OBJ"


def _joint_reasons(robot: XmlElement, path: Path, message: str) -> Reasons:
    for joint in robot.findall("joint"):
        name = repr(joint.get("name"))
        is_bounded = joint.get("type") in ("revolute", "prismatic")
        if is_bounded and "limits" in message and joint.find("limit") is None:
            yield joint, f"joint {name} has no <limit>; add one, or set another type"
        for part in joint.findall("dynamics"):
            if "dynamics" in message and not (part.get("damping") or part.get("friction")):
                yield part, f"<dynamics> of joint {name} states no damping or friction; add one"


_REASONS = (
    (r"limits|dynamics", _joint_reasons),
    (r"mass|format|size|mesh|file|collision", _shape_reasons),
)
"""Patterns of engines' messages about a URDF, and what in the file is looked at then."""


def load_failure(
    title: str,
    path: Path,
    message: str,
    kind: type[EngineError] = EngineError,
    line: int | None = None,
) -> EngineError:
    """Return an error with an engine's message; for a URDF with the reason and line, if clear."""
    text = f"{title} can't load it: {message}"
    for pattern, check in _REASONS if path.suffix == ".urdf" else ():
        if re.search(pattern, message):
            for element, reason in check(read_document(path).root, path, message):
                return kind(f"{reason} ({text})", file=element.place[0], line=element.place[1])
    named = re.findall(r"'([^']+)'", message) if path.suffix == ".urdf" else ()
    for link in read_document(path).root.findall("link") if named else ():
        if link.get("name") in named:
            return kind(text, file=link.place[0], line=link.place[1])
    return kind(text, file=path, line=line)


@contextmanager
def engine_errors(path: Path | str, title: str) -> Iterator[None]:
    """Convert any exception of an engine into an error that names the file."""
    try:
        yield
    except EngineError:
        raise
    except Exception as error:
        check_memory(error)
        problem = f"{title} raises {type(error).__name__}: {one_line(error)}"
        raise EngineError(problem, file=Path(path)) from error


def sample_stages() -> tuple[Sample, ...]:
    """Return a fixed base with a hinge, and on it a slide and a hinge with a drive."""
    bodies = (("base", 2.0, 0.0), ("upper", 1.5, 0.5), ("rod", 0.7, 0.1), ("tip", 0.4, 0.1))
    joints = (
        ("hinge", "Revolute", "Y", "base", "upper", 0.5, ""),
        ("slide", "Prismatic", "X", "upper", "rod", -0.4, ""),
        ("wrist", "Revolute", "X", "upper", "tip", -0.4, "angular"),
    )
    text = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
    text += 'def PhysicsScene "scene"\n{\n}\n'
    text += 'def Xform "arm" (prepend apiSchemas = ["PhysicsArticulationRootAPI"])\n{\n'
    for name, mass, height in bodies:
        schemas = '["PhysicsRigidBodyAPI", "PhysicsMassAPI"]'
        text += f'def Xform "{name}" (prepend apiSchemas = {schemas})\n{{\n'
        text += f"    double3 xformOp:translate = (0, 0, {height})\n"
        text += '    uniform token[] xformOpOrder = ["xformOp:translate"]\n'
        text += f"    float physics:mass = {mass}\n"
        text += "    point3f physics:centerOfMass = (0.05, 0.02, -0.15)\n"
        text += f"    float3 physics:diagonalInertia = ({mass / 50}, {mass / 60}, {mass / 80})\n"
        text += "    quatf physics:principalAxes = (0.98, 0.1, 0.15, 0.08)\n}\n"
    text += 'def PhysicsFixedJoint "anchor"\n{\n    rel physics:body1 = </arm/base>\n}\n'
    for name, kind, axis, parent, child, height, drive in joints:
        schemas = f' (prepend apiSchemas = ["PhysicsDriveAPI:{drive}"])' if drive else ""
        text += f'def Physics{kind}Joint "{name}"{schemas}\n{{\n'
        text += f'    uniform token physics:axis = "{axis}"\n'
        text += f"    rel physics:body0 = </arm/{parent}>\n    rel physics:body1 = </arm/{child}>\n"
        text += f"    point3f physics:localPos0 = (0, 0, {height})\n"
        if drive:
            text += f"    float drive:{drive}:physics:stiffness = 0.02\n"
            text += f"    float drive:{drive}:physics:damping = 0.001\n"
        text += "}\n"
    names = ("arm.usd", "arm.usda")
    return tuple(Sample(file=one, text=text + "}\n", settings={"step": 0.01}) for one in names)
