"""Findings about a file by reading it, and the settings for running a robot file."""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import cast

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.schema import unknown_names
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.registry import engines_reading
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.modelfiles.inertias import Kind as InertiaKind
from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.modelfiles.locations import MARKUP, line_of
from physics_crosscheck.harness.modelfiles.mjcf.read import parts_of
from physics_crosscheck.harness.modelfiles.numbers import numerals
from physics_crosscheck.harness.modelfiles.robot import FilePlace, Omission, Robot
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.finding import (
    AuditFinding,
    AuditKind,
    PlausibilityKind,
    Severity,
)
from physics_crosscheck.reference.mechanism.tree import WORLD


def finding(
    kind: AuditKind | PlausibilityKind,
    subject: tuple[str, ...],
    message: str,
    *,
    location: SourceLine | None = None,
    expected: float | None = None,
    actual: float | None = None,
    replacement: str = "",
    severity: Severity = "finding",
) -> AuditFinding:
    """Build a finding or a note; most have no source line and compare no two numbers."""
    return AuditFinding(
        kind=kind,
        subject=subject,
        message=message,
        location=location,
        expected=number(expected),
        actual=number(actual),
        replacement=replacement,
        severity=severity,
    )


def source_line(number: Number) -> SourceLine:
    """Return the source line of a number, with its byte range."""
    return SourceLine(file=str(number.file), line=number.line, span=number.span, text=number.text)


STANDALONE_SETTINGS: Mapping[str, object] = MappingProxyType({"smooth": True, "couplings": False})
"""Settings of every engine: they switch off the effects that the equations omit."""


def inertia_findings(robot: Robot) -> tuple[AuditFinding, ...]:
    """Return findings for non-physical inertias; notes for fixed bodies."""
    still = {part.name for part in robot.parts if part.body == WORLD}
    return tuple(
        finding(
            cast(InertiaKind, one.kind),
            (one.link, one.kind),
            f"{one.sentence}; {one.remedy}",
            location=SourceLine(file=str(one.file), line=one.line or None),
            severity="note" if one.rounded or (one.link in still and robot.tree) else "finding",
        )
        for one in impossible_inertias(robot)
    )


_NEGATIVE = re.compile(r".*[/@](\w*damping|\w*stiffness|springStiffness|spring_stiffness|armature)")


def robot_findings(robot: Robot) -> tuple[AuditFinding, ...]:
    """Return what is wrong with a file by reading it: inertias, signs, engines' remarks."""
    findings = (*inertia_findings(robot), *negative_findings(robot.file), *_remarks(robot.file))
    return tuple(dict.fromkeys((*findings, *_unread_findings(robot))))


_UNREAD = re.compile(
    r"<(?!(contact|plugin|sensor)\b)[\w:]+> of <(?!(world|sdf|physics)\b).*"
    r"|[\w:]+ of <(?!robot\b).*"
    r"|(?!<mujoco>)<(?!(transmission|sensor|group|ros2_control|plugin)\b)\w+>"
)
"""Content of a URDF or SDF that no engine reads, and that may change motions."""


def _unread_findings(robot: Robot) -> Iterator[AuditFinding]:
    """Yield misspelled names, and notes on other names that no engine reads."""
    misspelled = set()
    with suppress(LocationError):  # already reported by the reader of the file
        for names, written, sentence, is_lost in unknown_names(Document(robot.file).root):
            misspelled.add(written)
            severity: Severity = "finding" if is_lost else "advice"
            line = _file_line(robot.file, written)
            yield finding("misspelled", names, sentence, location=line, severity=severity)
    for omission in robot.left_out:
        what, place = omission.what, omission.place
        if place is not None and place not in misspelled and _UNREAD.fullmatch(what):
            message, line = f"no engine reads {what}", _file_line(robot.file, place)
            yield finding("unread", (what,), message, location=line, severity="note")


def _file_line(file: Path, place: FilePlace) -> SourceLine:
    return SourceLine(file=str(place[0] or file), line=place[1])


def _remarks(file: Path) -> Iterator[AuditFinding]:
    for engine in engines_reading(file.suffix):
        with suppress(EngineError):  # its own case reports that it cannot read the file
            for remark in engine.file_remarks(file) if engine.version() is not None else ():
                yield finding(
                    remark.kind,
                    remark.subject or (remark.message,),
                    remark.message,
                    location=place_of(file, remark),
                    actual=remark.value,
                    severity="finding" if remark.fault else "note",
                )


def place_of(file: Path, remark: Remark) -> SourceLine:
    """Return the line that a remark concerns, in a file or in one that it includes."""
    places = ((part, line_of(part, remark.address or "")) for part in parts_of(file))
    part, line = next(((p, n) for p, n in places if n is not None), (file, None))
    return SourceLine(file=str(part), line=line)


def negative_findings(file: Path) -> Iterator[AuditFinding]:
    """Yield each negative damping, stiffness and armature of a file, by its line."""
    for part in _parts(file) if file.suffix in MARKUP else ():
        try:
            numbers = numerals(Document(part))
        except LocationError:
            continue  # already reported by the reader of the file
        for entry in numbers:
            kind = _NEGATIVE.fullmatch(entry.path)
            if kind is None or entry.value >= 0 or entry.word:
                continue
            yield finding_of(entry, kind[1])


def _parts(file: Path) -> tuple[Path, ...]:
    try:
        return parts_of(file)
    except EngineError:  # already reported by the reader of the file
        return ()


def finding_of(number: Number, what: str) -> AuditFinding:
    """Return the finding about a negative number; a spring may be negative."""
    word = next(word for word in _EFFECTS if word in what.lower())
    return finding(
        _NEGATIVES[word],
        (number.address,),
        f"{number.address} is {number.value:g}: negative {word} {_EFFECTS[word]}",
        location=source_line(number),
        actual=number.value,
        severity="note" if word == "stiffness" else "finding",
    )


_NEGATIVES: Mapping[str, AuditKind] = {
    "damping": "negative damping",
    "stiffness": "negative stiffness",
    "armature": "negative armature",
}

_EFFECTS = {
    "damping": "adds energy to the motion. Write a positive number",
    "stiffness": "pushes away from the rest position. Check the sign",
    "armature": "removes inertia from a joint. Write a positive number",
}


def settings_of(robot: Robot) -> Mapping[str, object]:
    """Return the settings with which every engine runs a robot."""
    settings: dict[str, object] = dict(robot.stated)
    if robot.controls:
        settings["controls"] = list(robot.controls)
    if robot.tree is not None and robot.tree.couplings:
        settings["couplings"] = [
            robot.tree.links[one.follower].name for one in robot.tree.couplings
        ]
    if robot.floats:
        settings["floating"] = True
    if robot.held:
        settings["held"] = list(robot.held)
    return {**STANDALONE_SETTINGS, **settings}


def sidecar_beside(file: Path) -> tuple[str, ...]:
    """Return a remark about a sidecar, which is ignored if its file is checked alone."""
    sidecar = file.with_name(f"{file.name}.toml")
    return (
        (f"the contents of {sidecar.name}, which is read together with its folder",)
        if sidecar.is_file()
        else ()
    )


def format_omission(omission: Omission) -> str:
    """Format an omission, such as: dry friction (7)."""
    return omission.what if omission.count == 1 else f"{omission.what} ({omission.count})"
