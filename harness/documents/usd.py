"""USD stages: composed values with the layer, prim and line that state them, and edits as overlays.

Layers are checked before a stage is opened: nothing is fetched, and no layer is outside of the
asset's folder unless that is allowed.
"""

from __future__ import annotations

import math
import os
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import Array, Place
from .elements import Number
from .errors import LocationError, ReadError, ReadKind, RefusedFileError, quote, truncate
from .reading import MAX_MODEL_BYTES, SourceFile, read_regular

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
"""Suffixes of USD files."""

STAGE_SETTINGS = ("variants", "allow_outside")
"""Settings of engines with which a stage is opened, as of `UsdStage`."""

VARIANTS, OUTSIDE = "CROSSCHECK_USD_VARIANTS", "CROSSCHECK_USD_OUTSIDE"
"""Environment variables with these settings: `SET=NAME` for each variant, and `1`."""

MAX_LAYERS = 500
"""The most layers of a stage."""

EARTH = 9.81
"""Gravity of a scene that states none, m/s^2."""

CRATE, PACKAGE = b"PXR-USDC", b"PK\x03\x04"
"""First bytes of a binary layer and of a package, which have no lines."""

USD_HEAD = rb"\A(PXR-USDC|PK\x03\x04|#usda(?s:.*)(\"Physics\w+API\b|\bPhysics\w*Joint\b|@))"
"""Content of a layer or a package that may be a robot's: text with physics, or of other layers."""

_PHYSICAL = re.compile(
    r"(physics|newton|mjc|physx\w*|drive|limit|state|xformOp):.+|size|radius|height"
)
"""Names of attributes with numbers of a mechanism."""

_TOKEN = re.compile(
    rb'"""(?:[^\\]|\\.)*?"""|\'\'\'(?:[^\\]|\\.)*?\'\'\'|#[^\n]*|@@@.*?@@@|@[^@\n]*@'
    rb'|\b(?:def|over|class)\b[^"{(\n]*"(?P<prim>[^"\n]+)"'
    rb'|\bvariantSet\s+"(?P<set>[^"\n]+)"\s*=|"(?P<text>(?:[^"\\\n]|\\.)*)"|\'(?:[^\'\\\n]|\\.)*\''
    rb"|(?P<bracket>[{}()\[\]])"
    rb"|(?P<property>[A-Za-z_][\w:.]*)(?=[ \t]*(?:=|\(|\r?$))",
    re.DOTALL | re.MULTILINE,
)
_SYNTAX = re.compile(r"(?P<file>[^\n]+?):(?P<line>\d+):\d+: (?P<sentence>.*)", re.DOTALL)

MAX_PRIMS = 1_000_000
"""The most prims of a stage."""

_LENGTHS = {"localPos": 3, "localRot": 4, "principalAxes": 4, "centerOfMass": 3, "inertia": 6,
            "diagonalInertia": 3, "gravityDirection": 3}  # fmt: skip
"""Numbers in a value, by the end of its name; others are one number or a truth value."""

_WORDS = {"axis": ("X", "Y", "Z"), "type": ("force", "acceleration")}
"""Words that a value may be, by the end of its name."""

_UNBOUNDED = re.compile(r"\w*(Limit|low|high|maxForce|velocityLimit|centerOfMass|gravityMagnitude)")
"""Ends of names of values that may be infinite."""


def import_usd(file: Path) -> Any:
    """Return the package `pxr` with its modules.

    Raises:
        LocationError: if no package of OpenUSD is installed.
    """
    try:
        import pxr
        from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdUtils  # noqa: F401
    except ImportError:
        error = LocationError("reading USD needs usd-core, which is not installed", file=file)
        raise error.with_remedy("pip install 'physics-crosscheck[usd]'") from None
    return pxr


@dataclass(frozen=True, kw_only=True)
class UsdPlace:
    """The place of a value.

    Attributes:
        file: the layer with the strongest opinion; the root layer for a fallback.
        line: of the layer, from 1; None in a binary one, and for a fallback.
        address: the prim's path and the property.
    """

    file: Path
    line: int | None
    address: str


class UsdStage:
    """A composed stage, and the problems found in it.

    Args:
        path: of the root layer.
        variants: selected variants by the name of their set, in place of those of the file.
        allow_outside: whether layers may be outside of the root layer's folder.

    Attributes:
        stage: of OpenUSD.
        unit, mass_unit: m and kg per unit.
        up: index of the up axis.
        prims: all of them, with those of instances.
        obstacles: problems so far.

    Raises:
        LocationError: for a file that can't be read, naming layer and line.
    """

    def __init__(
        self, path: Path, variants: Mapping[str, str] | None = None, *, allow_outside: bool = False
    ) -> None:
        pxr = self.pxr = import_usd(path)
        self.path, self.obstacles = path, list[ReadError]()
        self._changed: dict[tuple[str, str], Any] = {}
        self._wrong = set[tuple[str, str]]()
        self._lines: dict[str, Mapping[str, int]] = {}
        # Held while it opens, so that warnings stay off the screen.
        delegate = pxr.UsdUtils.CoalescingDiagnosticDelegate()
        try:
            root = checked_root(path, allow_outside=allow_outside)
            self._session = pxr.Sdf.Layer.CreateAnonymous(".usda")
            self.stage = pxr.Usd.Stage.Open(root, self._session)
            self.selection = self._select(variants or {})
            errors = self.stage.GetCompositionErrors()
        except pxr.Tf.ErrorException as error:
            raise _unreadable(path, error) from None
        finally:
            delegate.TakeUncoalescedDiagnostics()
        if errors:
            raise LocationError(f"does not compose: {_one_line(errors[0])}", file=path)
        self.unit = float(pxr.UsdGeom.GetStageMetersPerUnit(self.stage))
        self.mass_unit = float(pxr.UsdPhysics.GetStageKilogramsPerUnit(self.stage))
        if not 0 < min(self.unit, self.mass_unit) <= max(self.unit, self.mass_unit) < math.inf:
            wrong = f"metersPerUnit is {self.unit:g}, and kilogramsPerUnit {self.mass_unit:g}"
            raise LocationError(wrong, file=path).with_remedy("write positive numbers")
        self.up = "XYZ".index(str(pxr.UsdGeom.GetStageUpAxis(self.stage)).upper())

    def _select(self, variants: Mapping[str, str]) -> tuple[str, ...]:
        """Select variants, and return the selection of all sets, such as `size=large`."""
        chosen: dict[str, None] = {}
        unused = dict(variants)
        for prim in self._traversed():
            sets = prim.GetVariantSets()
            for name in sets.GetNames():
                variant_set = sets.GetVariantSet(name)
                if name in variants:
                    names = variant_set.GetVariantNames()
                    if variants[name] not in names:
                        raise LocationError(
                            f"variant set {quote(name)} of {prim.GetPath()} has no variant"
                            f" {quote(variants[name])}; it has {', '.join(names)}",
                            file=self.path,
                        )
                    with self.pxr.Usd.EditContext(self.stage, self._session):
                        variant_set.SetVariantSelection(variants[name])
                    unused.pop(name, None)
                if selected := variant_set.GetVariantSelection():
                    chosen[f"{name}={selected}"] = None
        if unused:
            raise LocationError(
                f"it has no variant set {quote(next(iter(unused)))}", file=self.path
            )
        return tuple(chosen)

    def _traversed(self) -> list[Any]:
        usd = self.pxr.Usd
        root = self.stage.GetPseudoRoot()
        return list(usd.PrimRange(root, usd.TraverseInstanceProxies()))[1:]

    @cached_property
    def prims(self) -> tuple[Any, ...]:
        """All prims, depth first."""
        return tuple(self._traversed())

    @cached_property
    def _scene(self) -> Any:
        return next((one for one in self.prims if one.GetTypeName() == "PhysicsScene"), None)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Gravity of the first scene, m/s^2; along the up axis where it states no direction."""
        direction, size = np.zeros(3), EARTH
        if self._scene is not None:
            stated = self.value(self._scene, "physics:gravityDirection", (0.0, 0.0, 0.0))
            direction = np.array(stated, dtype=float)
            given = self.value(self._scene, "physics:gravityMagnitude", -1.0)
            size = EARTH if given < 0 else given * self.unit
        if not direction.any():
            direction = -np.eye(3)[self.up]
        x, y, z = (size * direction / np.linalg.norm(direction)).tolist()
        return x, y, z

    @property
    def settings(self) -> dict[str, object]:
        """Settings of engines that the file states: gravity, and the time step of its scene."""
        scene = self._scene
        names = ("newton:timeStepsPerSecond", "physxScene:timeStepsPerSecond")
        rates = [self.stated(scene, one) for one in names if scene is not None]
        rate = next(filter(None, rates), None)
        return {"gravity": list(self.gravity), **({"step": 1 / rate} if rate else {})}

    def add_problem(
        self, prim: Any, sentence: str, remedy: str, kind: ReadKind = "robot", name: str = ""
    ) -> None:
        """Add a problem of a prim, or of a property of it, that prevents building a tree."""
        place = self.place(prim, name)
        self.obstacles.append(
            ReadError(
                sentence=f"{place.address}: {sentence}",
                file=place.file,
                line=place.line or 0,
                remedy=remedy,
                kind=kind,
            )
        )

    def value(self, prim: Any, name: str, default: Any = None) -> Any:
        """Return the composed value of an attribute, or its fallback, or the default."""
        key = str(prim.GetPath()), name
        if key in self._changed:
            return self._changed[key]
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute else None
        return default if value is None else self._checked(prim, name, plain(value), default)

    def _checked(self, prim: Any, name: str, value: Any, default: Any) -> Any:
        """Return a value of the type that its name has, or add a problem and return the default."""
        last = name.rpartition(":")[2]
        words, numbers = _WORDS.get(last), value if isinstance(value, tuple) else (value,)
        if words is not None:
            wrong = "" if value in words else f"it is {quote(str(value))}, not {' or '.join(words)}"
        elif not _PHYSICAL.fullmatch(name) or name.startswith("xformOp"):
            return value
        elif not all(isinstance(one, (float, bool)) for one in numbers):
            wrong = f"it is a {type(value).__name__}, not a number"
        elif len(numbers) != _LENGTHS.get(last.rstrip("01"), 1) and last != "inertia":
            wrong = f"it has {len(numbers)} numbers"
        elif any(map(math.isnan, numbers)):
            wrong = "it is not a number"
        else:
            is_bounded = all(map(math.isfinite, numbers)) or _UNBOUNDED.fullmatch(last)
            wrong = "" if is_bounded else "it is infinite"
        if wrong and (str(prim.GetPath()), name) not in self._wrong:
            self._wrong.add((str(prim.GetPath()), name))
            self.add_problem(prim, wrong, "correct it", name=name)
        return default if wrong else value

    def stated(self, prim: Any, name: str) -> Any:
        """Return the value of an attribute if a layer states it; None otherwise."""
        attribute = prim.GetAttribute(name)
        return self.value(prim, name) if attribute and attribute.HasAuthoredValue() else None

    def targets(self, prim: Any, name: str) -> list[Any]:
        """Return the paths that a relationship names."""
        relationship = prim.GetRelationship(name)
        return list(relationship.GetForwardedTargets()) if relationship else []

    def body_of(self, prim: Any) -> Any:
        """Return the rigid body that a prim is, or is below of; None without one."""
        while prim and "PhysicsRigidBodyAPI" not in prim.GetAppliedSchemas():
            prim = prim.GetParent()
        return prim or None

    def place(self, prim: Any, name: str = "") -> UsdPlace:
        """Return the place of a property's strongest opinion; without a name that of the prim."""
        address = f"{prim.GetPath()}.{name}" if name else str(prim.GetPath())
        member = prim.GetProperty(name) if name else prim
        stack = (member.GetPropertyStack() if name else member.GetPrimStack()) if member else ()
        for spec in stack:
            line = self._layer_lines(spec.layer).get(str(spec.path))
            return UsdPlace(file=self._layer_path(spec.layer), line=line, address=address)
        return UsdPlace(file=self.path, line=None, address=address)

    def _layer_path(self, layer: Any) -> Path:
        """Return the path of a layer, relative to the root layer's folder as the user names it."""
        if layer == self.stage.GetRootLayer() or not layer.realPath:
            return self.path
        above: str = os.path.dirname(self.stage.GetRootLayer().realPath)
        return Path(self.path.parent, os.path.relpath(layer.realPath, above))

    def _layer_lines(self, layer: Any) -> Mapping[str, int]:
        key = layer.identifier
        if key not in self._lines:
            self._lines[key] = layer_lines(Path(layer.realPath)) if layer.realPath else {}
        return self._lines[key]

    def world(self, prim: Any) -> tuple[Place, Array]:
        """Return the pose of a prim in the world, m, and the scale of its axes, (3,)."""
        matrix = np.array(self._frames.GetLocalToWorldTransform(prim), dtype=float).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        if np.linalg.det(matrix[:3, :3]) < 0:
            scale = -scale
        rotation = matrix[:3, :3] / np.where(scale, scale, 1.0)
        return Place(rotation, matrix[:3, 3] * self.unit), scale

    @cached_property
    def _frames(self) -> Any:
        return self.pxr.UsdGeom.XformCache()

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """All numbers of a mechanism that layers state, in the order of the prims."""
        return tuple(number for prim in self.prims for number in self._numbers_of(prim))

    def _numbers_of(self, prim: Any) -> Iterator[Number]:
        for attribute in prim.GetAuthoredAttributes():
            name = attribute.GetName()
            values = _words(attribute.Get()) if _PHYSICAL.fullmatch(name) else ()
            if not values:
                continue
            place = self.place(prim, name)
            largest = max(abs(one) for one in values)
            for word, value in enumerate(values):
                yield Number(
                    file=place.file,
                    text=_shortest(attribute, value),
                    line=place.line,
                    address=place.address + (f"[{word}]" if len(values) > 1 else ""),
                    path=f"{prim.GetTypeName()}@{name}",
                    scale=largest,
                    key=name,
                    word=word,
                )

    def changed_values(self, values: Mapping[Number, float]) -> dict[tuple[str, str], Any]:
        """Return the values of attributes with other values of some numbers, by prim and name."""
        result: dict[tuple[str, str], Any] = {}
        for number, value in values.items():
            prim_path = number.address.partition(".")[0]
            key = prim_path, number.key
            if key not in result:
                result[key] = self.value(self.stage.GetPrimAtPath(prim_path), number.key)
            whole = result[key]
            result[key] = (
                (*whole[: number.word], value, *whole[number.word + 1 :])
                if isinstance(whole, tuple)
                else value
            )
        return result

    def change(self, values: Mapping[tuple[str, str], Any]) -> None:
        """Set values of attributes, by prim and name, until the next call."""
        placed = any(name.startswith("xformOp") for _, name in (*self._changed, *values))
        self._changed = dict(values)
        if placed:  # OpenUSD resolves these itself
            self._session.TransferContent(
                self._layer_of(
                    {key: one for key, one in values.items() if key[1].startswith("xformOp")}
                )
            )
            self.__dict__.pop("_frames", None)

    def _layer_of(self, values: Mapping[tuple[str, str], Any]) -> Any:
        """Return a layer with other values of attributes; instances on the way become copies."""
        sdf = self.pxr.Sdf
        layer = sdf.Layer.CreateAnonymous(".usda")
        for (path, name), value in values.items():
            prim = self.stage.GetPrimAtPath(path)
            for above in sdf.Path(path).GetAncestorsRange():
                if self.stage.GetPrimAtPath(above).IsInstance():
                    sdf.CreatePrimInLayer(layer, above).instanceable = False
            attribute = prim.GetAttribute(name)
            spec = sdf.AttributeSpec(
                sdf.CreatePrimInLayer(layer, path), name, attribute.GetTypeName()
            )
            spec.default = _like(attribute.Get(), value)
        return layer

    def fix_joint(self, prim: Any) -> None:
        """Fix a joint where its frames meet, in a layer over the file."""
        sdf = self.pxr.Sdf
        spec = sdf.CreatePrimInLayer(self._session, prim.GetPath())
        spec.specifier, spec.typeName = sdf.SpecifierDef, "PhysicsFixedJoint"

    def switch_off(self, joint: Any) -> None:
        """Switch a joint off, in a layer over the file."""
        with self.pxr.Usd.EditContext(self.stage, self._session):
            self.pxr.UsdPhysics.Joint(joint).GetJointEnabledAttr().Set(False)

    def overlay(self, values: Mapping[Number, float]) -> bytes:
        """Return a layer over the file that changes some numbers and keeps all its bytes."""
        return self.over_file(self._layer_of(self.changed_values(values))).encode()

    def over_file(self, layer: Any) -> str:
        """Return a layer as text, with the file below it."""
        root, original = layer.pseudoRoot, self.stage.GetRootLayer()
        for key in ("metersPerUnit", "kilogramsPerUnit", "upAxis"):  # read from a root layer only
            if original.pseudoRoot.HasInfo(key):
                root.SetInfo(key, original.pseudoRoot.GetInfo(key))
        if original.defaultPrim:
            layer.defaultPrim = original.defaultPrim
        layer.subLayerPaths.append(os.path.abspath(self.path))
        text: str = layer.ExportToString()
        return text


def plain(value: Any) -> Any:
    """Return a value of OpenUSD as floats: a vector as a tuple, a quaternion as (w, x, y, z)."""
    words = _words(value)
    if not words:
        return value
    return words[0] if isinstance(value, (int, float)) else words


def _words(value: Any) -> tuple[float, ...]:
    """Return the numbers of a value; empty for other values and long arrays."""
    if isinstance(value, (bool, str)) or value is None:
        return ()
    if isinstance(value, (int, float)):
        return (float(value),)
    if hasattr(value, "GetReal"):
        return (float(value.GetReal()), *map(float, value.GetImaginary()))
    try:
        words = np.array(value, dtype=float).ravel()
    except (TypeError, ValueError):
        return ()
    return tuple(words.tolist()) if 0 < len(words) <= 16 else ()


def _like(value: Any, words: Any) -> Any:
    """Return numbers as a value of the kind of another one."""
    if isinstance(words, tuple):
        kind = type(value)
        if hasattr(value, "GetReal"):
            return kind(words[0], kind(1).GetImaginary().__class__(*words[1:]))
        return (
            kind(words)
            if hasattr(value, "__len__") and not hasattr(value, "dimension")
            else kind(*words)
        )
    return words


def _shortest(attribute: Any, value: float) -> str:
    """Return the shortest decimal of a value that its type distinguishes."""
    name = str(attribute.GetTypeName())
    is_double = "double" in name or name.endswith("d") or "matrix" in name or name == "int"
    return repr(value) if is_double else str(np.float32(value))


def _one_line(error: object) -> str:
    return truncate(" ".join(str(error).split()))


def _unreadable(path: Path, error: Any) -> LocationError:
    """Return the error of a layer that OpenUSD can't read, with its line."""
    try:
        words = re.sub(r"pxrInternal\w*::(\w+::)*", "", str(error.args[0].commentary).strip())
    except UnicodeDecodeError:
        return LocationError("not a USD layer: it has bytes that are not UTF-8", file=path)
    syntax = _SYNTAX.fullmatch(words)
    if syntax is None:
        return LocationError(f"not a USD layer: {_one_line(words)}", file=path)
    sentence = f"not a USD layer: {_one_line(syntax['sentence'])}"
    located = LocationError(sentence, file=Path(syntax["file"]), line=int(syntax["line"]))
    return located.with_remedy("correct that line")


def _reference_line(file: Path, name: str) -> int | None:
    """Return the line of a text layer that names another one."""
    before, reference, _ = file.read_bytes().partition(f"@{name}@".encode())
    return (
        before.count(b"\n") + 1 if reference and not before.startswith((CRATE, PACKAGE)) else None
    )


def _prim_count(layers: Mapping[str, Any], layer: Any, path: Any, sizes: dict[Any, int]) -> int:
    """Return about how many prims a prim of a layer has, with those that it refers to."""
    key = layer.identifier, path
    if key not in sizes:
        sizes[key] = 1  # a circle, which composition reports
        prim = layer.GetPrimAtPath(path)
        arcs = (prim.referenceList, prim.payloadList) if prim else ()
        children = prim.nameChildren if prim else ()
        total = 1 + sum(_prim_count(layers, layer, child.path, sizes) for child in children)
        for arc in (one for items in arcs for one in items.GetAddedOrExplicitItems()):
            name = layer.ComputeAbsolutePath(arc.assetPath) if arc.assetPath else layer.identifier
            other = layers.get(name)
            if other is not None:
                target = arc.primPath or f"/{other.defaultPrim}"
                total += _prim_count(layers, other, target, sizes)
        sizes[key] = total
    return sizes[key]


def _check_size(path: Path, layers: Mapping[str, Any]) -> None:
    """Raise `RefusedFileError` for a prim that has too many others, or too deep ones."""
    counts = dict[Any, int]()
    try:
        for layer in layers.values():
            for prim in layer.rootPrims:
                if _prim_count(layers, layer, prim.path, counts) > MAX_PRIMS:
                    problem = f"refused: {prim.path} has more than {MAX_PRIMS} prims by references"
                    raise RefusedFileError(problem, file=Path(layer.realPath or str(path)))
    except RecursionError:
        raise RefusedFileError("refused: its prims are nested too deeply", file=path) from None


def checked_root(path: Path, *, allow_outside: bool = False) -> Any:
    """Open the layers that a stage composes, and return the root layer.

    Raises:
        LocationError: for a layer that can't be read, that a URL names, or that is outside of the
            root layer's folder; naming the layer that refers to it.
    """
    pxr = import_usd(path)
    folder = os.path.realpath(path.parent)
    root = _open(pxr, path, path)
    waiting, passed, size = [root], {root.identifier: root}, 0
    while waiting:
        layer = waiting.pop()
        shown = Path(layer.realPath or str(path))
        for name in layer.GetCompositionAssetDependencies():
            if "://" in name:
                problem = f"refused: it names {quote(name)}, and nothing is fetched"
                error = RefusedFileError(problem, file=shown, line=_reference_line(shown, name))
                raise error.with_remedy("save that layer here")
            inner = layer.ComputeAbsolutePath(name)
            file = inner.partition("[")[0].partition(":SDF_FORMAT_ARGS:")[0]
            is_inside = os.path.realpath(file).startswith(os.path.join(folder, ""))
            if not is_inside and not allow_outside and os.path.exists(file):
                problem = f"refused: it names {quote(name)}, outside of the folder of {path.name}"
                error = RefusedFileError(problem, file=shown, line=_reference_line(shown, name))
                raise error.with_remedy("move it there, or allow it by --allow-outside")
            if inner in passed or not os.path.exists(file):
                continue  # composition reports a missing layer
            size += os.path.getsize(file)
            if len(passed) >= MAX_LAYERS or size > 4 * MAX_MODEL_BYTES:
                raise RefusedFileError(f"refused: more than {MAX_LAYERS} layers", file=path)
            passed[inner] = _open(pxr, Path(inner), shown)
            waiting.append(passed[inner])
    _check_size(path, passed)
    return root


def _open(pxr: Any, file: Path, by: Path) -> Any:
    """Return a layer as it is on the disk now."""
    try:
        if "[" not in str(file):
            read_regular(file, MAX_MODEL_BYTES)
        layer = pxr.Sdf.Layer.FindOrOpen(str(file))
        if layer is None:
            raise LocationError("not a USD layer", file=file)
        layer.Reload()
    except OSError as error:
        raise LocationError(f"can't be read: {error.strerror or error}", file=file) from None
    except pxr.Tf.ErrorException as error:
        raise _unreadable(file, error) from None
    return layer


def layer_lines(file: Path) -> dict[str, int]:
    """Return the lines of all prims and properties of a text layer, by their paths in it.

    Empty for a binary layer or a package.
    """
    try:
        data = read_regular(file, MAX_MODEL_BYTES)
    except OSError:
        return {}
    if data.startswith((CRATE, PACKAGE)):
        return {}
    source, lines = SourceFile(file, data), dict[str, int]()
    # Each open bracket, with the path of the prim whose body it holds; None for any other.
    levels: list[str | None] = [""]
    pending = ""
    for token in _TOKEN.finditer(data):
        kind, path = token.lastgroup, levels[-1]
        text = "" if kind is None else token[kind].decode(errors="replace")
        if text in ("{", "(", "["):
            levels.append((pending or None) if text == "{" else None)
            pending = "" if text == "{" else pending
        elif kind == "bracket":
            levels[1:] = levels[1:-1]
        elif path is not None and text:
            pending = _entry(kind, path, text) or pending
            if kind in ("prim", "property"):
                name = pending if kind == "prim" else f"{path}.{text}"
                lines.setdefault(name, source.line(token.start(kind)))
    return lines


def _entry(kind: str | None, path: str, text: str) -> str:
    """Return the path of a prim, of a variant set or of a variant, whose body comes next."""
    if kind == "prim":
        return f"{path}{text}" if path.endswith("}") else f"{path}/{text}"
    if kind == "set":
        return f"{path}{{{text}="
    return f"{path}{text}}}" if kind == "text" and path.endswith("=") else ""


def stage_of(path: Path, settings: Mapping[str, object]) -> UsdStage:
    """Open a stage with the settings `variants` and `allow_outside`.

    Raises:
        LocationError: as `UsdStage`.
    """
    variants = settings.get("variants")
    words = shlex.split(os.environ.get(VARIANTS, ""))
    chosen = {**dict(word.split("=", 1) for word in words if "=" in word)}
    chosen |= variants if isinstance(variants, Mapping) else {}
    is_allowed = bool(settings.get("allow_outside") or os.environ.get(OUTSIDE))
    return UsdStage(path, chosen, allow_outside=is_allowed)


def is_outside(stage: UsdStage, joint: Any) -> bool:
    """Return whether a joint is excluded from the articulation, as one that closes a loop."""
    return bool(stage.value(joint, "physics:excludeFromArticulation", default=False))


def overlay_path(path: Path) -> Path:
    """Return the path of a text layer with the name of a file."""
    return path.with_suffix(".usda")


def unique_tails(paths: Sequence[str]) -> list[str]:
    """Return the shortest end of each prim path that no other path has: `arm` or `left/arm`."""
    steps = [path.strip("/").split("/") for path in paths]
    result = []
    for names in steps:
        count = 1
        while count < len(names) and sum(one[-count:] == names[-count:] for one in steps) > 1:
            count += 1
        result.append("/".join(names[-count:]))
    return result
