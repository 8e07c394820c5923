"""Where a mechanism rests and which motions to compare: chosen from its equations and limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize
import sympy as sp

from harness.scaffold.folder import NewError
from harness.scaffold.mechanism import Joint
from reference.declaration import Equilibrium, Scenario, t
from reference.derive import Equations, derive
from reference.integrate import ReferenceError, trajectory
from reference.numeric import Array, compile_function
from reference.signal import pieces
from reference.system import System

PERIODS = 10
SHORTEST, LONGEST = 2.0, 15.0
"""Seconds that a scenario lasts at least and at most, limits apart."""
MOST_SEGMENTS = 1500
ROOM = 0.02
"""Share of a joint's range that a motion stays away from its ends."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A scenario: start, forces as (size, rate) of a sine, and duration."""

    name: str
    description: str
    start: tuple[float, ...]
    forces: tuple[tuple[float, float], ...]
    duration: float


@dataclass(frozen=True)
class Plan:
    """Where it rests, exactly there or near, and its scenarios."""

    rest: tuple[str, ...]
    search: bool
    motions: tuple[Motion, ...]

    def lines(self, joints: Sequence[Joint], forces: Sequence[str]) -> list[str]:
        """The part of system.py that says so."""
        at = ", ".join(f"{j.symbol}: {r}" for j, r in zip(joints, self.rest, strict=True))
        lines = [
            "    # search=True: near there; False: exactly there.",
            "    equilibria=(",
            f'        Equilibrium("rest", at={{{at}}}, search={self.search},',
            '                    description="where it stays"),',
            "    ),",
            "    scenarios=(",
        ]
        for m in self.motions:
            q = ", ".join(f"{j.symbol}: {x:g}" for j, x in zip(joints, m.start, strict=True))
            v = ", ".join(f"{j.symbol}: 0" for j in joints)
            u = ", ".join(
                f"{force}: {f'{size:g} * sin({rate:g} * t)' if size else 0}"
                for force, (size, rate) in zip(forces, m.forces, strict=True)
            )
            lines += [
                f'        Scenario("{m.name}", "{m.description}",',
                f"                 q={{{q}}},",
                f"                 v={{{v}}},",
                f"                 inputs={{{u}}},",
                f"                 duration={m.duration:g}),",
            ]
        return [*lines, "    ),"]


def provisional(joints: Sequence[Joint]) -> Plan:
    """Any plan: what a declaration needs to be one."""
    middle = tuple(f"{_clipped(0.0, joint):g}" for joint in joints)
    still = tuple((0.0, 1.0) for _ in joints)
    return Plan(
        middle,
        True,
        (
            Motion(
                name="any",
                description="any",
                start=tuple(map(float, middle)),
                forces=still,
                duration=1.0,
            ),
        ),
    )


def plan(system: System, joints: Sequence[Joint]) -> Plan:
    """Choose where it rests, and motions within the joints' limits.

    Raises:
        NewError: where it rests nowhere within its limits.
    """
    equations = derive(system)
    rest = _rest(system, joints)
    names, search = _named(rest)
    zero = dict.fromkeys((*system.v, *system.u, t), sp.Integer(0))
    force = sp.Matrix([f.xreplace(zero) for f in equations.force])
    entries = [*equations.mass, *(-force.jacobian(system.q))]
    n = len(rest)
    values = equations.compile(entries)(rest, np.zeros(n), np.zeros(n), np.zeros(1))
    mass, stiffness = values[: n * n].reshape(n, n), values[n * n :].reshape(n, n)
    rates = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass, eigvals_only=True)
    real = np.sqrt(rates[rates > 1e-9 * max(np.max(np.abs(rates)), 1e-9)])
    slowest, fastest = (float(real.min()), float(real.max())) if real.size else (2.0, 2.0)
    duration = min(
        max(PERIODS * 2 * math.pi / slowest, SHORTEST),
        LONGEST,
        MOST_SEGMENTS * 2 * math.pi / (20 * fastest),
    )
    duration = float(f"{duration:.2g}")
    signs = [(1.0, -0.6, 0.8, -0.4)[i % 4] for i in range(n)]
    still = tuple((0.0, 1.0) for _ in joints)
    motions = [
        Motion(
            name="free",
            description="released away from where it rests",
            start=_start(rest, joints, signs, 0.7),
            forces=still,
            duration=duration,
        )
    ]
    if any(joint.hinge and _reach(r, joint) > 2 for r, joint in zip(rest, joints, strict=True)):
        motions.append(
            Motion(
                name="large",
                description="released far away from where it rests",
                start=_start(rest, joints, signs, 2.2),
                forces=still,
                duration=duration,
            )
        )
    pushes = []
    for i, joint in enumerate(joints):
        reach = min(0.3 * _reach(rest[i], joint), 0.4 if joint.hinge else 0.1)
        rate = 0.7 * slowest * (1 + 0.13 * i)
        size = reach * max(float(stiffness[i, i]), float(mass[i, i]) * rate**2)
        pushes.append((float(f"{size:.2g}"), float(f"{rate:.2g}")))
    motions.append(
        Motion(
            name="driven",
            description="a harmonic force on every joint",
            start=_start(rest, joints, signs, 0.1),
            forces=tuple(pushes),
            duration=duration,
        )
    )
    return Plan(names, search, tuple(_within(equations, m, rest, joints) for m in motions))


def _clipped(value: float, joint: Joint) -> float:
    """The value, or the middle of the limits where it is not well within them."""
    if joint.limits is None:
        return value
    low, high = joint.limits
    room = ROOM * (high - low)
    return value if low + room < value < high - room else (low + high) / 2


def _reach(rest: float, joint: Joint) -> float:
    """How far it can go to both sides."""
    if joint.limits is None:
        return math.inf if joint.hinge else 1.0
    low, high = joint.limits
    return max(min(rest - low, high - rest), 0.0)


def _start(
    rest: Array, joints: Sequence[Joint], signs: Sequence[float], size: float
) -> tuple[float, ...]:
    found = []
    for r, joint, sign in zip(rest, joints, signs, strict=True):
        wanted = size if joint.hinge else 0.15 * size
        found.append(float(f"{r + sign * min(wanted, 0.7 * _reach(r, joint)):.3g}"))
    return tuple(found)


def _rest(system: System, joints: Sequence[Joint]) -> Array:
    """A rest position within the limits, a stable one where there is one."""
    gradient = [sp.diff(system.V, q).xreplace(system.values) for q in system.q]
    slopes = compile_function(gradient, system.q)
    energy = compile_function([system.V.xreplace(system.values)], system.q)
    pulled = [q in system.V.free_symbols for q in system.q]
    middle = np.array([_clipped(0.0, joint) for joint in joints])
    if not any(pulled):
        return middle
    tries = [
        middle + np.where(pulled, 0.1 * k * (-1.0) ** np.arange(len(middle)), 0.0)
        for k in (1, -7, 13, -22)
    ]
    size = max(float(np.max(np.abs(slopes(start)))) for start in tries) or 1.0

    def sound(at: Array) -> bool:
        inside = all(_clipped(x, joint) == x for x, joint in zip(at, joints, strict=True))
        return inside and bool(np.max(np.abs(slopes(at))) < 1e-6 * size)

    found: list[Array] = []
    for start in tries:
        down = scipy.optimize.minimize(
            lambda q: float(energy(q)[0]), start, jac=slopes, method="BFGS", tol=1e-10 * size
        )
        near = scipy.optimize.least_squares(slopes, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        found += [_unwound(np.asarray(x), joints) for x in (down.x, near.x)]
        if sound(found[-2]):
            return found[-2]  # a minimum
    for at in found:
        if sound(at):
            return at
    names = ", ".join(j.name for j, p in zip(joints, pulled, strict=True) if p)
    raise NewError(
        f"no rest position within the limits was found: gravity or springs pull {names} wherever"
        " they are. A folder needs one, about which engines are linearized: give the joint a"
        " spring, or begin from `crosscheck new` without a model"
    )


def _unwound(at: Array, joints: Sequence[Joint]) -> Array:
    turns = [j.hinge and j.limits is None for j in joints]
    return np.where(turns, (at + math.pi) % (2 * math.pi) - math.pi, at)


def _named(rest: Array) -> tuple[tuple[str, ...], bool]:
    """Each as text; whether all are zero or quarter turns, and so exact, is the other half."""
    names = []
    search = False
    for value in rest:
        quarters = round(float(value) * 2 / math.pi)
        if abs(value - quarters * math.pi / 2) < 1e-5:
            names.append({0: "0", 1: "pi / 2", -1: "-pi / 2", 2: "pi", -2: "-pi"}[quarters])
        else:
            names.append(f"{value:.6g}")
            search = True
    return tuple(names), search


def _within(equations: Equations, motion: Motion, rest: Array, joints: Sequence[Joint]) -> Motion:
    """The motion, nearer to rest or shorter where it would run into limits."""
    low = np.array([-math.inf if j.limits is None else j.limits[0] for j in joints])
    high = np.array([math.inf if j.limits is None else j.limits[1] for j in joints])
    room = ROOM * np.where(np.isfinite(high - low), high - low, 0.0)
    best = motion
    lasted = 0.0
    for _ in range(4):
        free = _free(equations, motion, low + room, high - room)
        if free >= motion.duration:
            return motion
        if free > lasted:
            best, lasted = replace(motion, duration=float(f"{0.9 * free:.2g}")), free
        motion = replace(
            motion,
            start=tuple(
                float(f"{(x + r) / 2:.3g}") for x, r in zip(motion.start, rest, strict=True)
            ),
            forces=tuple((size / 2, rate) for size, rate in motion.forces),
        )
    return best


def _free(equations: Equations, motion: Motion, low: Array, high: Array) -> float:
    """How long the motion stays within bounds, s."""
    system = equations.system
    n = len(system.q)
    scenario = Scenario(
        motion.name,
        motion.description,
        q=dict(zip(system.coordinates, motion.start, strict=True)),
        v=dict.fromkeys(system.coordinates, 0),
        inputs={
            u: size * sp.sin(rate * t)
            for u, (size, rate) in zip(system.inputs, motion.forces, strict=True)
        },
        duration=motion.duration,
    )
    whole = replace(
        system,
        scenarios=(scenario,),
        equilibria=(Equilibrium("any", dict.fromkeys(system.coordinates, 0), True, "any"),),
    )
    times = np.linspace(0.0, motion.duration, 600)
    start = np.array([*motion.start, *np.zeros(n)])
    try:
        states = trajectory(equations, start, pieces(whole, scenario), times, rtol=1e-8)
    except ReferenceError as error:
        raise NewError(f"its motion can't be followed: {error}") from None
    out = ((states[:, :n] <= low) | (states[:, :n] >= high)).any(axis=1)
    return motion.duration if not out.any() else float(times[int(np.argmax(out))])
