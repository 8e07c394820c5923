"""An MJCF, or a URDF for MuJoCo, before compilation: stated values and their places."""

import math
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.schema import similar
from ..protocol import EngineError, ModelSpec
from ..remark import POSITION_FORCE_TERMS, Remark
from ..source import NoXmlError, check_memory, load_failure, one_line, read_document, refused

_OVERRIDING = {"step": "timestep", "gravity": "gravity", "integrator": "integrator"}
"""Settings of a sidecar, and the `<option>` attribute that each overrides."""

_DECLARED = re.compile(r"<!(DOCTYPE|ENTITY)", re.IGNORECASE)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


def sources(path: Path, document: Document | None = None) -> tuple[Document, ...]:
    """Return a file and its includes, if they are XML; MuJoCo's parser accepts more.

    Args:
        path: the file.
        document: its content, if it is read already.

    Raises:
        EngineError: for files that no engine should read: pipes, a DTD, or a second root, of which
            MuJoCo reads only the first.
    """
    return tuple(one for one in _sources_by_path(path, document).values() if one is not None)


def included(path: Path) -> tuple[Path, ...]:
    """Return a file and its includes, also those that are not XML.

    Raises:
        EngineError: as `sources`.
    """
    return tuple(_sources_by_path(path))


def _sources_by_path(path: Path, document: Document | None = None) -> dict[Path, Document | None]:
    by_path: dict[Path, Document | None] = {}
    _collect(path, path.parent, by_path, document)
    return by_path


def _collect(
    path: Path, folder: Path, by_path: dict[Path, Document | None], document: Document | None = None
) -> None:
    if path in by_path:
        return
    by_path[path] = None
    try:
        source = document or read_document(path)
    except NoXmlError as error:
        if error.second_root or _declares(path):
            raise
        return  # two hyphens in a comment, say: MuJoCo accepts them
    by_path[path] = source
    for include in (one for one in source.elements if one.tag == "include"):
        name = include.get("file", "")
        if name and (folder / name).exists():  # paths are relative to the first file
            if not (folder / name).is_file():
                raise refused(include, f"<include file> has {name!r}, which is not a file")
            _collect(folder / name, folder, by_path)


def _declares(path: Path) -> bool:
    """Return whether a file declares a DTD or entities."""
    text = path.read_bytes().decode("utf-8", errors="replace")
    return bool(_DECLARED.search(_COMMENT.sub("", text)))


def stated(xml_sources: Sequence[Document], attribute: str) -> Iterator[tuple[str, str]]:
    """Yield the value of an attribute in each `<option>`, with its file and line."""
    for source in xml_sources:
        for option in source.root.iter("option"):
            if attribute in option.attributes:
                yield option.attributes[attribute], "{}:{}".format(*option.place)


def checked_step(
    step: float, xml_sources: Sequence[Document], spec: ModelSpec, least: float
) -> float:
    """Return the step of a compiled model if it is valid.

    Raises:
        EngineError: naming file and line.
    """
    if least <= step < math.inf:
        return step
    places = [where for _, where in stated(xml_sources, "timestep")]
    where = places[-1] if places else str(spec.path)
    raise EngineError(
        f"{(f'{spec.path}.toml' if 'step' in spec.settings else where)}: the time "
        f"step is {step:g} s; expected {least:g} s or more"
    )


def checked_numbers(
    arrays: Mapping[str, object], xml_sources: Sequence[Document], path: Path
) -> None:
    """Refuse a model with a number that is not finite.

    Args:
        arrays: fields of the compiled model that are not finite.
        xml_sources: its files.
        path: the first of them.

    Raises:
        EngineError: naming file and line of the number that is not finite, or of the largest.
    """
    if not arrays:
        return
    words = list(_words(xml_sources))
    if error := _not_a_number(words):
        raise error
    fields = ", ".join(arrays)
    problem = f"{fields} of the compiled model {'is' if len(arrays) == 1 else 'are'} not finite"
    if not words:
        raise EngineError(f"its numbers; {problem}", file=path)
    _, sentence, element = max(words, key=lambda word: word[0])
    file, line = element.place
    raise EngineError(f"{sentence}; {problem}", file=file, line=line)


_Word = tuple[float, str, XmlElement]
"""The size of a number, a sentence about it, and its element."""


def _words(xml_sources: Sequence[Document]) -> Iterator[_Word]:
    """Yield every number."""
    for source in xml_sources:
        for element in source.root.iter():
            for key, words in element.attributes.items():
                if key in ("name", "class") or "range" in key:
                    continue
                for word, value in _numbers(words):
                    sentence = f"<{element.tag} {key}> has {word!r}"
                    yield abs(value), sentence, element


def _not_a_number(words: Iterable[_Word]) -> EngineError | None:
    """Return an error about the first number that is not finite, or None."""
    for size, sentence, element in words:
        if not math.isfinite(size):
            file, line = element.place
            return EngineError(f"{sentence}; expected a finite number", file=file, line=line)
    return None


def _numbers(words: str) -> Iterator[tuple[str, float]]:
    for word in words.split():
        try:
            yield word, float(word)
        except ValueError:
            return


def override_remarks(xml_sources: Sequence[Document], spec: ModelSpec) -> Iterator[Remark]:
    """Yield values of the file that the sidecar's settings override."""
    for key, attribute in _OVERRIDING.items():
        if key not in spec.settings:
            continue
        given = spec.settings[key]
        for words, _ in list(stated(xml_sources, attribute))[-1:]:
            if not _same(words, given):
                yield Remark(
                    kind="setting",
                    message=(
                        f"the sidecar's {key} = {given} overrides the file's {attribute}, {words}"
                    ),
                    address=f"option@{attribute}",
                    related_address=f"sidecar:settings.{key}",
                    shows_in=POSITION_FORCE_TERMS if key == "gravity" else (),
                )


def doubled_remarks(xml_sources: Sequence[Document]) -> Iterator[Remark]:
    """Yield repeated elements that most files have once: MuJoCo merges them, and the last value
    counts.
    """
    for source in xml_sources:
        for tag in ("worldbody", "option", "compiler"):
            for second in source.root.findall(tag)[1:]:
                yield Remark(
                    message=f"a second <{tag}> at {source.path.name}:{second.place[1]}: MuJoCo"
                    " merges it with the first",
                    address="",
                )


def _same(words: str, given: object) -> bool:
    """Return whether an attribute equals a setting."""
    if isinstance(given, str):
        return words.strip().lower() == given.lower()
    values = given if isinstance(given, list) else [given]
    return [value for _, value in _numbers(words)] == values


def _missing_file(reason: str, path: Path, sources: Sequence[Document]) -> EngineError | None:
    """Return the error about a file that MuJoCo can't open, at the element that names it."""
    named = re.match(r"Error: Error opening file '([^']+)'", reason)
    wanted = path.parent / named[1] if named else None
    if wanted is None or wanted.is_file():
        return None
    for source in sources:
        for element in source.root.iter(None):
            if Path(element.get("file")).name == wanted.name:
                users = _bodies_of(element.get("name") or wanted.stem, sources)
                inertia = f"; it gives body {' and '.join(users)} its inertia" if users else ""
                other = ", or state an <inertial> in the body" if users else ""
                folder = wanted.parent if wanted.parent.is_dir() else f"{wanted.parent} (missing)"
                return EngineError(
                    f"{wanted} does not exist, searched in {folder}{inertia}: add it{other}, or "
                    f"correct <{element.tag} file> or meshdir",
                    file=source.path,
                    line=source.line(element),
                )
    return None


def _bodies_of(mesh: str, sources: Sequence[Document]) -> list[str]:
    """Return bodies without <inertial> that get their inertia from a mesh."""
    geoms = [geom for source in sources for geom in source.root.iter("geom")]
    bodies = [geom.parent for geom in geoms if geom.get("mesh") == mesh]
    return list(
        dict.fromkeys(
            repr(one.get("name")) if one.get("name") else "without a name"
            for one in bodies
            if one is not None and one.tag == "body" and one.find("inertial") is None
        )
    )


def load_error(error: Exception, path: Path, xml_sources: Sequence[Document]) -> EngineError:
    """Return MuJoCo's message as one line, with the line number if it is in this file.

    Raises:
        MemoryError: if MuJoCo reports that memory ran out.
    """
    check_memory(error)
    if wrong := _not_a_number(_words(xml_sources)):
        return wrong
    reason = one_line(error)
    if missing := _missing_file(reason, path, xml_sources):
        return missing
    # MuJoCo reports the line in its text only.
    line = re.search(r",? line (\d+)", reason)
    is_only_file = len(xml_sources) == 1 and not any(
        True for _ in xml_sources[0].root.iter("include")
    )
    known_line = int(line[1]) if line and is_only_file else None
    return load_failure("MuJoCo", path, reason + _hint(reason), line=known_line)


UNRECOGNIZED = re.compile(r"unrecognized (attribute|element).*?(?:'(\w+)' )?Element '(\w+)'")


def _hint(reason: str) -> str:
    """Return the name in MuJoCo's schema that an unrecognized one probably stands for."""
    match = UNRECOGNIZED.search(reason)
    if match is None:
        return ""
    tags = _schema()
    is_element = match[1] == "element"
    written = match[3] if is_element else match[2] or ""
    close = similar(written, tags if is_element else tags[match[3]])
    return f"; did you mean {f'<{close}>' if is_element else close}?" if close else ""


@lru_cache(maxsize=1)
def _schema() -> Mapping[str, Collection[str]]:
    """Return attributes by element, as MuJoCo prints them; empty for an unlisted element."""
    names: dict[str, set[str]] = defaultdict(set)
    tag = ""
    import mujoco  # it is loaded, as its error shows

    for line in mujoco.mj_printSchema(False, False).splitlines():
        start = re.match(r" *(?:\(world\))?(\w+) \([!*?R]\)", line)
        tag = start[1] if start else tag
        names[tag].update(line[start.end() if start else 0 :].split())
    return names
