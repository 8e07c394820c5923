"""Random mechanisms: frames, axes, inertias, springs, dampers and forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from campaigns.mechanisms.dynamics import MechanismDynamics
from campaigns.mechanisms.mechanism import (
    MJCF,
    URDF,
    AppliedForce,
    MechanismLink,
    Numbers,
    RandomMechanism,
)

Generator = np.random.Generator
Array = NDArray[np.float64]

VARIANTS = (
    ("mujoco", "Euler", MJCF),
    ("mujoco", "implicit", MJCF),
    ("mujoco", "implicitfast", MJCF),
    ("mujoco", "RK4", MJCF),
    ("mujoco", "RK4", MJCF),
    ("mujoco", "Euler", URDF),
    ("mujoco", "RK4", URDF),
    ("pybullet", "", URDF),
    ("pybullet", "", URDF),
)
"""Engine, integrator and format, in turn. RK4, which has the smallest uncertainty, comes twice.
PyBullet comes once with principal inertial frames, and once with products of inertia."""

DIGITS = 6
"""Significant digits of a number, as people write them; axes have all digits of a double."""

LIGHT = 0.3
"""Share of the mechanisms whose outer bodies are 10 to 1000 times lighter."""


QUIET = 0.3
"""Share of the mechanisms that move little about the equilibrium of springs and weight. Their
acceleration is a small difference of large forces."""


def draw(seed: int, index: int, max_joints: int = 5, engine: str = "") -> RandomMechanism:
    """Return the mechanism of an index, with one to `max_joints` joints."""
    rng = np.random.default_rng((seed, index))
    variants = [
        (place, variant) for place, variant in enumerate(VARIANTS) if engine in ("", variant[0])
    ]
    place, (name, integrator, form) = variants[index % len(variants)]
    count = int(rng.integers(1, max_joints + 1))
    light = bool(rng.random() < LIGHT)
    products = form == MJCF or place == len(VARIANTS) - 1 or name == "mujoco"
    links = tuple(
        _link(rng, i, parent, form, products=products, light=light)
        for i, parent in enumerate(_tree(rng, count))
    )
    bare = RandomMechanism(
        links=links,
        gravity=_vector(rng, 9.81 * float(rng.integers(0, 4) > 0)),
        step=_number(rng.uniform(5e-4, 4e-3)),
        format=form,
        engine=name,
        integrator=integrator,
        drives=(),
        q=tuple(_number(rng.uniform(-1.5, 1.5) * (1 if k.hinge else 0.2)) for k in links),
        v=tuple(_number(rng.uniform(-3, 3) * (1 if k.hinge else 0.3)) for k in links),
    )
    return _near_equilibrium(rng, bare) if rng.random() < QUIET else _with_forces(rng, bare)


def _tree(rng: Generator, count: int) -> list[int]:
    """Return each link's parent, in the depth-first order of engines; -1: the world."""
    parents, branch = [-1], [-1, 0]
    for index in range(1, count):
        back = 1 if rng.random() < 0.7 else int(rng.integers(1, len(branch) + 1))
        parents.append(branch[-back])
        branch = [*branch[: len(branch) - back + 1], index]
    return parents


def _link(
    rng: Generator, index: int, parent: int, form: str, *, products: bool, light: bool
) -> MechanismLink:
    inner = index == 0 or not light
    mass = _number(10 ** rng.uniform(-0.7, 0.7) * (1.0 if inner else 10 ** rng.uniform(-3, -1)))
    size = rng.uniform(0.05, 0.4, 3)
    moments = mass * (np.sum(size**2) - size**2) / 3
    inertia = np.diag(moments)
    mjcf = form == MJCF
    turned = bool(rng.random() < 0.5) or not products
    if products and not turned:
        rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        inertia = rotation @ inertia @ rotation.T
    axis = rng.normal(size=3)
    if rng.random() < 0.2:
        axis = np.eye(3)[rng.integers(3)]
    return MechanismLink(
        parent=parent,
        hinge=bool(rng.random() < 0.75),
        position=_vector(rng, float(rng.uniform(0.05, 0.6))),
        turn=_turn(rng, form),
        anchor=_vector(rng, 0.1) if mjcf and rng.random() < 0.5 else (0.0, 0.0, 0.0),
        # Not every engine normalizes axes.
        axis=tuple(map(float, axis / np.linalg.norm(axis))),
        mass=mass,
        centre=_vector(rng, float(rng.uniform(0.02, 0.4))),
        # MJCF takes an inertial frame or products of inertia; a URDF may have both.
        inertial_turn=_turn(rng, form) if turned or not mjcf else (),
        inertia=_tensor(inertia, full=products and not turned),
        reference=_number(rng.uniform(-0.5, 0.5)) if mjcf and rng.random() < 0.3 else 0.0,
    )


def _tensor(inertia: Array, *, full: bool) -> Numbers:
    places = ((0, 0), (1, 1), (2, 2), *(((0, 1), (0, 2), (1, 2)) if full else ()))
    return tuple(_number(inertia[place]) for place in places)


def _with_forces(rng: Generator, bare: RandomMechanism) -> RandomMechanism:
    """Return the mechanism with springs, dampers and drives, scaled by the inertia they act on."""
    start = np.array([bare.q])
    inertias = np.diagonal(MechanismDynamics(bare, np.float64).mass_matrix(start)[0])
    links = []
    for link, inertia in zip(bare.links, inertias, strict=True):
        rate = rng.uniform(2.0, 10.0)
        sprung, damped, heavier = rng.random(3) < (0.5, 0.5, 0.2)
        links.append(
            replace(
                link,
                stiffness=_number(inertia * rate**2) if sprung else 0.0,
                rest=_number(rng.uniform(-0.5, 0.5)) if sprung and rng.random() < 0.5 else 0.0,
                damping=_number(inertia * rng.uniform(0.05, 2.0)) if damped else 0.0,
                armature=_number(inertia / 3) if heavier and bare.format == MJCF else 0.0,
            )
        )
    drives = []
    if rng.random() < 0.6:
        joint = int(rng.integers(len(links)))
        size = inertias[joint] * rng.uniform(1.0, 20.0)
        wave = rng.random() < 0.6
        drives.append(
            AppliedForce(
                joint=joint,
                offset=0.0 if wave and rng.random() < 0.5 else _number(size / 2),
                amplitude=_number(size) if wave else 0.0,
                rate=_number(rng.uniform(1.0, 12.0)),
                phase=_number(rng.uniform(0.0, 6.0)),
            )
        )
    return replace(bare, links=tuple(links), drives=tuple(drives))


def _near_equilibrium(rng: Generator, bare: RandomMechanism) -> RandomMechanism:
    """Return the mechanism with springs on every joint and a start near their equilibrium."""
    start = np.array([bare.q])
    inertias = np.diagonal(MechanismDynamics(bare, np.float64).mass_matrix(start)[0])
    links = tuple(
        replace(
            link,
            stiffness=_number(inertia * rng.uniform(3.0, 12.0) ** 2),
            damping=_number(inertia * rng.uniform(0.05, 0.5)) if rng.random() < 0.5 else 0.0,
        )
        for link, inertia in zip(bare.links, inertias, strict=True)
    )
    sprung = replace(bare, links=links)
    around = _equilibrium(MechanismDynamics(sprung, np.float64))
    size = 10 ** rng.uniform(-2.5, -1)
    near = [_number(q + size * rng.normal()) for q in around]
    return replace(sprung, q=tuple(near), v=tuple(_number(5 * size * rng.normal()) for _ in links))


def _equilibrium(dynamics: MechanismDynamics) -> Array:
    """Return positions (n,) that balance springs and weight, by at most 30 Newton iterations."""
    n = len(dynamics.mechanism.links)
    q = np.zeros(n)
    step = 1e-6
    for _ in range(30):
        around = np.concatenate([q + step * np.eye(n), q - step * np.eye(n), q[None]])
        force = dynamics.static_forces(around)
        slope = (force[:n] - force[n:-1]).T / (2 * step)
        move = np.linalg.lstsq(slope, -force[-1], rcond=None)[0]
        size = float(np.max(np.abs(move)))
        q = q + move * min(1.0, 0.3 / max(size, 1e-300))
        if size < 1e-9:
            break
    return q


def _number(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _vector(rng: Generator, length: float) -> Numbers:
    direction = rng.normal(size=3)
    return tuple(_number(x) for x in length * direction / np.linalg.norm(direction))


def _turn(rng: Generator, form: str) -> Numbers:
    if form == URDF:
        return tuple(_number(x) for x in rng.uniform(-3, 3, 3))
    quaternion = rng.normal(size=4)
    return tuple(_number(x) for x in quaternion / np.linalg.norm(quaternion))
