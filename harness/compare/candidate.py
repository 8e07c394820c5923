"""One of the two models: its file, its engine, and what had to be assumed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from harness.engines.protocol import Array, Engine, EngineError, Model
from harness.engines.registry import engines
from harness.engines.urdf import read_urdf
from harness.files.sidecar import Sidecar, read_sidecar

STEP = 0.002
GRAVITY = [0.0, 0.0, -9.81]
"""What a URDF without a sidecar runs with: it can say neither. MuJoCo's own are the same."""

PREFERRED = {".urdf": ("pybullet", "mujoco")}
"""Which installed engine runs a format that several read, unless a sidecar or the user says."""


PRODUCTS = ("ixy", "ixz", "iyz")
"""Products of inertia in a URDF. Bullet turns them into principal axes by an iteration that stops
short: against the file's own numbers, 16 random links were up to 6e-11 off, a chain's accelerations
up to 3e-9. MuJoCo is exact to rounding."""


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
        """Load the model; in PyBullet this ends the one before it.

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
    gravity = tuple(float(g) for g in getattr(model, "gravity", ()))
    return Facts(tuple(model.coordinates), model.integrator, model.step, gravity)


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
    sidecar = read_sidecar(beside) if beside.is_file() else None
    name = _engine(label, path, engine, sidecar)
    own = _quirks(path, name)
    if sidecar is None:
        bare, notes = _bare(path, name)
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
        wanted = [name for name in declared if _reads(known, name, path)] or _readers(known, path)
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


def _readers(known: dict[str, Engine], path: Path) -> list[str]:
    order = PREFERRED.get(path.suffix, ())
    names = [name for name, engine in known.items() if path.suffix in engine.formats]
    return sorted(names, key=lambda name: order.index(name) if name in order else len(order))


def _bare(path: Path, engine: str) -> tuple[Sidecar, tuple[str, ...]]:
    """A sidecar for a file without one: what its format can't say, at stated values."""
    settings: dict[str, object] = {}
    notes: tuple[str, ...] = ()
    if path.suffix == ".urdf":
        settings = {"step": STEP, "gravity": list(GRAVITY)}
        notes = (
            f"{path.name} has no sidecar: gravity (0, 0, -9.81) and a step of {STEP:g} s are"
            f" assumed; state others in {path.name}.toml, [settings]",
        )
    elif path.suffix == ".py":
        settings = {"step": STEP}
        notes = (f"{path.name} has no sidecar: a step of {STEP:g} s is assumed",)
    return Sidecar(path, (engine,), settings, {}, {}, {}, ()), notes


def _quirks(path: Path, engine: str) -> tuple[str, ...]:
    """What an engine is known to lose of a file's digits."""
    if engine != "pybullet":
        return ()
    try:
        robot = read_urdf(path.read_text(encoding="utf-8"), path)
    except (OSError, UnicodeDecodeError, EngineError):
        return ()  # loading it will say so
    products = (inertia.get(key, "0") for inertia in robot.iter("inertia") for key in PRODUCTS)
    if not any(word.strip("+-0. \n\t") for word in products):
        return ()
    return (
        f"{path.name} has products of inertia, whose principal axes PyBullet finds to 1e-9 or so:"
        " a discrepancy of that size may be its own",
    )


def home(model: Model) -> Array:
    """Positions as the file draws the mechanism, (nz,)."""
    found = getattr(model, "home", None)
    return np.zeros(len(model.coordinates)) if found is None else np.asarray(found, dtype=float)


def reach(model: Model) -> Array:
    """Where positions may be drawn, (nz, 2)."""
    found = getattr(model, "reach", None)
    if found is None:
        return np.tile([-1.0, 1.0], (len(model.coordinates), 1))
    return np.asarray(found, dtype=float)
