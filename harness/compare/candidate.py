"""One of the two models: its file, its engine, and what had to be assumed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from harness.engines.protocol import Engine, Model
from harness.engines.registry import engines, readers
from harness.files.model_files import check_springs
from harness.files.parts import PartError, check_parts
from harness.files.sidecar import Sidecar, read_sidecar


class CompareError(ValueError):
    """Wrong usage: no such file, an engine that can't read it, joints without a match."""


class NotInstalledError(RuntimeError):
    """The engine that a comparison needs is not installed."""


@dataclass(frozen=True)
class Candidate:
    """A model file in an engine.

    Attributes:
        label: "A" or "B".
        sidecar: that beside the file, or one with what had to be assumed.
        engine: name of the engine that runs it.
        notes: what was assumed, a sentence each.
    """

    label: str
    sidecar: Sidecar
    engine: str
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """How messages call it."""
        return f"{self.sidecar.model} [{self.engine}]"

    def load(self) -> Model:
        """Load the model; in some engines this ends the one before it.

        Raises:
            EngineError: naming file, place and remedy.
        """
        return engines()[self.engine].load(self.sidecar.spec(self.engine))

    def at(self, **settings: object) -> Candidate:
        """The same with other settings."""
        own = {**self.sidecar.engine_settings.get(self.engine, {}), **settings}
        changed = {**self.sidecar.engine_settings, self.engine: own}
        return replace(self, sidecar=replace(self.sidecar, engine_settings=changed))


@dataclass(frozen=True)
class Facts:
    """What a loaded model says of itself; `gravity` is empty where it doesn't say."""

    coordinates: tuple[str, ...]
    integrator: str
    step: float
    gravity: tuple[float, ...]


def facts(candidate: Candidate) -> Facts:
    """Load a model and ask it.

    Raises:
        EngineError: naming file, place and remedy.
    """
    model = candidate.load()
    return Facts(tuple(model.coordinates), model.integrator, model.step, model.gravity)


def candidate(label: str, path: Path, engine: str | None) -> Candidate:
    """The model at `path`, in the engine asked for, or in the one that fits its format.

    Raises:
        CompareError: naming what is wrong with the path or the engine, and the remedy.
        NotInstalledError: where no engine that would do is installed.
        SidecarError: for a sidecar that can't be read.
    """
    if not path.is_file():
        raise CompareError(f"{path}: there is no such file")
    beside = Path(f"{path}.toml")
    try:
        check_parts(path)
    except PartError as error:
        raise CompareError(str(error)) from None
    sidecar = read_sidecar(beside) if beside.exists() else None
    name = _engine(label, path, engine, sidecar)
    found = engines()[name]
    if sidecar is not None:
        check_springs(sidecar, found)
    own = found.caveats(path)
    if sidecar is None:
        bare, notes = _bare(path, found)
        return Candidate(label, bare, name, (*notes, *own))
    return Candidate(label, sidecar, name, own)


def _engine(label: str, path: Path, asked: str | None, sidecar: Sidecar | None) -> str:
    known = engines()
    if asked is not None:
        if asked not in known:
            names = ", ".join(sorted(known))
            raise CompareError(f"no engine {asked!r} is known; known are {names}")
        if path.suffix not in known[asked].formats:
            reads = ", ".join(known[asked].formats)
            raise CompareError(
                f"{path}: {asked} reads {reads} files alone; choose another with"
                f" --engine-{label.lower()}"
            )
        wanted = [asked]
    else:
        declared = () if sidecar is None else sidecar.engines
        wanted = [name for name in declared if _reads(known, name, path)] or [
            engine.name for engine in readers(path.suffix)
        ]
        if not wanted:
            formats = sorted({suffix for engine in known.values() for suffix in engine.formats})
            raise CompareError(f"{path}: no engine reads it; they read {', '.join(formats)} files")
    for name in wanted:
        if known[name].version() is not None:
            return name
    names = " or ".join(wanted)
    raise NotInstalledError(f"{path}: {names} would run it and is not installed (pip install)")


def _reads(known: dict[str, Engine], name: str, path: Path) -> bool:
    return name in known and path.suffix in known[name].formats


def _bare(path: Path, engine: Engine) -> tuple[Sidecar, tuple[str, ...]]:
    """A sidecar for a file without one: what its format can't say, at stated values."""
    settings = dict(engine.settings_for(path.suffix))
    sidecar = Sidecar(
        model=path,
        engines=(engine.name,),
        settings=settings,
        engine_settings={},
        coordinates={},
        readback={},
        springs=(),
    )
    assumed = [_spoken(key, value) for key, value in sorted(settings.items())]
    if not assumed:
        return sidecar, ()
    note = f"{path.name} has no sidecar: {' and '.join(assumed)}"
    if len(assumed) == 1:
        return sidecar, (f"{note} is assumed",)
    note += f" are assumed; state others in {path.name}.toml, [settings]"
    return sidecar, (note,)


def _spoken(key: str, value: object) -> str:
    if key == "step":
        return f"a step of {value:g} s"
    shown = f"({', '.join(f'{x:g}' for x in value)})" if isinstance(value, list) else str(value)
    return f"{key} {shown}"
