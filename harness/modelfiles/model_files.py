"""The model files of a system folder, each with its sidecar."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.engines.registry import (
    absent_extras,
    default_engines,
    engines,
    engines_reading,
    engines_to_run,
    model_formats,
)
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import odd_name, visible
from .folders import FolderError
from .locations import line_of
from .parts import included
from .sidecar import Sidecar, SidecarError, drop_absent_models, read_sidecar


@dataclass(frozen=True, kw_only=True)
class UnreadModel:
    """A model file that can't run because of its sidecar.

    Attributes:
        model: its name; `-` for a folder without model files.
        reason: one sentence.
    """

    model: str
    reason: str


def model_files(folder: Path) -> Iterator[Sidecar | UnreadModel]:
    """Yield every model file's sidecar, or an `UnreadModel` if it is invalid or missing.

    A file that a model with a sidecar includes is a part of it, not a separate model.
    """
    described: set[str] = set()
    within: set[Path] = set()
    results: list[Sidecar | UnreadModel] = []
    for path in sorted(folder.glob("*.toml")):
        name = path.with_suffix("").name
        described.add(name)
        within |= included(folder / name)
        if (why := odd_name(name)) is not None:
            results.append(UnreadModel(model=visible(name), reason=_renamed(path, why)))
            continue
        try:
            sidecar = read_sidecar(path)
            by_name = engines() if sidecar.springs else {}
            for engine in filter(None, map(by_name.get, sidecar.engines)):
                check_springs(sidecar, engine)
            results.append(sidecar)
        except SidecarError as error:
            results.append(UnreadModel(model=name, reason=str(error)))
    kept = iter(drop_absent_models(one for one in results if isinstance(one, Sidecar)))
    yield from (next(kept) if isinstance(one, Sidecar) else one for one in results)
    formats = model_formats()
    for path in sorted(folder.iterdir()):
        if path.suffix in formats and path.name not in described and path not in within:
            if (why := odd_name(path.name)) is not None:
                yield UnreadModel(model=visible(path.name), reason=_renamed(path, why))
                continue
            reason = (
                f"{path}: this model file has no sidecar; write {path.name}.toml "
                "with at least engines = "
                f"{json.dumps([e.name for e in default_engines(path.suffix)])} (or other "
                "engines)"
            )
            yield UnreadModel(model=path.name, reason=reason)
    if not described:
        reason = f"{folder}: no model file has a sidecar, so nothing ran; add one"
        yield UnreadModel(model="-", reason=reason)


def only_model(folder: Path) -> Path:
    """Return the only model file of a system folder.

    Raises:
        FolderError: if the folder has no model file, or several.
    """
    names = [Path(one.model).name for one in model_files(folder) if one.model != "-"]
    if len(names) == 1:
        return folder / names[0]
    raise FolderError(
        f"{visible(str(folder))} is a folder; name a model file in it: {', '.join(names) or 'none'}"
    )


def absent_engine_lines(folders: Iterable[Path]) -> list[str]:
    """Return lines about engines of extras that sidecars name and that are not installed."""
    files = [one for folder in folders for one in model_files(folder)]
    named = Counter(name for one in files if isinstance(one, Sidecar) for name in one.absent)
    ways = absent_extras() if named else {}
    return [
        f"{ways[name]} ({counted(count, 'model file')} could run in it too)"
        for name, count in sorted(named.items())
    ]


def unread_lines(robots: Iterable[Path], only: Sequence[str]) -> Iterator[str]:
    """Yield a line for each robot file that none of the wanted engines reads."""
    formats = [f"{name} reads only {', '.join(engines()[name].formats)} files" for name in only]
    for file in robots:
        if only and not chosen_engines(file, only):
            yield f"{visible(str(file))} was not judged: {'; '.join(formats)}"


def _renamed(path: Path, why: str) -> str:
    return f"{visible(str(path))}: its name has {why}; rename it"


def check_springs(sidecar: Sidecar, engine: Engine) -> None:
    """Refuse springs that an engine would ignore.

    Raises:
        SidecarError: for springs of a format that can state them itself.
    """
    if sidecar.springs and sidecar.model.suffix not in engine.takes_springs:
        line = line_of(Path(f"{sidecar.model}.toml"), "spring")
        where = f"{sidecar.model}.toml" + ("" if line is None else f":{line}")
        raise SidecarError(
            f"{where}: [[spring]]: {engine.title} takes no springs from the sidecar "
            f"of a {sidecar.model.suffix} file; write them into "
            f"{sidecar.model.name} itself"
        )


def model_path(model: Sidecar | Path) -> Path:
    """Return the file of a model: of a system folder by its sidecar, or a robot file."""
    return model.model if isinstance(model, Sidecar) else model


def chosen_engines(model: Sidecar | Path, only: Sequence[str]) -> list[str]:
    """Return the engines of a model that are wanted.

    Args:
        model: its sidecar, which names engines; or a robot file, which all its readers run.
        only: wanted engines; empty: all, without those that run a robot file on request only.
    """
    if isinstance(model, Sidecar):
        names: Sequence[str] = model.engines
    else:
        names = [one.name for one in (engines_reading if only else engines_to_run)(model.suffix)]
    return [name for name in names if not only or name in only]
