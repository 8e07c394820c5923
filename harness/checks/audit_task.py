"""What is to be audited: one model file in one engine, with the physics it is held against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.checks.prepare import Equilibrium, Prepared
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System


@dataclass(frozen=True, kw_only=True)
class AuditTask:
    """What a worker needs to audit one model in one engine; cheaper to send than a `Prepared`.

    `resolution` is that of the run: a change of motions or poses that counts, relative.
    """

    system: System
    equilibria: tuple[Equilibrium, ...]
    states: Array
    push: Array
    amplitude: Array
    fastest: float
    sidecar: Sidecar
    engine: str
    resolution: float = 1e-9


def audit_task(
    prepared: Prepared, sidecar: Sidecar, engine: str, resolution: float = 1e-9
) -> AuditTask:
    """The part of a folder's physics that an audit needs."""
    motions = prepared.motions.values()
    states = np.concatenate([m.nodes.reshape(-1, m.nodes.shape[-1]) for m in motions])
    extremes = np.concatenate([states.argmax(axis=0), states.argmin(axis=0)])
    # Every so many states for contacts, and each component's extremes for limits.
    picked = np.unique(np.concatenate([extremes, np.linspace(0, len(states) - 1, 200).astype(int)]))
    return AuditTask(
        system=prepared.system,
        equilibria=prepared.equilibria,
        states=states[picked],
        push=prepared.push,
        amplitude=prepared.amplitude,
        fastest=max(m.fastest for m in motions),
        sidecar=sidecar,
        engine=engine,
        resolution=resolution,
    )
