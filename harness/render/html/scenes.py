"""Scenes of the report: bodies in 3-D, and the lines of the file that belong to each of them."""

from __future__ import annotations

import importlib.util
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from msgspec.structs import asdict

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.scene import Scene, Spans, StateErrors
from physics_crosscheck.harness.results.status import counted
from .diagnoses import blamed_lines, marked_lines

THREE = "pack-three"
"""Id of the pack with the code of three.js."""

LARGEST_TEXT = 400_000
"""Characters of a model file beyond which its source is not shown beside the scene."""


@dataclass(frozen=True, kw_only=True)
class SceneView:
    """The scene of a page.

    Attributes:
        scene: id of the pack with the bodies.
        states: id of the pack with the errors of a case; empty without any.
        about: description in words.
        unread: meshes that are not drawn, in words; empty without any.
    """

    scene: str
    states: str
    about: str
    unread: str


@cache
def three_code() -> str:
    """Return the code of three.js that trimesh's viewer carries; empty without it.

    The template is internal to trimesh, so that a version without it leaves the drawn projection.
    """
    spec = importlib.util.find_spec("trimesh")
    if spec is None or not spec.submodule_search_locations:
        return ""
    path = Path(spec.submodule_search_locations[0], "resources", "templates", "viewer.zip")
    try:
        with zipfile.ZipFile(path) as file:
            text = file.read(file.namelist()[0]).decode("utf-8")
    except (OSError, IndexError, UnicodeDecodeError, zipfile.BadZipFile):
        return ""
    code = text.partition("<script>")[2].partition("\n(function()")[0]
    return code if "Three.js Authors" in code and ".THREE={}" in code else ""


def scene_about(scene: Scene, lit: Sequence[int]) -> str:
    """Describe a scene in words."""
    names = ", ".join(scene.bodies[i].name for i in lit)
    what = f"{counted(len(scene.bodies), 'body', 'bodies')} in 3-D"
    return f"{what}; the cause names {names}." if names else f"{what}."


def case_states(
    scene: Scene, case: Case, errors: StateErrors, model: Model | None
) -> tuple[str, dict[str, object]]:
    """Return the description of a case's scene, and what the script draws of its states.

    Besides the fields of the errors, that is:

    - worst: index of the state to open; the number of states for that of whole steps.
    - acting: the state of whole steps; None without one of the same joints.
    - bodies: index of the first body that each coordinate moves; -1 for none.
    - lit: indices of the bodies that the cause names.
    - lines: lines of each body in the file.
    - marked: lines that the cause names.
    - text: the file; empty if it is too long.
    - file: its absolute path.
    """
    text = "" if model is None or len(model.text) > LARGEST_TEXT else model.text
    lines = errors.lines if text and errors.lines else ((),) * len(scene.bodies)
    blamed = [*case.locations, *(() if model is None else blamed_lines(model))]
    marked = sorted(marked_lines(blamed, case.model))
    joints = [joint.name for joint in scene.joints]
    acting = None if case.whole_step is None else case.whole_step.acting
    if acting is not None and list(acting.joints) != joints:
        acting = None
    carried = {body.joint: i for i, body in reversed(list(enumerate(scene.bodies)))}
    rows = (name.partition(":")[0] for name in errors.coordinates)
    lit = sorted({*_bodies_at(lines, marked), *_named(scene, model)})
    is_still = not errors.accelerations and acting is not None
    return scene_about(scene, lit), {
        **asdict(errors),
        "worst": len(scene.velocities[0]) if is_still else errors.worst,
        "acting": acting,
        "bodies": [carried.get(joints.index(name), -1) if name in joints else -1 for name in rows],
        "lit": lit,
        "lines": lines,
        "marked": marked,
        "text": text,
        "file": _path_of(case),
    }


def _path_of(case: Case) -> str:
    """Return the absolute path of a case's file, for a link to an editor."""
    folder = Path(case.folder)
    return str((folder if folder.name == case.model else folder / case.model).absolute())


def _bodies_at(lines: Sequence[Spans], marked: Iterable[int]) -> Iterator[int]:
    for line in marked:
        for body, spans in enumerate(lines):
            if any(first <= line <= last for first, last in spans):
                yield body


def _named(scene: Scene, model: Model | None) -> Iterator[int]:
    """Yield bodies by the joints and bodies that an explaining cause names."""
    diagnosis = None if model is None else model.diagnosis
    if diagnosis is None or not diagnosis.explained:
        return
    causes = (cause for one in diagnosis.explanations[:1] for cause in one.causes)
    names = {name.partition("@")[0] for cause in causes for name in cause.subject}
    for i, body in enumerate(scene.bodies):
        joint = scene.joints[body.joint].name if body.joint >= 0 else ""
        if body.name in names or joint in names:
            yield i
