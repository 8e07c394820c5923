"""An MJCF with its includes expanded, and the place of every element."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from physics_crosscheck.harness.documents.document import finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from .protocol import EngineError, ModelSpec, UnsupportedError
from .remark import Remark
from .source import read_document, refused

OPTIONS: Mapping[str, tuple[str, object]] = {
    "step": ("timestep", 0.002),
    "gravity": ("gravity", [0.0, 0.0, -9.81]),
}
"""Settings, the attributes of `<option>` that state them, and their defaults."""

ORIENTATIONS: Mapping[str, tuple[float, ...]] = {
    "quat": (1, 0, 0, 0),
    "axisangle": (0, 0, 1, 0),
    "euler": (0, 0, 0),
    "xyaxes": (1, 0, 0, 0, 1, 0),
    "zaxis": (0, 0, 1),
}
"""Attributes that state an orientation, with the identity."""


@dataclass(frozen=True, kw_only=True)
class MjcfSource:
    """A file and all its includes.

    Attributes:
        path: of the file.
        root: its `<mujoco>`, with the children of included files in place.
    """

    path: Path
    root: XmlElement

    def refused(self, element: XmlElement, sentence: str) -> EngineError:
        """Return an error about an element."""
        file, line = element.place
        return EngineError(sentence, file=file, line=line)

    def unsupported(self, element: XmlElement, sentence: str) -> UnsupportedError:
        """Return an error about a valid element that an adapter does not support."""
        file, line = element.place
        return UnsupportedError(sentence, file=file, line=line)

    @property
    def angle_unit(self) -> float:
        """The unit of angles, rad."""
        return 1.0 if self.stated("compiler", "angle") == "radian" else math.pi / 180

    def stating(self, tag: str, attribute: str) -> XmlElement | None:
        """Return the last `<option>`, `<compiler>` or the like with an attribute: it counts."""
        elements = [one for one in self.root.findall(tag) if attribute in one.attributes]
        return elements[-1] if elements else None

    def stated(self, tag: str, attribute: str, otherwise: str = "") -> str:
        """Return an attribute's value from the last `<option>`, `<compiler>` or the like."""
        element = self.stating(tag, attribute)
        return otherwise if element is None else element.attributes[attribute]

    def disabled(self, *flags: str) -> bool:
        """Return whether a `<flag>` disables any of these."""
        return any(self.stated("option/flag", flag) == "disable" for flag in flags)


def read_source_mjcf(path: Path) -> MjcfSource:
    """Read an MJCF with its includes, whose paths are relative to the first file.

    Raises:
        EngineError: naming file and line.
    """
    root = _expanded(path, path.parent, ())
    if root.tag != "mujoco":
        file, line = root.place
        raise EngineError(
            f"the root is <{root.tag}>, not <mujoco>: not an MJCF", file=file, line=line
        )
    return MjcfSource(path=path, root=root)


def _expanded(path: Path, folder: Path, above: tuple[Path, ...]) -> XmlElement:
    root = read_document(path).root.copy()
    for parent in list(root.iter()):
        for i, child in reversed(list(enumerate(parent))):
            if child.tag == "include":
                name = child.get("file", "")
                file = folder / name
                if not name or file in (*above, path):
                    raise refused(child, f"<include file> is {name!r}, which is the file itself")
                parent.remove(child)
                for element in reversed(list(_expanded(file, folder, (*above, path)))):
                    parent.insert(i, element)
    return root


def with_options(spec: ModelSpec) -> ModelSpec:
    """Return the spec with the file's step and gravity, unless the sidecar states them.

    Raises:
        EngineError: if they are not numbers.
    """
    source = read_source_mjcf(spec.path)
    options: dict[str, object] = {}
    for setting, (attribute, otherwise) in OPTIONS.items():
        text = source.stated("option", attribute)
        numbers = finite_numbers(text) if text else None
        if text and (numbers is None or len(numbers) != (3 if setting == "gravity" else 1)):
            raise EngineError(f"{spec.path}: <option {attribute}> is {text!r}")
        options[setting] = otherwise if numbers is None else numbers
    if isinstance(options["step"], list):
        (options["step"],) = options["step"]
    off = {"gravity": [0.0, 0.0, 0.0]} if source.disabled("gravity") else {}
    given = {**options, **spec.settings, **off}
    if not isinstance(given["step"], (int, float)) or not given["step"] > 0:
        raise EngineError(f"{spec.path}: the time step is {given['step']} s; expected more than 0")
    return replace(spec, settings=given)


def option_remarks(source: MjcfSource, title: str, attributes: frozenset[str]) -> Iterator[Remark]:
    """Yield attributes of `<option>` that an engine ignores and its adapter applies."""
    for attribute, _ in OPTIONS.values():
        if attribute in attributes and source.stated("option", attribute):
            yield Remark(
                kind="ignored",
                message=(f"{title} ignores <option {attribute}>; the adapter applies its value"),
                address=f"option@{attribute}",
            )
