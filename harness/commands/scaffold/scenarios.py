"""Choose the rest position and the motions to compare, from equations and limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize
import sympy as sp

from physics_crosscheck.harness.commands.scaffold.constants import quarter
from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.commands.scaffold.mechanism import FormulaJoint
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.mechanism.declaration import Scenario, t
from physics_crosscheck.reference.mechanism.numeric import Array, compile_function
from physics_crosscheck.reference.mechanism.signal import pieces
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.integrate import ReferenceError, trajectory

PERIODS = 10
SHORTEST, LONGEST = 2.0, 15.0
"""Minimum and maximum duration of a scenario in seconds, before limits shorten it."""
MOST_SEGMENTS = 1500
STILL = 1e-3
"""Metres or radians: a joint that moves less in a motion gets an initial velocity."""


@dataclass(frozen=True, kw_only=True)
class ScenarioMotion:
    """A scenario of n joints.

    Attributes:
        start, speeds: initial positions and velocities, (n,).
        hold: constant forces, (n,).
        forces: additional sines, (amplitude, rate) each.
        duration: seconds.
    """

    name: str
    description: str
    start: tuple[float, ...]
    speeds: tuple[float, ...]
    hold: tuple[float, ...]
    forces: tuple[tuple[float, float], ...]
    duration: float

    @property
    def inputs(self) -> tuple[str, ...]:
        """Each force over time, as a formula of t."""
        return tuple(
            " + ".join([f"{held:g}"] * bool(held) + [f"{size:g} * sin({rate:g} * t)"] * bool(size))
            or "0"
            for held, (size, rate) in zip(self.hold, self.forces, strict=True)
        )


@dataclass(frozen=True)
class ScenarioPlan:
    """A rest position, whether it is approximate (`search`), and the scenarios."""

    rest: tuple[str, ...]
    search: bool
    motions: tuple[ScenarioMotion, ...]

    def lines(self, joints: Sequence[FormulaJoint], forces: Sequence[str]) -> list[str]:
        """Return the lines of system.py that declare the plan."""
        position = ", ".join(f"{j.symbol}: {r}" for j, r in zip(joints, self.rest, strict=True))
        lines = [
            "    # search=True: near there; False: exactly there.",
            "    equilibria=(",
            f'        Equilibrium("rest", at={{{position}}}, search={self.search},',
            '                    description="where it rests"),',
            "    ),",
            "    scenarios=(",
        ]
        for m in self.motions:
            q = ", ".join(f"{j.symbol}: {x:g}" for j, x in zip(joints, m.start, strict=True))
            v = ", ".join(f"{j.symbol}: {x:g}" for j, x in zip(joints, m.speeds, strict=True))
            u = ", ".join(f"{f}: {text}" for f, text in zip(forces, m.inputs, strict=True))
            lines += [
                f'        Scenario("{m.name}", "{m.description}",',
                f"                 q={{{q}}},",
                f"                 v={{{v}}},",
                f"                 inputs={{{u}}},",
                f"                 duration={m.duration:g}),",
            ]
        return [*lines, "    ),"]


def provisional(joints: Sequence[FormulaJoint]) -> ScenarioPlan:
    """Return a placeholder plan that makes a declaration complete."""
    middle = tuple(f"{clipped(0.0, joint):g}" for joint in joints)
    still = tuple((0.0, 1.0) for _ in joints)
    return ScenarioPlan(
        middle,
        True,
        (
            ScenarioMotion(
                name="any",
                description="any",
                start=tuple(map(float, middle)),
                speeds=tuple(0.0 for _ in joints),
                hold=tuple(0.0 for _ in joints),
                forces=still,
                duration=1.0,
            ),
        ),
    )


def plan(system: System, joints: Sequence[FormulaJoint]) -> ScenarioPlan:
    """Choose a rest position, and motions within the joints' limits.

    If it rests at a limit or beyond (a spring can hold a joint there), motions are about the middle
    of the range, with constant holding forces.

    Raises:
        NewError: if there is no rest position.
    """
    equations = derive(system)
    rest = rest_position(system, joints)
    names, search = named_position(rest, joints)
    centre = np.array([clipped(r, joint) for r, joint in zip(rest, joints, strict=True)])
    linear = _Linear.about(equations, centre)
    held = bool(np.any(centre != rest))
    hold = tuple(float(f"{f:.3g}") if held else 0.0 for f in linear.holding)
    about = "the middle of its range, held there" if held else "where it rests"
    slowest, duration = linear.slowest, linear.duration
    signs = [(1.0, -0.6, 0.8, -0.4)[i % 4] for i in range(len(rest))]
    still = tuple((0.0, 1.0) for _ in joints)
    sizes = [("free", f"released away from {about}", 0.7, still)]
    if any(
        joint.hinge and _distance(r, joint) > 2 for r, joint in zip(centre, joints, strict=True)
    ):
        sizes.append(("large", f"released far away from {about}", 2.2, still))
    pushes = []
    for i, joint in enumerate(joints):
        distance = min(0.3 * _distance(centre[i], joint), 0.4 if joint.hinge else 0.1)
        rate = 0.7 * slowest * (1 + 0.13 * i)
        size = distance * max(float(linear.stiffness[i, i]), float(linear.mass[i, i]) * rate**2)
        pushes.append((float(f"{size:.2g}"), float(f"{rate:.2g}")))
    sizes.append(("driven", "a harmonic force on every joint", 0.1, tuple(pushes)))
    motions = []
    for name, description, size, forces in sizes:
        motion = ScenarioMotion(
            name=name,
            description=description,
            start=_start(centre, joints, signs, size),
            speeds=tuple(0.0 for _ in joints),
            hold=hold,
            forces=forces,
            duration=duration,
        )
        motion = _moving(equations, motion, centre, joints, linear)
        if not any(motion.speeds) or not _uniform(equations, motion):
            motions.append(_within(equations, motion, centre, joints))
    return ScenarioPlan(names, search, tuple(motions))


@dataclass(frozen=True, kw_only=True)
class _Linear:
    """Equations linearized about a position, at rest.

    Attributes:
        mass, damping, stiffness: (n, n).
        holding: forces that hold it there, (n,).
        slowest: slowest rate, rad/s.
        duration: duration of a scenario, seconds.
    """

    mass: Array
    damping: Array
    stiffness: Array
    holding: Array
    slowest: float
    duration: float

    @staticmethod
    def about(equations: Equations, position: Array) -> _Linear:
        """Linearize equations about a position, and estimate the slowest rate there."""
        system, n = equations.system, len(position)
        zero = dict.fromkeys((*system.v, *system.u, t), sp.Integer(0))
        force = sp.Matrix([f.xreplace(zero) for f in equations.force])
        # The derivative of the whole force is long; its extra terms vanish at v = 0.
        damping = sp.hessian(system.D, system.v).xreplace(zero)
        entries = [*equations.mass, *damping, *(-force.jacobian(system.q)), *(-force)]
        values = equations.compile(entries)(position, np.zeros(n), np.zeros(n), np.zeros(1))
        mass, slowing, stiffness = values[: 3 * n * n].reshape(3, n, n)
        rates = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass, eigvals_only=True)
        real = np.sqrt(rates[rates > 1e-9 * max(np.max(np.abs(rates)), 1e-9)])
        slowest, fastest = (float(real.min()), float(real.max())) if real.size else (2.0, 2.0)
        duration = min(
            max(PERIODS * 2 * math.pi / slowest, SHORTEST),
            LONGEST,
            MOST_SEGMENTS * 2 * math.pi / (20 * fastest),
        )
        return _Linear(
            mass=mass,
            damping=slowing,
            stiffness=stiffness,
            holding=values[3 * n * n :],
            slowest=slowest,
            duration=float(f"{duration:.2g}"),
        )


def _moving(
    equations: Equations,
    motion: ScenarioMotion,
    centre: Array,
    joints: Sequence[FormulaJoint],
    linear: _Linear,
) -> ScenarioMotion:
    """Add an initial velocity for each joint that would hardly move in a motion.

    A hinge with a vertical axis has no restoring force: released, it stays. The velocity takes it
    about to the other side of the centre, which is within its limits.
    """
    n = len(joints)
    places = _states(equations, motion)[1][:, :n]
    speeds = []
    for i, joint in enumerate(joints):
        speed = 0.0
        if np.ptp(places[:, i]) < STILL:
            start = float(motion.start[i] - centre[i])
            speed = 0.5 if joint.hinge else 0.1
            if joint.limits is not None or linear.damping[i, i] > 0:
                # Damping limits the distance; the joint covers it within the damping time.
                slowing = float(linear.damping[i, i] / linear.mass[i, i])
                lasting = 1 / max(slowing, 1 / motion.duration)
                speed = min(2 * abs(start) / lasting, 4 * speed)
            speed = -math.copysign(speed, start)
        speeds.append(float(f"{speed:.3g}"))
    return replace(motion, speeds=tuple(speeds))


def _uniform(equations: Equations, motion: ScenarioMotion) -> bool:
    """Return whether nothing accelerates: such a motion depends on no number of the model."""
    speeds = _states(equations, motion)[1][:, len(motion.start) :]
    return bool(np.max(np.ptp(speeds, axis=0)) <= 1e-6 * np.max(np.abs(speeds)))


def _distance(rest: float, joint: FormulaJoint) -> float:
    """Return the distance that a joint can move in both directions."""
    if joint.limits is None:
        return math.inf if joint.hinge else 1.0
    low, high = joint.limits
    return max(min(rest - low, high - rest), 0.0)


def _start(
    rest: Array, joints: Sequence[FormulaJoint], signs: Sequence[float], size: float
) -> tuple[float, ...]:
    distances = []
    for r, joint, sign in zip(rest, joints, signs, strict=True):
        wanted = size if joint.hinge else 0.15 * size
        distances.append(float(f"{r + sign * min(wanted, 0.7 * _distance(r, joint)):.3g}"))
    return tuple(distances)


def _within(
    equations: Equations, motion: ScenarioMotion, rest: Array, joints: Sequence[FormulaJoint]
) -> ScenarioMotion:
    """Scale a motion towards rest, or shorten it, to stay within limits."""
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
            speeds=tuple(float(f"{v / 2:.3g}") for v in motion.speeds),
            forces=tuple((size / 2, rate) for size, rate in motion.forces),
        )
    return best


def _free(equations: Equations, motion: ScenarioMotion, low: Array, high: Array) -> float:
    """Return how long a motion stays within bounds, s."""
    times, states = _states(equations, motion)
    places = states[:, : len(low)]
    out = ((places <= low) | (places >= high)).any(axis=1)
    return motion.duration if not out.any() else float(times[int(np.argmax(out))])


def _states(equations: Equations, motion: ScenarioMotion) -> tuple[Array, Array]:
    """Return times, (600,), and states along a motion, (600, 2n).

    Raises:
        NewError: if the integration fails.
    """
    system = equations.system
    scenario = Scenario(
        motion.name,
        motion.description,
        q=dict(zip(system.coordinates, motion.start, strict=True)),
        v=dict(zip(system.coordinates, motion.speeds, strict=True)),
        inputs={
            u: held + size * sp.sin(rate * t)
            for u, held, (size, rate) in zip(system.inputs, motion.hold, motion.forces, strict=True)
        },
        duration=motion.duration,
    )
    times = np.linspace(0.0, motion.duration, 600)
    start = np.array([*motion.start, *motion.speeds])
    try:
        return times, trajectory(equations, start, pieces(system, scenario), times, rtol=1e-8)
    except ReferenceError as error:
        raise NewError(f"its motion can't be solved: {error}") from None


ROOM = 0.02
"""Share of a joint's range that a motion keeps clear at both ends."""


def clipped(value: float, joint: FormulaJoint) -> float:
    """Return the value, or the middle of the limits if it is too close to them."""
    if joint.limits is None:
        return value
    low, high = joint.limits
    room = ROOM * (high - low)
    return value if low + room < value < high - room else (low + high) / 2


def rest_position(system: System, joints: Sequence[FormulaJoint]) -> Array:
    """Return a stable rest position well within the limits, if there is one.

    Otherwise return one at a limit or beyond it, for example if a spring holds a joint at its
    limit.

    Raises:
        NewError: if there is no rest position.
    """
    gradient = [sp.diff(system.V, q).xreplace(system.values) for q in system.q]
    slopes = compile_function(gradient, system.q)
    energy = compile_function([system.V.xreplace(system.values)], system.q)
    pulled = [q in system.V.free_symbols for q in system.q]
    middle = np.array([clipped(0.0, joint) for joint in joints])
    if not any(pulled):
        return middle
    tries = [
        middle + np.where(pulled, 0.1 * k * (-1.0) ** np.arange(len(middle)), 0.0)
        for k in (1, -7, 13, -22)
    ]
    size = max(float(np.max(np.abs(slopes(start)))) for start in tries) or 1.0

    def rests(position: Array) -> bool:
        return bool(np.max(np.abs(slopes(position))) < 1e-6 * size)

    def inside(position: Array) -> bool:
        return all(clipped(x, joint) == x for x, joint in zip(position, joints, strict=True))

    candidates: list[Array] = []
    for start in tries:
        down = scipy.optimize.minimize(
            lambda q: float(energy(q)[0]), start, jac=slopes, method="BFGS", tol=1e-10 * size
        )
        near = scipy.optimize.least_squares(slopes, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        candidates += [_unwound(np.asarray(x), joints) for x in (down.x, near.x)]
        if rests(candidates[-2]) and inside(candidates[-2]):
            return candidates[-2]  # a minimum
    if resting := [at for at in candidates if rests(at)]:
        return min(resting, key=lambda at: (not inside(at), float(np.max(np.abs(at - middle)))))
    names = ", ".join(j.name for j, p in zip(joints, pulled, strict=True) if p)
    raise NewError(
        "no rest position found, within the limits or beyond: gravity or springs "
        f"always pull {names}. A folder needs one to linearize engines about: give "
        "the joint a spring, or use `crosscheck new` without a model"
    )


def _unwound(position: Array, joints: Sequence[FormulaJoint]) -> Array:
    turns = [j.hinge and j.limits is None for j in joints]
    return np.where(turns, (position + math.pi) % (2 * math.pi) - math.pi, position)


def named_position(rest: Array, joints: Sequence[FormulaJoint]) -> tuple[tuple[str, ...], bool]:
    """Return each coordinate as text, and whether one is neither zero nor a quarter turn."""
    names = []
    search = False
    for value, joint in zip(rest, joints, strict=True):
        quarters = round(float(value) * 2 / math.pi) if joint.hinge else 0
        if abs(value - quarters * math.pi / 2) < 1e-5:
            names.append(quarter(quarters * math.pi / 2) or "0")
        else:
            names.append(f"{value:.6g}")
            search = True
    return tuple(names), search
