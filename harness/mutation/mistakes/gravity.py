"""Gravity of another size, switched off, or along another axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from physics_crosscheck.harness.modelfiles.bindings import SIDECAR
from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake, literal_causes
from physics_crosscheck.harness.records.cause import CauseId

SIZES = (9.8, 9.80665)
"""Common approximations of gravity, used if the model has another value."""

ACCELERATION = ("m/s^2", "m/s**2", "m*s^-2", "N/kg")


def gravity(subject: Subject) -> Iterator[Mistake]:
    """Yield changes of a model's gravity; changes of its size only if the equations have gravity
    too.
    """
    present = subject.model.gravity
    if not any(present):
        return
    vector = [*map(float, present), 0.0][:3]
    size = float(np.linalg.norm(vector))
    constants = {c.name for c in subject.task.target.system.constants if c.unit in ACCELERATION}
    if constants:
        for other in SIZES:
            if abs(other - size) > 1e-9 * size:
                turned = [g / size * other for g in vector]
                yield _changed(subject, f"gravity {other:g}", vector, turned, constants)
        yield _changed(subject, "gravity off", vector, [0.0, 0.0, 0.0], constants)
    down = int(np.argmax(np.abs(vector)))
    for axis in range(len(present)):
        if axis != down and not vector[axis]:
            turned = [0.0, 0.0, 0.0]
            turned[axis] = vector[down]
            yield _changed(subject, f"gravity along {'xyz'[axis]}", vector, turned, constants)


def _changed(
    subject: Subject, name: str, old: Sequence[float], new: Sequence[float], constants: set[str]
) -> Mistake:
    """Change gravity where the file states it as a vector or as one number, otherwise set it."""
    addresses = _written(subject, old)
    moved = [i for i in range(3) if new[i] != old[i]]
    causes = {CauseId(kind="gravity", subject=("xyz"[i],)) for i in moved}
    causes |= {CauseId(kind="constant", subject=(name,)) for name in constants}
    # On a coordinate along gravity, its effect is a constant force.
    pulled = [c.name for c in subject.task.target.system.coordinates]
    causes |= {CauseId(kind="offset force", subject=(name,)) for name in pulled}
    if all(i in addresses for i in moved):
        present, signs = (
            [addresses[i] for i in moved],
            [_sign(subject, addresses[i], old[i]) for i in moved],
        )
        literals = {a: s * new[i] for a, s, i in zip(present, signs, moved, strict=True)}
        return Mistake(name, ", ".join(present), Edit(literals), literal_causes(*present) | causes)
    edit = Edit(settings={"gravity": list(new)})
    return Mistake(name, "gravity", edit, literal_causes(*addresses.values()) | causes)


def _written(subject: Subject, old: Sequence[float]) -> dict[int, str]:
    """Return the addresses of components in the file, its sidecar or a bound number."""
    sidecar, engine = subject.task.declared, subject.task.engine
    for key, settings in (
        (f"settings.{engine}.gravity", sidecar.engine_settings.get(engine, {})),
        ("settings.gravity", sidecar.settings),
    ):
        if "gravity" in settings:
            return {i: f"{SIDECAR}{key}[{i}]" for i in range(3)}
    if subject.suffix == ".xml":
        stated = subject.numbers("option@gravity")
        return dict(enumerate(stated)) if len(stated) == 3 else {}
    addresses: dict[int, str] = {}
    for b in subject.found:
        names = {c.name for c in subject.task.target.system.constants if c.unit in ACCELERATION}
        if b.expression.strip(" -") in names:
            addresses |= {i: b.address for i in range(3) if abs(old[i]) == abs(b.value)}
    return addresses


def _sign(subject: Subject, address: str, component: float) -> float:
    """Return -1 if a number is the size of a component in the negative direction."""
    values = {b.address: b.value for b in subject.found}
    return -1.0 if values.get(address, component) == -component != 0 else 1.0
