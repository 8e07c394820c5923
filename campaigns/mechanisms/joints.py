"""Coordinates and inputs of a mechanism for the harness: each joint is a coordinate."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import sympy as sp

from campaigns.mechanisms.mechanism import AppliedForce
from campaigns.mechanisms.written import joint_name
from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, coordinate_map
from physics_crosscheck.reference.mechanism.declaration import t
from physics_crosscheck.reference.mechanism.signal import Inputs, SignalPiece, numeric_inputs


def inputs(drives: tuple[AppliedForce, ...], duration: float) -> Inputs:
    """Return the forces of the drives over the whole motion, `duration` seconds."""
    expressions = tuple(
        sp.Float(d.offset, 17) + sp.Float(d.amplitude, 17) * sp.sin(d.rate * t + d.phase)
        if d.varies
        else sp.Float(d.offset, 17)
        for d in drives
    )
    return numeric_inputs([SignalPiece(start=0.0, stop=duration, expressions=expressions)])


@cache
def identity(
    kinds: tuple[bool, ...], driven: tuple[int, ...], names: tuple[str, ...]
) -> CoordinateMap:
    """Return the map of a system whose coordinates are the joints.

    Args:
        kinds: whether each joint is a hinge.
        driven: indices of joints with a drive.
        names: of the engine's coordinates.
    """
    coordinates = tuple(
        Coordinate(joint_name(i), "rad" if hinge else "m", "of a joint")
        for i, hinge in enumerate(kinds)
    )
    masses = tuple(
        Constant(f"m{i + 1}", 1.0, "kg*m^2" if hinge else "kg", "stands for all inertia", "none")
        for i, hinge in enumerate(kinds)
    )
    inputs = tuple(
        Input(f"u{i + 1}", "N*m" if kinds[i] else "N", "on a joint", on={coordinates[i]: 1})
        for i in driven
    )
    energy = sp.Add(*(m * c.v**2 / 2 for m, c in zip(masses, coordinates, strict=True)))
    still = dict.fromkeys(coordinates, 0.0)
    system = System(
        name="joints",
        title="Joints",
        source="none: only its coordinates are used",
        coordinates=coordinates,
        constants=masses,
        inputs=inputs,
        outputs=(Output("one", coordinates[0].q, coordinates[0].unit, "the first joint"),),
        T=energy,
        V=sp.Integer(0),
        D=sp.Integer(0),
        equilibria=(Equilibrium("rest", at=still, search=False, description="at rest"),),
        scenarios=(
            Scenario("none", "", q=still, v=still, inputs=dict.fromkeys(inputs, 0.0), duration=1.0),
        ),
        published=(),
    )
    sidecar = Sidecar(
        model=Path("mechanism"),
        engines=(),
        settings={},
        engine_settings={},
        coordinates={},
        readback={},
        springs=(),
    )
    return coordinate_map(system, sidecar, names)
