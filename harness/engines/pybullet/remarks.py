"""PyBullet's own effects, the URDF elements that it ignores, and its loss of precision.

Some errors it explains only on the C library's stdout.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.harness.engines.installed import capture_output
from physics_crosscheck.harness.engines.protocol import Array, EngineError
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.urdf import UrdfReader, load_urdf, urdf_remarks

_PLACE = re.compile(r"b3(Warning|Error|Printf)\[[^\]]*\]:\s*")


@contextmanager
def collect_printed_errors() -> Iterator[list[str]]:
    """Yield a list that holds the printed errors as sentences after the block ends.

    The output is printed again afterwards.
    """
    messages: list[str] = []
    texts: list[str] = []
    try:
        with capture_output() as texts:
            yield messages
    finally:
        messages += _errors("".join(texts))


def _errors(text: str) -> list[str]:
    """Join the errors at the end into one sentence; each part follows b3Error.

    Their places in PyBullet's sources are left out, since they do not help the user.
    """
    parts = [" ".join(part.split()) for part in _PLACE.split(text)[2::2] if part.strip()]
    kinds = _PLACE.findall(text)
    errors = [part for kind, part in zip(kinds, parts, strict=False) if kind == "Error"]
    return ["; ".join(errors)] if errors else []


CAUSES = {
    "link_damping": "PyBullet's own damping of links",
    "motors": "PyBullet's own motors",
    "inertia_from_file": "PyBullet's own inertias of collision shapes",
}
"""The cause of each effect that a setting leaves on."""

_PARTS = {
    "link_damping": "link damping (0.04)",
    "motors": "joint motors",
    "speed": "speed limit",
    "inertia_from_file": "inertia from collision shapes",
    "gravity": "gravity",
}
"""Effects that the adapter disables: two of them always, the others by their settings."""

_LEFT_ON: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "link_damping": (
        "it brakes every link by its speed and the square of it",
        ("damping", "friction", "acceleration"),
    ),
    "motors": ("it holds every joint at rest with its motor", ()),
    "inertia_from_file": ("it ignores the file's inertias", ("inertia",)),
}
"""The effect of each if it is left on, and the compiled terms that it may explain."""

_URDF = UrdfReader(
    name="pybullet",
    no_inertial="a mass of 1 kg",
    equal_bounds=True,
    no_friction="PyBullet",
    long_axes="PyBullet",
)


def model_remarks(
    file: UrdfFile, joints: Sequence[str], on: Mapping[str, float | bool], z: Array, w: Array
) -> Iterator[Remark]:
    """Yield ignored parts of the URDF, and effects that are disabled, or left on by these
    settings.
    """
    yield from urdf_remarks(_URDF, file, joints, z, w)
    *parts, last = [part for key, part in _PARTS.items() if key not in on]
    yield Remark(
        message=f"PyBullet's own {', '.join(parts)} and {last} are switched off by the adapter"
    )
    for key, value in on.items():
        does, shows_in = _LEFT_ON[key]
        yield Remark(
            kind="setting",
            message=f"{CAUSES[key]}, left on by the setting {key}: {does}",
            fault=not shows_in,
            address=f"sidecar:settings.{key}",
            value=float(value),
            shows_in=shows_in,
        )


def products_caveat(path: Path) -> tuple[str, ...]:
    """Return a note on products of inertia if a URDF has them."""
    try:
        links = load_urdf(path).links.values()
    except EngineError:
        return ()  # loading it reports the error
    if not any(any(link.body.inertia[3:]) for link in links):
        return ()
    return (
        f"{path.name} has products of inertia; PyBullet finds their principal axes "
        "only to about 1e-9, so a discrepancy of that size may be PyBullet's",
    )
