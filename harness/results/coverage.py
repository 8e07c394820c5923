"""Coverage of a model and its verdict on one line."""

from collections.abc import Iterable, Mapping

from physics_crosscheck.harness.records.coverage import Coverage, Untested
from physics_crosscheck.harness.records.finding import BEYOND
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.poses import Poses
from physics_crosscheck.harness.records.results import Results
from .status import counted, listed


def coverage_lines(models: Iterable[Model]) -> list[str]:
    """Return one line per model; models with the same coverage share a line."""
    models_by_line: dict[str, list[str]] = {}
    for model in models:
        if line := coverage_line(model):
            models_by_line.setdefault(line, []).append(str(model.id))
    return [f"{', '.join(names)}: {line}" for line, names in models_by_line.items()]


def coverage_summary(models: Iterable[Model]) -> str:
    """Return how many numbers of the files were tested; each file counts in its best engine."""
    best: dict[tuple[str, str], Coverage] = {}
    for model in models:
        coverage, key = model.coverage, (model.folder, model.model)
        if (
            coverage is not None
            and coverage.numbers
            and (key not in best or coverage.seen > best[key].seen)
        ):
            best[key] = coverage
    total = sum(coverage.numbers for coverage in best.values())
    tested = sum(coverage.seen for coverage in best.values())
    read = sum(coverage.read for coverage in best.values())
    share = f"{100 * tested / total:.0f} %" if total else ""
    line = f"{tested} of {counted(total, 'number')} tested ({share})" if total else ""
    return f"{line}, {read} only read" if read else line


def left_out(models: Iterable[Model]) -> list[str]:
    """Return one line per robot file with parts that are not compared."""
    lines_by_file = {
        model.folder: ", ".join(model.coverage.left_out)
        for model in models
        if model.coverage is not None and model.coverage.left_out
    }
    reason = "it has more than is checked; not compared"
    return [f"{file}: {reason}: {what}" for file, what in lines_by_file.items()]


MAX_UNREAD = 8
"""Most names on the line of names that no engine reads."""


def unread_line(models: Iterable[Model]) -> str:
    """Return what files state and no engine reads, such as the inertia of a motor, or ""."""
    places: dict[str, dict[str, None]] = {}
    for model in models:
        for note in model.audit or ():
            if note.kind == "unread" and note.location is not None:
                name = note.subject[0].partition(" of ")[0]
                line = "" if note.location.line is None else f":{note.location.line}"
                places.setdefault(model.model, {})[f"{name}{line}"] = None
    parts = [
        f"{f'{file}: ' if len(places) > 1 else ''}{listed(list(names), MAX_UNREAD)}"
        for file, names in places.items()
    ]
    return f"not read by any engine: {'; '.join(parts)}" if parts else ""


def refused(results: Results) -> list[str]:
    """Return one line per engine that rejects a robot file which other engines judge."""
    return [f"{case.id}: refused: {case.reason}" for case in results.refusals]


def coverage_line(model: Model, *, examples: bool = False) -> str:
    """Return the numbers tested, the poses compared, and the numbers without effect on motion."""
    parts = []
    if model.coverage is not None:
        if model.coverage.numbers or model.coverage.note:
            parts.append(numbers_seen(model.coverage, examples, model.engine))
        if model.coverage.left_out:
            parts.append(f"not compared: {', '.join(model.coverage.left_out)}")
    if model.poses is not None:
        parts.append(poses_checked(model.poses))
    beyond = [one.message for one in model.audit or () if one.kind == BEYOND]
    if beyond:
        parts.append(f"not reached: {'; '.join(beyond)}")
    return "; ".join(parts)


def numbers_seen(coverage: Coverage, examples: bool, engine: str) -> str:
    """Return how many numbers each kind of test covered, and why the others are untested.

    Name the engine whose checks are counted, unless it is this one.
    """
    if coverage.note:
        return f"numbers not counted: {coverage.note}"
    by: Mapping[str, int] = {
        "motion": coverage.motion, "audit": coverage.audit, "frames": coverage.frames,
    }  # fmt: skip
    counts_text = ", ".join(f"{count} by {what}" for what, count in by.items() if count)
    line = f"{coverage.seen} of {counted(coverage.numbers, 'number')} tested"
    line += f" in {coverage.engine}" if coverage.engine not in ("", engine) else ""
    line += f" ({counts_text})" if counts_text else ""
    line += f"; {coverage.read} only {READ}" if coverage.read else ""
    untested = [
        f"{one.count} ({one.reason}{f': {_some(one)}' if examples else ''})"
        for one in coverage.untested
    ]
    return line + (f"; untested: {', '.join(untested)}" if untested else "")


READ = "read: compiled as the text states, but no test depends on them"
"""Meaning of the numbers that are only read."""


def _some(untested: Untested) -> str:
    more = untested.count > len(untested.examples)
    return ", ".join((*untested.examples, "...") if more else untested.examples)


def poses_checked(poses: Poses) -> str:
    """Return which frames agree, or why none was compared."""
    if poses.note:
        return f"poses not compared: {poses.note}"
    wrong = [frame.name for frame in poses.wrong]
    line = f"{counted(len(poses.frames), 'pose')} compared"
    if poses.shapes:
        line += f", {counted(poses.shapes, 'shape or site', 'shapes and sites')}"
    if wrong:
        line += f", {len(wrong)} wrong ({', '.join(wrong)})"
    if poses.unchecked:
        line += f", not {', '.join(poses.unchecked)} (not in the sidecar's [frames])"
    return line
