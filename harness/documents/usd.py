"""USD stages: composed values with the layer, prim and line that state them, and edits as overlays.

Layers are checked before a stage is opened: nothing is fetched, and no layer is outside of the
asset's folder unless that is allowed.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import Array, Place
from .elements import Number
from .errors import LocationError, ReadError, ReadKind, RefusedFileError, quote, truncate
from .reading import (
    CRATE,
    MAX_MODEL_BYTES,
    PACKAGE,
    USD_OUTSIDE,
    USD_VARIANTS,
    SourceFile,
    read_regular,
)

MAX_LAYERS = 500
"""The most layers of a stage."""

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


class UsdPlace(NamedTuple):
    """The layer that states a value, its line from 1 if it is text, and the prim and property.

    For a fallback it is the root layer, without a line.
    """

    file: Path
    line: int | None
    address: str


class UsdStage:
    """A composed stage, and the problems found in it.

    Args:
        path: of the root layer.
        settings: `variants` selects variants by the name of their set, in place of those of the
            file; with `allow_outside`, layers may be outside of the root layer's folder.

    Attributes:
        stage: of OpenUSD.
        selection: selected variants of all sets, such as `size=large`.
        unit, mass_unit: m and kg per unit.
        up: index of the up axis.

    Raises:
        LocationError: for a file that can't be read, naming layer and line.
    """

    def __init__(self, path: Path, settings: Mapping[str, object]) -> None:
        try:
            import pxr
            from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdUtils  # noqa: F401
        except ImportError:
            problem = LocationError("reading USD needs usd-core, which is not installed", file=path)
            raise problem.with_remedy("pip install 'physics-crosscheck[usd]'") from None
        with contextlib.suppress(ImportError):  # OpenUSD takes no schemas after its first stage
            import newton_usd_schemas  # noqa: F401
        self.pxr: Any = pxr
        self.path, self.obstacles = path, list[ReadError]()
        self._changed: dict[tuple[str, str], Any] = {}
        self._lines: dict[str, Mapping[str, int]] = {}
        # Held while it opens, so that warnings stay off the screen.
        delegate = pxr.UsdUtils.CoalescingDiagnosticDelegate()
        try:
            is_allowed = bool(settings.get("allow_outside") or os.environ.get(USD_OUTSIDE))
            root = _checked_root(pxr, path, is_allowed)
            self._session, self._moves = (pxr.Sdf.Layer.CreateAnonymous(".usda") for _ in range(2))
            self._session.subLayerPaths.append(self._moves.identifier)
            self.stage = pxr.Usd.Stage.Open(root, self._session)
            self.selection = self._select(settings.get("variants"))
            errors = self.stage.GetCompositionErrors()
        except pxr.Tf.ErrorException as error:
            raise _unreadable(path, error) from None
        finally:
            delegate.TakeUncoalescedDiagnostics()
        if errors:
            first = min(map(str, errors), key=lambda one: "Could not" not in one)  # missing layers
            reason = first.replace(f"{os.path.abspath(path.parent)}/", "")
            problem = LocationError(f"does not compose: {_one_line(reason)}", file=path)
            raise problem.with_remedy("add or correct what it names")
        self.unit = float(pxr.UsdGeom.GetStageMetersPerUnit(self.stage))
        self.mass_unit = float(pxr.UsdPhysics.GetStageKilogramsPerUnit(self.stage))
        if not 0 < min(self.unit, self.mass_unit) <= max(self.unit, self.mass_unit) < math.inf:
            wrong = f"metersPerUnit is {self.unit:g}, and kilogramsPerUnit {self.mass_unit:g}"
            raise LocationError(wrong, file=path).with_remedy("write positive numbers")
        self.up = "XYZ".index(str(pxr.UsdGeom.GetStageUpAxis(self.stage)).upper())

    def _select(self, stated: object) -> tuple[str, ...]:
        chosen: dict[str, None] = {}
        words = shlex.split(os.environ.get(USD_VARIANTS, ""))
        variants = dict(word.split("=", 1) for word in words if "=" in word)
        variants.update(stated if isinstance(stated, Mapping) else {})
        unused = dict(variants)
        for prim in self.prims:
            sets = prim.GetVariantSets()
            for name in sets.GetNames():
                variant_set = sets.GetVariantSet(name)
                if name in variants:
                    names = variant_set.GetVariantNames()
                    if variants[name] not in names:
                        problem = f"variant set {quote(name)} of {prim.GetPath()} has no variant"
                        problem += f" {quote(variants[name])}; it has {', '.join(names)}"
                        raise LocationError(problem, file=self.path)
                    with self.pxr.Usd.EditContext(self.stage, self._session):
                        variant_set.SetVariantSelection(variants[name])
                    unused.pop(name, None)
                if selected := variant_set.GetVariantSelection():
                    chosen[f"{name}={selected}"] = None
        for name in unused:
            raise LocationError(f"it has no variant set {quote(name)}", file=self.path)
        del self.prims  # those of the variants follow
        return tuple(chosen)

    @cached_property
    def prims(self) -> tuple[Any, ...]:
        """All prims, depth first, with those of instances."""
        usd = self.pxr.Usd
        every = usd.PrimRange(self.stage.GetPseudoRoot(), usd.TraverseInstanceProxies())
        return tuple(every)[1:]

    @cached_property
    def bodies(self) -> Mapping[str, Any]:
        """Rigid bodies by name, the shortest unique end of the path."""
        rigid = self.pxr.UsdPhysics.RigidBodyAPI
        return _named([prim for prim in self.prims if prim.HasAPI(rigid)])

    @cached_property
    def joints(self) -> Mapping[str, Any]:
        """Joints of all types by name."""
        joint_type = self.pxr.UsdPhysics.Joint
        return _named([prim for prim in self.prims if prim.IsA(joint_type)])

    @cached_property
    def body_names(self) -> Mapping[Any, str]:
        """Names of rigid bodies by prim."""
        return {prim: name for name, prim in self.bodies.items()}

    def body_of(self, prim: Any) -> Any:
        """Return the rigid body that holds a prim, or that it is; None without one."""
        while prim and prim not in self.body_names:
            prim = prim.GetParent()
        return prim or None

    @cached_property
    def _scene(self) -> Any:
        scenes = (prim for prim in self.prims if prim.GetTypeName() == "PhysicsScene")
        return next(scenes, None)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Gravity of the first scene, m/s^2; along the up axis where it states no direction."""
        direction = np.array(self.value(self._scene, "physics:gravityDirection", (0.0, 0.0, 0.0)))
        stated = self.value(self._scene, "physics:gravityMagnitude", -1.0)
        size = 9.81 if stated < 0 else stated * self.unit
        if not direction.any():
            direction = -np.eye(3)[self.up]
        x, y, z = (size * direction / np.linalg.norm(direction) + 0.0).tolist()  # no -0.0
        return x, y, z

    def gravity_place(self, *, is_turned: bool) -> UsdPlace:
        """Return the place of the size of gravity, or of its direction."""
        name = f"physics:gravity{'Direction' if is_turned else 'Magnitude'}"
        if not is_turned or any(self.stated(self._scene, name) or ()):
            return self.place(self._scene or self.stage.GetPseudoRoot(), name)
        return UsdPlace(self.path, self.header_line("upAxis"), "upAxis")

    @property
    def settings(self) -> dict[str, object]:
        """Settings of engines that the file states: gravity, and the time step of its scene."""
        names = ("newton:timeStepsPerSecond", "physxScene:timeStepsPerSecond")
        rate = next(filter(None, (self.stated(self._scene, name) for name in names)), None)
        return {"gravity": list(self.gravity), **({"step": 1 / rate} if rate else {})}

    def add_problem(
        self, prim: Any, sentence: str, remedy: str, kind: ReadKind = "robot", name: str = ""
    ) -> None:
        """Add a problem of a prim, or of a property of it, that prevents building a tree."""
        file, line, address = self.place(prim, name)
        sentence = f"{address}: {sentence}"
        self.obstacles.append(
            ReadError(sentence=sentence, file=file, line=line or 0, remedy=remedy, kind=kind)
        )

    def value(self, prim: Any, name: str, default: Any = None) -> Any:
        """Return the composed value of an attribute, or its fallback, or the default.

        Vectors are tuples, and quaternions (w, x, y, z). A value of a wrong type adds a problem.
        """
        attribute = prim.GetAttribute(name) if prim else None
        if not attribute:
            return default
        key = str(prim.GetPath()), name
        if key in self._changed:
            return self._changed[key]
        value = attribute.Get()
        if value is None:
            return default
        words = _words(value)
        if words:
            value = words[0] if isinstance(value, (int, float)) else words
        if wrong := _wrong(name, value):
            self.add_problem(prim, wrong, "correct it", name=name)
            return default
        return value

    def stated(self, prim: Any, name: str) -> Any:
        """Return the value of an attribute if a layer states it; None otherwise."""
        attribute = prim.GetAttribute(name) if prim else None
        return self.value(prim, name) if attribute and attribute.HasAuthoredValue() else None

    def actuator_force(self, joint: Any) -> tuple[float, float] | None:
        """Return the limits of force that `mjc:` states of a joint or its only actuator, in SI."""
        rows = [joint] if self.stated(joint, "mjc:actuatorfrcrange:max") is not None else [
            prim for prim in self.prims
            if prim.GetTypeName() == "MjcActuator"
            and self.targets(prim, "mjc:target") == [joint.GetPath()]
        ]  # fmt: skip
        key = "mjc:actuatorfrcrange" if rows == [joint] else "mjc:forceRange"
        if len(rows) != 1 or self.stated(rows[0], f"{key}:max") is None:
            return None
        return self.value(rows[0], f"{key}:min", 0.0), self.value(rows[0], f"{key}:max", 0.0)

    def targets(self, prim: Any, name: str) -> list[Any]:
        """Return the paths that a relationship names."""
        relationship = prim.GetRelationship(name)
        return list(relationship.GetForwardedTargets()) if relationship else []

    def place(self, prim: Any, name: str = "") -> UsdPlace:
        """Return the place of a property's strongest opinion; without a name that of the prim."""
        address = f"{prim.GetPath()}.{name}" if name else str(prim.GetPath())
        member = prim.GetProperty(name) if name else prim
        stack = (member.GetPropertyStack() if name else member.GetPrimStack()) if member else ()
        for spec in stack:
            layer, root = spec.layer, self.stage.GetRootLayer()
            if layer.identifier not in self._lines:
                self._lines[layer.identifier] = layer_lines(Path(layer.realPath))
            file, line = self.path, self._lines[layer.identifier].get(str(spec.path))
            if layer != root and layer.realPath:  # as the user names the root layer's folder
                above = os.path.dirname(root.realPath)
                file = Path(self.path.parent, os.path.relpath(layer.realPath, above))
            return UsdPlace(file, line, address)
        return UsdPlace(self.path, None, address)

    def header_line(self, name: str) -> int | None:
        """Return the line of metadata of the stage, which only its root layer states."""
        return layer_lines(self.path).get(f".{name}")

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

    def numbers(self) -> Iterator[Number]:
        """Yield all numbers of a mechanism that layers state, in the order of the prims."""
        for attribute in (one for prim in self.prims for one in prim.GetAuthoredAttributes()):
            prim, name = attribute.GetPrim(), str(attribute.GetName())
            if not (_PHYSICAL.fullmatch(name) and (values := _words(attribute.Get()))):
                continue
            place = self.place(prim, name)
            for word, value in enumerate(values):
                yield Number(
                    file=place.file,
                    text=_shortest(attribute, value),
                    line=place.line,
                    address=place.address + (f"[{word}]" if len(values) > 1 else ""),
                    path=f"{prim.GetTypeName()}@{name}",
                    scale=max(map(abs, values)),
                    key=name,
                    word=word,
                )

    def _values(self, numbers: Mapping[Number, float]) -> dict[tuple[str, str], Any]:
        result: dict[tuple[str, str], Any] = {}
        for number, value in numbers.items():
            path, word = number.address.partition(".")[0], number.word
            key = path, number.key
            whole = result.get(key, self.value(self.stage.GetPrimAtPath(path), number.key))
            is_list = isinstance(whole, tuple)
            result[key] = (*whole[:word], value, *whole[word + 1 :]) if is_list else value
        return result

    def change(self, numbers: Mapping[Number, float]) -> None:
        """Set other values of numbers, in place of those of the last call."""
        self._changed = {}
        values = self._changed = self._values(numbers)
        # OpenUSD resolves frames itself.
        moves = {key: value for key, value in values.items() if key[1].startswith("xformOp")}
        if moves or not self._moves.empty:
            self._moves.TransferContent(self._layer_of(moves))
            for name in ("prims", "bodies", "joints", "body_names", "_scene", "_frames"):
                self.__dict__.pop(name, None)  # an instance may be a copy now

    def _layer_of(self, values: Mapping[tuple[str, str], Any]) -> Any:
        """Return a layer with other values of attributes; instances on the way become copies."""
        sdf = self.pxr.Sdf
        layer = sdf.Layer.CreateAnonymous(".usda")
        for (path, name), value in values.items():
            for above in sdf.Path(path).GetAncestorsRange():
                if self.stage.GetPrimAtPath(above).IsInstance():
                    sdf.CreatePrimInLayer(layer, above).instanceable = False
            attribute = self.stage.GetPrimAtPath(path).GetAttribute(name)
            kind, python = attribute.GetTypeName(), type(attribute.Get())
            spec = sdf.AttributeSpec(sdf.CreatePrimInLayer(layer, path), name, kind)
            if isinstance(value, tuple):
                value = python(value) if kind.isArray else python(*value)
            spec.default = value
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

    def is_outside(self, joint: Any) -> bool:
        """Return whether a joint is excluded from the articulation, as one that closes a loop."""
        return bool(self.value(joint, "physics:excludeFromArticulation", default=False))

    def overlay(self, numbers: Mapping[Number, float]) -> bytes:
        """Return a layer over the file that changes some numbers and keeps all its bytes."""
        return self.over_file(self._layer_of(self._values(numbers))).encode()

    def over_file(self, layer: Any) -> str:
        """Return a layer as text, with the file below it."""
        # Units, axis and default prim are read from a root layer only.
        self.pxr.UsdUtils.CopyLayerMetadata(self.stage.GetRootLayer(), layer, True)
        layer.subLayerPaths = [os.path.abspath(self.path)]
        text: str = layer.ExportToString()
        return text


def _named(prims: Sequence[Any]) -> dict[str, Any]:
    """Return prims by the shortest end of each path that no other has: `arm` or `left/arm`."""
    steps = [str(prim.GetPath()).strip("/").split("/") for prim in prims]
    result = {}
    for names, prim in zip(steps, prims, strict=True):
        count = 1
        while count < len(names) and sum(one[-count:] == names[-count:] for one in steps) > 1:
            count += 1
        result["/".join(names[-count:])] = prim
    return result


def _wrong(name: str, value: Any) -> str:
    """Return why a value can't be that of a name of the schemas; empty if it can."""
    last = name.rpartition(":")[2]
    if words := _WORDS.get(last):
        return "" if value in words else f"it is {quote(str(value))}, not {' or '.join(words)}"
    if not _PHYSICAL.fullmatch(name) or name.startswith("xformOp"):
        return ""
    numbers = value if isinstance(value, tuple) else (value,)
    if not all(isinstance(number, (float, bool)) for number in numbers):
        return f"it is a {type(value).__name__}, not a number"
    if len(numbers) != _LENGTHS.get(last.rstrip("01"), 1) and last != "inertia":
        return f"it has {len(numbers)} numbers"
    if any(map(math.isnan, numbers)):
        return "it is not a number"
    is_bounded = all(map(math.isfinite, numbers)) or _UNBOUNDED.fullmatch(last)
    return "" if is_bounded else "it is infinite"


def _words(value: Any) -> tuple[float, ...]:
    """Return the numbers of a value; empty for other values and long arrays."""
    if isinstance(value, (bool, str)) or value is None:
        return ()
    if hasattr(value, "GetReal"):
        return (float(value.GetReal()), *map(float, value.GetImaginary()))
    try:
        words = np.array(value, dtype=float).ravel()
    except (TypeError, ValueError):
        return ()
    return tuple(words.tolist()) if 0 < len(words) <= 16 else ()


def _shortest(attribute: Any, value: float) -> str:
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
            if other := layers.get(name):
                target = arc.primPath or f"/{other.defaultPrim}"
                total += _prim_count(layers, other, target, sizes)
        sizes[key] = total
    return sizes[key]


def _check_size(path: Path, layers: Mapping[str, Any]) -> None:
    """Raise `RefusedFileError` for a prim that has too many others, or too deep ones."""
    counts = dict[Any, int]()
    try:
        for layer, prim in ((one, prim) for one in layers.values() for prim in one.rootPrims):
            if _prim_count(layers, layer, prim.path, counts) > MAX_PRIMS:
                problem = f"refused: {prim.path} has more than {MAX_PRIMS} prims by references"
                raise RefusedFileError(problem, file=Path(layer.realPath or str(path)))
    except RecursionError:
        raise RefusedFileError("refused: its prims are nested too deeply", file=path) from None


def _checked_root(pxr: Any, path: Path, allow_outside: bool) -> Any:
    """Open the layers that a stage composes, and return the root layer, or refuse one of them."""
    folder = os.path.join(os.path.realpath(path.parent), "")
    root = _open(pxr, path)
    waiting, passed, size = [root], {root.identifier: root}, 0
    while waiting:
        layer = waiting.pop()
        for name in layer.GetCompositionAssetDependencies():
            inner = layer.ComputeAbsolutePath(name)
            file = inner.partition("[")[0].partition(":SDF_FORMAT_ARGS:")[0]
            is_inside = allow_outside or os.path.realpath(file).startswith(folder)
            if "://" in name:
                raise _refusal(layer, path, name, "and nothing is fetched", "save that layer here")
            if not os.path.exists(file) or (inner in passed and is_inside):
                continue  # composition reports a missing layer
            if not is_inside:
                problem = f"outside of the folder of {path.name}"
                remedy = "move it there, or allow it by --allow-outside"
                raise _refusal(layer, path, name, problem, remedy)
            size += os.path.getsize(file)
            if len(passed) >= MAX_LAYERS or size > 4 * MAX_MODEL_BYTES:
                raise RefusedFileError(f"refused: more than {MAX_LAYERS} layers", file=path)
            passed[inner] = _open(pxr, Path(inner))
            waiting.append(passed[inner])
    _check_size(path, passed)
    return root


def _refusal(layer: Any, root: Path, name: str, problem: str, remedy: str) -> LocationError:
    """Return the error about a layer that another one names, with the line in a text layer."""
    file = Path(layer.realPath or str(root))
    before, reference, _ = file.read_bytes().partition(f"@{name}@".encode())
    is_text = reference and not before.startswith((CRATE, PACKAGE))
    line = before.count(b"\n") + 1 if is_text else None
    error = RefusedFileError(f"refused: it names {quote(name)}, {problem}", file=file, line=line)
    return error.with_remedy(remedy)


def _open(pxr: Any, file: Path) -> Any:
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
    """Return the lines of prims and properties by path; none of a binary layer or a package."""
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
            is_body = text == "{" and path is not None  # not a dictionary of metadata
            is_header = text == "(" and levels == [""] and not lines
            levels.append("" if is_header else (pending or None) if is_body else None)
            pending = "" if is_body else pending
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
