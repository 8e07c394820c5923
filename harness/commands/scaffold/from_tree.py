"""Create a system folder from a robot's bodies: write it, compare it, run it in every engine."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import format_omission, settings_of
from physics_crosscheck.harness.checks.prepare import prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.scaffold.assets import MEANT
from physics_crosscheck.harness.commands.scaffold.folder import NewError, write_folder
from physics_crosscheck.harness.commands.scaffold.places import places
from physics_crosscheck.harness.commands.scaffold.tree_text import tree_sidecar, tree_text
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.reading import read_regular
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.engines.registry import default_engines
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.parts import PartError, check_parts, parts
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot import BodyModel, Robot
from physics_crosscheck.harness.modelfiles.robot_system import summary
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem
from physics_crosscheck.reference.solving.integrate import ReferenceError

CHECKED = 8
"""Number of states for comparing engines with the folder; most numbers have an effect in each."""

NAMED = 3
"""Maximum number of files to name among those that are not copied."""


class _OtherBodiesError(Exception):
    """The copy of a file gives other bodies than the file, for example without a mesh."""


def from_tree(robot: Robot, data: bytes, target: Path, settings: list[str]) -> tuple[str, ...]:
    """Write the folder of a robot that has a tree, and return remarks to print.

    Args:
        robot: the robot.
        data: the file's content.
        target: the folder to write.
        settings: lines of a sidecar for a format that states no time step and no gravity.

    Raises:
        NewError: naming the problem; nothing is written then.
    """
    model, body_model = robot.file, robot.body_model
    assert body_model is not None  # the caller checks that it has a tree
    parts = included(model)
    where = places([model, *(model.parent / name for name in parts)])
    compiled = next(
        (e.title for e in default_engines(model.suffix) if model.suffix in e.compiles), ""
    )
    text = tree_text(target.name, summary(robot), model.name, body_model, where, compiled)
    sidecar, able = f"{model.name}.toml", default_engines(model.suffix)
    files = {model.name: data, **parts, "system.py": text.encode()}
    files |= {sidecar: _sidecar(robot, able, {}, settings)}
    remarks: list[str] = []

    def check(folder: Path) -> None:
        _check_reading(folder, robot)
        left_out, engine_remarks = _run(folder, robot, target)
        chosen = [one for one in able if one.name not in left_out]
        # If no engine runs it, a run must report each of them.
        (folder / sidecar).write_bytes(_sidecar(robot, chosen or able, left_out, settings))
        remarks.extend(engine_remarks)

    others = besides(model)
    copied = called(others, robot.shapes)
    try:
        write_folder(target, {**contents(model, copied), **files}, check)
    except _OtherBodiesError:  # the engine needs a value that the file does not state
        copied = others
        try:
            write_folder(target, {**contents(model, copied), **files}, check)
        except _OtherBodiesError as error:
            raise NewError(
                f"{model}: its copy in a folder reads as a different robot: {error}"
            ) from None
    if unused := [path.name for path in others if path not in copied]:
        remarks.append(f"not copied, because no inertia depends on it: {_listed(unused)}")
    if robot.left_out:
        remarks.append(f"left out: {', '.join(format_omission(one) for one in robot.left_out)}")
    return tuple(remarks)


def _listed(names: Sequence[str]) -> str:
    """Return a list of names such as: 'a.stl', 'b.stl', 'c.stl' and 5 more."""
    more = len(names) - NAMED
    return ", ".join(map(quote, names[:NAMED])) + (f" and {more} more" if more > 0 else "")


def _sidecar(
    robot: Robot, chosen: Sequence[Engine], left_out: Mapping[str, str], settings: Sequence[str]
) -> bytes:
    own_settings = settings_of(robot)
    return tree_sidecar(robot.file.name, chosen, left_out, settings, own_settings).encode()


def _check_reading(folder: Path, robot: Robot) -> None:
    """Compare the declaration and the copy of the file with the robot that was read.

    Raises:
        _OtherBodiesError: if the copy differs.
        NewError: if the declaration differs.
    """
    chosen = str(robot.stated.get("model", ""))
    again = read_robot(folder / robot.file.name, floating=robot.floats, model=chosen)
    if again.body_model != robot.body_model:
        raise _OtherBodiesError(
            "; ".join(one.sentence for one in again.obstacles) or "it lacks a part"
        )
    system = load_declaration(folder)
    assert isinstance(system, MultibodySystem)
    written = BodyModel(
        bodies=system.bodies,
        gravity=system.gravity,
        pulls=system.pulls,
        couplings=system.couplings,
        fluid=system.fluid,
    )
    if written != robot.body_model:
        raise NewError(f"{robot.file}: the files written differ from the robot read")


def _run(folder: Path, robot: Robot, target: Path) -> tuple[dict[str, str], list[str]]:
    """Return the engines that can't run the file with reasons, and remarks about engines.

    Raises:
        NewError: if the bodies can't be solved.
    """
    able = [one for one in default_engines(robot.file.suffix) if one.version() is not None]
    if not able:
        return {}, ["no engine that runs it is installed, so the new folder is not checked"]
    sidecar = read_sidecar(folder / f"{robot.file.name}.toml")
    try:
        prepared = prepare(folder, states=CHECKED)
    except ReferenceError as error:
        why = str(error).removeprefix(f"{folder / 'system.py'}: ")
        raise NewError(f"{robot.file}: {why}") from None
    left_out: dict[str, str] = {}
    remarks: list[str] = []
    with Workers(1) as workers:
        for engine in able:
            task = model_task(prepared, engine.name, sidecar)
            case = workers.outcome(workers.submit(run_case, task))
            if isinstance(case, Failure):
                why = left_out[engine.name] = _plain(case.reason, folder, target)
                remarks.append(f"{engine.name} is left out: {why}")
            elif case.outcome is not Outcome.AGREES:
                remarks.append(f"{engine.name} {case.outcome}: {case.reason}")
    return left_out, remarks


def _plain(message: str, folder: Path, target: Path) -> str:
    return " ".join(message.replace(str(folder), str(target)).split())


def included(model: Path) -> dict[str, bytes]:
    """Return relative path -> content of the models that a model file includes, at any depth.

    Raises:
        NewError: if a model is unsafe to copy or not below the model's folder.
    """
    try:
        check_parts(model)
    except PartError as error:
        raise NewError(str(error)) from None
    return dict(_read(model, [path for path, part in parts(model).items() if part], strict=True))


def besides(model: Path) -> list[Path]:
    """Return all other existing files that it names: meshes, height fields, textures."""
    return [path for path, part in parts(model).items() if not part]


def called(paths: Iterable[Path], names: Iterable[str]) -> list[Path]:
    """Return the files that match names, in any folder that engines search."""
    ends = [PurePosixPath(name).parts for name in names]
    # Some engines strip folders from a path (`strippath`), so compare the last parts.
    exact = [path for path in paths if any(path.parts[-len(end) :] == end for end in ends)]
    last = {end[-1] for end in ends} - {path.name for path in exact}
    return [path for path in paths if path in exact or path.name in last]


def contents(model: Path, paths: Iterable[Path]) -> dict[str, bytes]:
    """Return relative path -> content of files that a model file names, within its folder only.

    Raises:
        NewError: if a file can't be read.
    """
    return dict(_read(model, paths, strict=False))


def _read(model: Path, paths: Iterable[Path], *, strict: bool) -> Iterator[tuple[str, bytes]]:
    for path in paths:
        within = _below(path, model.parent)
        if within is None or within.suffix in MEANT:
            if strict:
                why = (
                    (f"a system folder runs or reads files that end with {path.suffix}: rename it")
                    if within is not None
                    else "which is not below its folder; copy it into the folder"
                )
                raise NewError(f"{model}: it needs {path}, {why}")
            continue
        try:
            yield str(within), read_regular(path)
        except OSError as error:
            raise NewError(f"{model}: it needs {path}: {error.strerror}") from None


def _below(path: Path, folder: Path) -> PurePosixPath | None:
    """Return a path relative to a folder; None if it is outside."""
    try:
        within = PurePosixPath(path.relative_to(folder).as_posix())
    except ValueError:
        return None
    return None if ".." in within.parts else within
