"""The sidecar of a model file, `<model file>.toml`: information that the file can't state."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeGuard

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.errors import LocationError, quote
from physics_crosscheck.harness.documents.reading import (
    MAX_SIDECAR_BYTES,
    TomlError,
    read_regular,
    toml_document,
)
from physics_crosscheck.harness.documents.urdf import read_urdf
from physics_crosscheck.harness.engines.protocol import ModelSpec, Spring
from physics_crosscheck.harness.engines.registry import absent_extras
from physics_crosscheck.reference.mechanism.laws import SoftLaw, Softness
from .locations import line_of
from .parts import PartError, check_parts

_KEYS = {"engines", "settings", "coordinates", "readback", "spring", "bindings", "frames", "laws"}


class SidecarError(ValueError):
    """A sidecar that is missing, unreadable or inconsistent; names file, place and remedy."""

    kind = "sidecar"


@dataclass(frozen=True, kw_only=True)
class Sidecar:
    """The declarations of a sidecar.

    Attributes:
        model: path of the model file.
        engines: names of the engines that run it.
        absent: further engines that it names, of extras that are not installed: it runs without
            them, unless no other engine runs it.
        settings: step, gravity, integrator and the like, for every engine of the file.
        engine_settings: the same for one engine, `[settings.<engine>]`.
        coordinates: engine coordinate -> expression of the system's coordinates and constants;
            empty if joints have the names of coordinates.
        readback: coordinate -> expression of engine coordinates (and constants).
        springs: springs on linear combinations of joints.
        bindings: address of a literal -> its meaning, an expression of the system's constants.
            Addresses are those of `harness.modelfiles.locations`, in the model file; the prefix
            `sidecar:` stands for the sidecar itself.
        frames: the system's frames, and `world`, as `harness.modelfiles.frames` reads them.
        laws: interaction -> the soft law by which the engine realizes it; empty: it is rigid.
    """

    model: Path
    engines: tuple[str, ...]
    absent: tuple[str, ...] = ()
    settings: Mapping[str, object]
    engine_settings: Mapping[str, Mapping[str, object]]
    coordinates: Mapping[str, str]
    readback: Mapping[str, str]
    springs: tuple[Spring, ...]
    bindings: Mapping[str, str] = field(default_factory=dict)
    frames: Mapping[str, object] = field(default_factory=dict)
    laws: Mapping[str, SoftLaw] = field(default_factory=dict)

    def spec(self, engine: str) -> ModelSpec:
        """Return the spec for one engine's adapter, which contains nothing of the system."""
        settings = {**self.settings, **self.engine_settings.get(engine, {})}
        return ModelSpec(self.model, self.springs, settings)

    def entry(self, table: str, key: str) -> SidecarEntry:
        """Return a key in one of the sidecar's tables, for a message."""
        return SidecarEntry(Path(f"{self.model}.toml"), table, key)


def _stated_by(model: Path) -> Mapping[str, object]:
    """Return the setting of a URDF that is one free body, as if it were run alone."""
    with suppress(LocationError):  # the engine reports it
        if model.suffix == ".urdf" and read_urdf(Document(model)).is_free_body:
            return {"floating": True}
    return {}


def read_sidecar(path: Path) -> Sidecar:
    """Read `<model file>.toml`.

    Raises:
        SidecarError: naming file, key and remedy.
    """
    data = _document(path)
    unknown = sorted(set(data) - _KEYS)
    if unknown:
        keys = ", ".join(sorted(_KEYS))
        raise SidecarError(f"{path}: unknown key {quote(unknown[0])}; known keys: {keys}")
    model = path.with_suffix("")
    if not model.exists():
        raise SidecarError(f"{path}: there is no model file {model.name} in its folder")
    try:
        check_parts(model)
    except PartError as error:
        raise SidecarError(str(error)) from None
    engines = data.get("engines")
    if not isinstance(engines, list) or not engines or not all(isinstance(e, str) for e in engines):
        raise SidecarError(f'{path}: engines must list engine names, as in engines = ["NAME"]')
    twice = [name for name in engines if engines.count(name) > 1]
    if twice:
        raise SidecarError(f"{path}: engines lists {quote(twice[0])} twice; keep one")
    settings = _table(data, "settings", path)
    by_engine = {name: value for name, value in settings.items() if isinstance(value, dict)}
    shared = {name: value for name, value in settings.items() if name not in by_engine}
    shared = {**_stated_by(model), **shared}
    for name, values in (
        ("settings", shared),
        *((f"settings.{e}", s) for e, s in by_engine.items()),
    ):
        _check_settings(values, f"{path}: [{name}]")
    for name in by_engine:
        if name not in engines:
            where = f"{path}: [settings] {quote(name)}"
            raise SidecarError(f"{where} is for an engine that `engines` does not list")
    springs = data.get("spring", [])
    if not isinstance(springs, list):
        raise SidecarError(f"{path}: write each spring as a table of an array: [[spring]]")
    absent = _absent(engines)
    return Sidecar(
        model=model,
        engines=tuple(name for name in engines if name not in absent),
        absent=tuple(absent),
        settings=shared,
        engine_settings=by_engine,
        coordinates=_expressions(data, "coordinates", path),
        readback=_expressions(data, "readback", path),
        springs=tuple(_spring(s, f"{path}: [[spring]] {i + 1}") for i, s in enumerate(springs)),
        bindings=_expressions(data, "bindings", path),
        frames=_table(data, "frames", path),
        laws={
            name: _law(entry, f"{path}: [laws] {quote(name)}")
            for name, entry in _table(data, "laws", path).items()
        },
    )


def drop_absent_models(sidecars: Iterable[Sidecar]) -> list[Sidecar]:
    """Return the sidecars of one folder, without engines for those whose engines are all absent
    extras.

    If that applies to all of them, return them unchanged.
    """
    models, missing = list(sidecars), absent_extras()
    if all(missing.keys() >= set(one.engines) for one in models):
        return models
    return [
        replace(one, engines=(), absent=(*one.engines, *one.absent))
        if missing.keys() >= set(one.engines)
        else one
        for one in models
    ]


def _absent(engines: list[str]) -> list[str]:
    """Return engines of extras that are not installed, if other engines remain."""
    missing = absent_extras()
    absent = [name for name in engines if name in missing]
    return absent if len(absent) < len(engines) else []


def _document(path: Path) -> dict[str, Any]:
    try:
        return toml_document(read_regular(path, MAX_SIDECAR_BYTES).decode("utf-8"))
    except OSError as error:
        raise SidecarError(f"{path}: can't be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise SidecarError(
            f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8"
        ) from None
    except TomlError as error:
        raise SidecarError(f"{path}{error}") from None


def _table(data: Mapping[str, object], key: str, path: Path) -> dict[str, object]:
    value = data.get(key, {})
    if not isinstance(value, dict):
        raise SidecarError(f"{path}: {key} must be a table: [{key}]")
    return value


def _expressions(data: Mapping[str, object], key: str, path: Path) -> dict[str, str]:
    table = _table(data, key, path)
    for name, value in table.items():
        if not isinstance(value, (str, int, float)) or isinstance(value, bool):
            raise SidecarError(
                f"{path}: [{key}] {quote(name)} must be an expression, such as 'x / r'"
            )
    return {name: str(value) for name, value in table.items()}


def _check_settings(values: Mapping[str, object], place: str) -> None:
    step = values.get("step", 1.0)
    if not _is_number(step) or not 0 < step < math.inf:
        raise SidecarError(f"{place} step is {quote(step)}; expected a positive number of seconds")
    gravity = values.get("gravity", [0, 0, 0])
    if not isinstance(gravity, list) or len(gravity) != 3 or not all(map(_is_number, gravity)):
        raise SidecarError(f"{place} gravity is {quote(gravity)}; expected three numbers")


_LAW_LENGTHS = {"reference": 2, "impedance": 5}


def _law(data: object, place: str) -> SoftLaw:
    """Read a soft law: `reference` and `impedance`, and the numbers that have defaults."""
    further = {"friction_ratio", "points", "weight"}
    if not isinstance(data, dict) or not set(_LAW_LENGTHS) <= set(data) <= further | set(
        _LAW_LENGTHS
    ):
        wanted = ", ".join(_LAW_LENGTHS)
        raise SidecarError(f"{place} needs {wanted}, and may have {', '.join(sorted(further))}")
    for key, length in _LAW_LENGTHS.items():
        values = data[key]
        if (
            not isinstance(values, list)
            or len(values) != length
            or not all(map(_is_number, values))
        ):
            raise SidecarError(f"{place} {key} must be {length} numbers")
    for key in further & set(data):
        if not _is_number(data[key]) or not data[key] > 0:
            raise SidecarError(f"{place} {key} must be a positive number")
    softness = Softness(reference=tuple(data["reference"]), impedance=tuple(data["impedance"]))
    return SoftLaw(softness=softness, **{key: data[key] for key in further & set(data)})


def _spring(data: object, place: str) -> Spring:
    wanted = {"joints", "stiffness", "damping", "rest"}
    if not isinstance(data, dict) or set(data) != wanted:
        raise SidecarError(f"{place} must have each of {', '.join(sorted(wanted))}")
    joints = data["joints"]
    if not isinstance(joints, dict) or not joints or not all(map(_is_number, joints.values())):
        raise SidecarError(f"{place} joints must map joint names to coefficients")
    for key in ("stiffness", "damping", "rest"):
        if not _is_number(data[key]):
            raise SidecarError(f"{place} {key} is {quote(data[key])}; expected a number")
    return Spring(joints, data["stiffness"], data["damping"], data["rest"])


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True)
class SidecarEntry:
    """A key in a table of a sidecar; as text, `FILE:LINE: [table] 'key'`, looked up when shown."""

    file: Path
    table: str
    key: str

    def __str__(self) -> str:
        line = line_of(self.file, f"{self.table}.{json.dumps(self.key, ensure_ascii=False)}")
        where = self.file if line is None else f"{self.file}:{line}"
        return f"{where}: [{self.table}] {quote(self.key)}"
