"""Pages on two model files, and on what changed since accepted results; in the report's style."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from io import StringIO
from pathlib import Path

from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.baseline import Gate
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedProperty,
    ComparisonResult,
)
from physics_crosscheck.harness.records.diff import Diff
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.scene import Scene, SceneBody
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.results.causes import own_file_sentence
from ..terminal.comparison import (
    MINOR,
    law_effect,
    line_name,
    print_comparison,
    values_of,
    verdict_sentences,
)
from . import page_of, page_of_report
from .packs import Pack
from .parts import WHOLE
from .scenes import THREE, three_code
from .view import Report, worst_scene

TEXT_COLUMNS = 110
"""Width of the terminal's text on a page."""


@dataclass(frozen=True)
class ChangedNumber:
    """A number that two files state differently.

    Attributes:
        name: of the number; the whole sentence if it has no two values.
        a, b: value in each file.
        where_a, where_b: line in each file; empty if unknown.
        effect: what it changes.
        minor: whether it is as small as rounding.
    """

    name: str
    a: str
    b: str
    where_a: str
    where_b: str
    effect: str
    minor: bool = False


def write_comparison(path: Path, comparison: ComparisonResult) -> None:
    """Write the page of a comparison: one self-contained HTML file.

    Raises:
        OSError: if the file can't be written; an existing page stays unchanged.
    """
    compared, names = comparison.compared, [Path(one.model).name for one in comparison.models]
    sentence, remedy, motions = comparison.reason, "", list[str]()
    if compared is not None:
        sentence, remedy, motions = verdict_sentences(comparison, compared)
    scenes = () if compared is None else compared.scenes
    packs = list(_scene_packs(scenes, names, changed_joints(compared))) if scenes else []
    written = page_of(
        "comparison.html",
        packs,
        scenes=bool(scenes),
        sentence=sentence,
        comparison=comparison,
        names=names,
        remedy=remedy,
        motions=motions,
        own_files=list(filter(None, map(own_file_sentence, comparison.models))),
        rows=[] if compared is None else list(changed_numbers(compared)),
        drawn=bool(scenes),
        text=_terminal_text(comparison),
    )
    write_whole(path, written)


def _terminal_text(comparison: ComparisonResult) -> str:
    file = StringIO()
    console = Console(file=file, width=TEXT_COLUMNS, highlight=False, emoji=False)
    print_comparison(console, comparison)
    return file.getvalue()


def changed_numbers(compared: Compared) -> Iterator[ChangedNumber]:
    """Yield what the files state differently: what moves first, then the laws, then the rest.

    Where no property differs, these are the edits of the text.
    """
    moving = [row for row in compared.properties if row.moves]
    others = [row for row in compared.properties if not row.moves]
    for row in (rows := (*moving, *(compared.laws or ()), *others)):
        name, a, b = values_of(row)
        here, there = map(_place, (row.where_a, row.where_b))
        small = row.relative is not None and 0 < row.relative < MINOR and row != rows[0]
        yield ChangedNumber(name or row.message, a, b, here, there, _effect(row), small)
    for difference in () if rows else compared.differences:
        moved = "" if difference.moved is None else f"changes motions by {difference.moved:.1e}"
        for edit in difference.edits:
            here, there = map(_place, (edit.where_a, edit.where_b))
            yield ChangedNumber(edit.what, edit.a, edit.b, here, there, moved)


def _place(where: SourceLine | None) -> str:
    return "" if where is None else line_name(where)


def _effect(row: ComparedProperty) -> str:
    if row.kind == "law":
        return law_effect(row)
    if not row.moves:
        return "not seen in motions"
    return "" if row.effect is None else f"changes motions by {row.effect:.1e}"


def changed_joints(compared: Compared | None) -> set[str]:
    """Return the joints and links whose numbers differ by more than rounding."""
    if compared is None:
        return set()
    rows = (*compared.properties, *(compared.laws or ()))
    decisive = () if compared.decisive is None else (compared.decisive,)
    some = [row for row in rows if row.relative is None or row.relative >= MINOR]
    return {row.about for row in (*decisive, *some) if row.about}


def overlaid(scenes: Sequence[Scene]) -> Scene:
    """Return the bodies of two scenes in one, those of the second after those of the first."""
    a, b = scenes
    joints, meshes = len(a.joints), len(a.meshes)

    def shifted(body: SceneBody) -> SceneBody:
        shapes = tuple(
            shape if shape.mesh is None else replace(shape, mesh=shape.mesh + meshes)
            for shape in body.shapes
        )
        joint = body.joint + joints if body.joint >= 0 else -1
        return replace(body, joint=joint, shapes=shapes)

    carried = (
        replace(joint, parent=joint.parent + joints if joint.parent >= 0 else -1)
        for joint in b.joints
    )
    return Scene(
        bodies=(*a.bodies, *map(shifted, b.bodies)),
        joints=(*a.joints, *carried),
        placements=(*a.placements, *b.placements),
        velocities=(*a.velocities, *b.velocities),
        accelerations=(*a.accelerations, *b.accelerations),
        home=(*a.home, *b.home),
        length=max(a.length or 0.0, b.length or 0.0),
        meshes=(*a.meshes, *b.meshes),
        unread=(*a.unread, *b.unread),
    )


def _scene_packs(
    scenes: Sequence[Scene], names: Sequence[str], changed: Iterable[str]
) -> Iterator[tuple[str, str]]:
    """Yield the pack of both robots in one picture, and that of the code that draws it."""
    both, count, wanted = overlaid(scenes), len(scenes[0].bodies), set(changed)
    lit = [
        i
        for i, body in enumerate(both.bodies[:count])
        if {body.name, both.joints[body.joint].name if body.joint >= 0 else ""} & wanted
    ]
    more = {"second": count, "names": names, "lit": lit}
    yield "pack-scene-0", Pack("pack-scene-0").to_text(scene=both, overlaid=more)
    if code := three_code():
        yield THREE, Pack(THREE).to_text(code=code)


def write_gate(
    path: Path,
    gate: Gate,
    changes: Sequence[tuple[Diff, Case | None]],
    results: Results | None,
    *,
    sentence: str,
    total: str,
    remedy: Sequence[str],
) -> None:
    """Write the page of a gate: what changed, before and after, and the changed cases' pages.

    Args:
        path: of the page.
        gate: the gate.
        changes: differences to list, worst first, each with its case in this run, if it ran.
        results: of this run; None if nothing ran.
        sentence: headline of the page.
        total: number of cases of each kind, in words.
        remedy: lines on how to undo or to accept the changes.

    Raises:
        OSError: if the file can't be written; an existing page stays unchanged.
    """
    folders = {case.folder for diff, case in changes if case and not diff.status.passes}
    fill = partial(page_of, "gate.html", (), scene=None)
    ids: dict[int, str] = {}
    if results is not None and folders and len(results.cases) <= WHOLE:
        systems, models, cases = (
            tuple(one for one in group if one.folder in folders)
            for group in (results.systems, results.models, results.cases)
        )
        report = Report(replace(results, systems=systems, models=models, cases=cases), path.parent)
        ids = {id(view.case): view.id for view in report.cases}
        scene = worst_scene(report.cases) if len(folders) == 1 else None
        fill = partial(page_of_report, report, name="gate.html", scene=scene)
    rows = [(diff, ids.get(id(case), "")) for diff, case in changes]
    write_whole(path, fill(sentence=sentence, rows=rows, gate=gate, total=total, remedy=remedy))
