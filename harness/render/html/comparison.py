"""Pages on two model files, and on what changed since accepted results; in the report's style."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from io import StringIO
from pathlib import Path

from msgspec.structs import replace
from rich.console import Console

from physics_crosscheck.harness.records.baseline import Gate
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedProperty,
    ComparisonResult,
)
from physics_crosscheck.harness.records.diff import Diff
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.results.causes import own_file_sentence
from ..terminal.comparison import MINOR, law_effect, print_comparison, verdict_sentences
from . import page_of, page_of_report
from .packs import Pack
from .parts import WHOLE
from .scenes import THREE, three_code
from .view import Report, worst_scene

TEXT_COLUMNS = 110
"""Width of the terminal's text on a page."""


def write_comparison(path: Path, comparison: ComparisonResult) -> None:
    """Write the page of a comparison: one self-contained HTML file.

    Raises:
        OSError: if the file can't be written; an existing page stays unchanged.
    """
    compared, names = comparison.compared, [Path(one.model).name for one in comparison.models]
    sentence, remedy, motions = comparison.reason, "", list[str]()
    rows, packs = list[ComparedProperty](), dict[str, str]()
    if compared is not None:
        sentence, remedy, motions = verdict_sentences(comparison, compared)
        stated = sorted(compared.properties, key=lambda row: not row.moves)
        moving = sum(row.moves for row in stated)
        rows = [*stated[:moving], *(compared.laws or ()), *stated[moving:]]
        packs = _scene_packs(compared, names, {row.about for row in rows if not is_minor(row)})
    text = StringIO()
    print_comparison(Console(file=text, width=TEXT_COLUMNS, emoji=False), comparison)
    page = page_of(
        "comparison.html", packs.items(), scenes=bool(packs), sentence=sentence, names=names,
        comparison=comparison, remedy=remedy, drawn=bool(packs), text=text.getvalue(),
        motions=[*motions, *filter(None, map(own_file_sentence, comparison.models))],
        rows=[(row, effect_of(row), is_minor(row)) for row in rows],
    )  # fmt: skip
    write_whole(path, page)


def is_minor(row: ComparedProperty) -> bool:
    """Return whether a difference is as small as rounding."""
    return row.relative is not None and 0 < row.relative < MINOR


def effect_of(row: ComparedProperty) -> str:
    """Return what a difference changes, in words."""
    if row.kind == "law":
        return law_effect(row)
    if not row.moves:
        return "not seen in motions"
    return "" if row.effect is None else f"changes motions by {row.effect:.1e}"


def _scene_packs(compared: Compared, names: Sequence[str], changed: set[str]) -> dict[str, str]:
    """Return the packs of both robots in one picture, and of the code that draws it."""
    if len(compared.scenes) != len(names):
        return {}
    scene, other = compared.scenes
    joints = ["", *(joint.name for joint in scene.joints)]
    named = [{body.name, joints[body.joint + 1]} - {""} for body in scene.bodies]
    lit = [i for i, own in enumerate(named) if own & changed]
    pack, code = Pack("pack-scene-0"), three_code()
    both = pack.to_text(scene=scene, overlaid={"other": other, "names": names, "lit": lit})
    return {pack.id: both, **({THREE: Pack(THREE).to_text(code=code)} if code else {})}


def write_gate(
    path: Path,
    gate: Gate,
    changes: Sequence[tuple[Diff, Case | None]],
    results: Results | None,
    texts: tuple[str, str, Sequence[str]],
) -> None:
    """Write the page of a gate: what changed, before and after, and the changed cases' pages.

    Args:
        path: of the page.
        gate: the gate.
        changes: differences to list, worst first, each with its case in this run, if it ran.
        results: of this run; None if nothing ran.
        texts: headline, number of cases of each kind, and lines of the remedy.

    Raises:
        OSError: if the file can't be written; an existing page stays unchanged.
    """
    folders = {case.folder for diff, case in changes if case and not diff.status.passes}
    fill, ids = partial(page_of, "gate.html", (), scene=None), dict[int, str]()
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
    sentence, total, remedy = texts
    write_whole(path, fill(sentence=sentence, rows=rows, gate=gate, total=total, remedy=remedy))
