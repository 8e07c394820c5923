"""The task of an audit: one model file in one engine, with the physics to compare with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.checks.prepare import Equilibrium, Prepared
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System


@dataclass(frozen=True, kw_only=True)
class AuditTask:
    """The inputs for auditing one model in one engine; smaller to send than `Prepared`.

    `resolution` is that of the run: the smallest relative change of motions or poses that counts.
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
    """Select the part of a folder's physics that an audit needs."""
    motions = prepared.motions.values()
    states = np.concatenate([m.nodes.reshape(-1, m.nodes.shape[-1]) for m in motions])
    extremes = np.concatenate([states.argmax(axis=0), states.argmin(axis=0)])
    # Regularly spaced states for contacts, and the extremes of each component for limits.
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
