"""An MJCF, or what a URDF says to MuJoCo, before it is compiled: what is stated, and where."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec
from physics_crosscheck.harness.engines.remark import PULL, Remark
from physics_crosscheck.harness.engines.source import (
    NoXmlError,
    XmlSource,
    check_memory,
    folded,
    read_source,
    read_xml,
)

_OVERRIDING = {"step": "timestep", "gravity": "gravity", "integrator": "integrator"}
"""Settings of a sidecar, and what each overrides of an `<option>`."""

_DECLARED = re.compile(r"<!(DOCTYPE|ENTITY)", re.IGNORECASE)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


def sources(path: Path) -> tuple[XmlSource, ...]:
    """A file and those that it includes, as far as they are XML; MuJoCo reads some more leniently.

    Raises:
        EngineError: for what no engine should see: pipes, a DTD, a second root, of which MuJoCo
            reads the first alone.
    """
    return tuple(one for one in _found(path).values() if one is not None)


def included(path: Path) -> tuple[Path, ...]:
    """A file and those that it includes, also those that are no XML.

    Raises:
        EngineError: as `sources`.
    """
    return tuple(_found(path))


def _found(path: Path) -> dict[Path, XmlSource | None]:
    found: dict[Path, XmlSource | None] = {}
    _collect(path, path.parent, found)
    return found


def _collect(path: Path, folder: Path, found: dict[Path, XmlSource | None]) -> None:
    if path in found:
        return
    text = read_source(path, mend=True)
    found[path] = None
    try:
        source = read_xml(text, path)
    except NoXmlError as error:
        if error.second_root or _DECLARED.search(_COMMENT.sub("", text)):
            raise
        return  # two hyphens in a comment, say: MuJoCo reads them
    found[path] = source
    for include in source.root.iter("include"):
        name = include.get("file", "")
        if name and (folder / name).exists():  # these stand beside the first
            if not (folder / name).is_file():
                raise source.refused(include, f"<include file> has {name!r}, which is not a file")
            _collect(folder / name, folder, found)


def stated(found: Sequence[XmlSource], attribute: str) -> Iterator[tuple[str, str]]:
    """What each `<option>` states of an attribute, with its file and line."""
    for source in found:
        for option in source.root.iter("option"):
            if attribute in option.attrib:
                yield option.attrib[attribute], f"{source.path}:{source.lines[option]}"


def checked_step(step: float, found: Sequence[XmlSource], spec: ModelSpec, least: float) -> float:
    """The step of a compiled model, which must be one.

    Raises:
        EngineError: naming file and line.
    """
    if least <= step < math.inf:
        return step
    places = [where for _, where in stated(found, "timestep")]
    where = places[-1] if places else str(spec.path)
    raise EngineError(
        f"{(f'{spec.path}.toml' if 'step' in spec.settings else where)}: the time "
        f"step is {step:g} s; expected {least:g} s or more"
    )


def checked_numbers(arrays: Mapping[str, object], found: Sequence[XmlSource], path: Path) -> None:
    """Refuse a model in which a number is none, or went beyond all.

    Args:
        arrays: fields of the compiled model that are not finite.
        found: its files.
        path: the first of them.

    Raises:
        EngineError: naming file and line of the number that is not finite, or of the largest.
    """
    if not arrays:
        return
    words = list(_words(found))
    if error := _not_a_number(words):
        raise error
    fields = ", ".join(arrays)
    told = f"{fields} of the compiled model {'is' if len(arrays) == 1 else 'are'} not finite"
    if not words:
        raise EngineError(f"its numbers; {told}", file=path)
    largest = max(words, key=lambda word: word.size)
    raise EngineError(f"{largest.sentence}; {told}", file=largest.file, line=largest.line)


class _Word(NamedTuple):
    """The size of a number, and what is said of it, with its place."""

    size: float
    sentence: str
    file: Path
    line: int


def _words(found: Sequence[XmlSource]) -> Iterator[_Word]:
    """Every number."""
    for source in found:
        for element in source.root.iter():
            for key, words in element.attrib.items():
                if key in ("name", "class") or "range" in key:
                    continue
                for word, value in _numbers(words):
                    told = f"<{element.tag} {key}> has {word!r}"
                    yield _Word(abs(value), told, source.path, source.lines[element])


def _not_a_number(words: Iterable[_Word]) -> EngineError | None:
    """That a number is none, or beyond all; None where all are finite."""
    for word in words:
        if not math.isfinite(word.size):
            told = f"{word.sentence}; expected a finite number"
            return EngineError(told, file=word.file, line=word.line)
    return None


def _numbers(words: str) -> Iterator[tuple[str, float]]:
    for word in words.split():
        try:
            yield word, float(word)
        except ValueError:
            return


def override_remarks(found: Sequence[XmlSource], spec: ModelSpec) -> Iterator[Remark]:
    """What the file states and the sidecar's settings override."""
    for key, attribute in _OVERRIDING.items():
        if key not in spec.settings:
            continue
        given = spec.settings[key]
        for words, _ in list(stated(found, attribute))[-1:]:
            if not _same(words, given):
                yield Remark(
                    kind="setting",
                    message=(
                        f"the sidecar's {key} = {given} overrides the file's {attribute}, {words}"
                    ),
                    address=f"option@{attribute}",
                    beside=f"sidecar:settings.{key}",
                    shows_in=PULL if key == "gravity" else (),
                )


def doubled_remarks(found: Sequence[XmlSource]) -> Iterator[Remark]:
    """Second elements where most files have one: MuJoCo merges them, the last word counts."""
    for source in found:
        for tag in ("worldbody", "option", "compiler"):
            for second in source.root.findall(tag)[1:]:
                yield Remark(
                    message=f"a second <{tag}> at {source.path.name}:{source.lines[second]}: MuJoCo"
                    " merges it with the first",
                    address="",
                )


def _same(words: str, given: object) -> bool:
    """Whether an attribute says what a setting does."""
    if isinstance(given, str):
        return words.strip().lower() == given.lower()
    values = given if isinstance(given, list) else [given]
    return [value for _, value in _numbers(words)] == values


def refusal(error: Exception, path: Path, found: Sequence[XmlSource]) -> EngineError:
    """What MuJoCo says on several lines, on one, and at its line where that is in this file.

    Raises:
        MemoryError: where it says that memory ran out, whatever is in the file.
    """
    check_memory(error)
    if wrong := _not_a_number(_words(found)):
        return wrong
    reason = folded(error)
    # MuJoCo has no other way to say the line.
    line = re.search(r",? line (\d+)", reason)
    alone = len(found) == 1 and not any(True for _ in found[0].root.iter("include"))
    known = int(line[1]) if line and alone else None
    return EngineError(f"MuJoCo can't load it: {reason}", file=path, line=known)
