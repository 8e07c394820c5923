"""Mechanisms in mpmath: d'Alembert's principle from the poses of bodies, with 40 digits.

The code uses no angular velocities, Jacobians or inertia tensors: poses are products of 4 x 4
matrices, their derivatives are finite differences with 90 digits, and a body is its second moments.
"""

from collections.abc import Sequence
from typing import Any

import mpmath as mp

from campaigns.mechanisms.mechanism import MJCF, MechanismLink, RandomMechanism

Matrix = Any
Number = Any

DIGITS = 90
STEP = mp.mpf(10) ** -22
"""Step of the differences, whose error is its square."""


def accelerations(
    mechanism: RandomMechanism, t: Number, q: Sequence[Any], v: Sequence[Any]
) -> Matrix:
    """Return qdd, a column of n."""
    n = len(q)

    def moved(direction: Sequence[Any], sign: int) -> list[Matrix]:
        return poses(mechanism, [x + sign * STEP * d for x, d in zip(q, direction, strict=True)])

    here = poses(mechanism, q)
    slopes: list[list[Matrix]] = []
    for i in range(n):
        unit = [mp.mpf(int(i == j)) for j in range(n)]
        ends = zip(moved(unit, 1), moved(unit, -1), strict=True)
        slopes.append([(b - a) / (2 * STEP) for b, a in ends])
    around = zip(moved(v, 1), moved(v, -1), here, strict=True)
    curvatures = [(b + a - 2 * x) / STEP**2 for b, a, x in around]
    falls = mp.matrix(4, 4)
    for row, g in enumerate(mechanism.gravity):
        falls[row, 3] = mp.mpf(g)
    bodies = [moments(link, mechanism.format) for link in mechanism.links]
    mass, force = mp.matrix(n), mp.matrix(n, 1)
    for i, link in enumerate(mechanism.links):
        for j in range(n):
            mass[i, j] = sum(
                _trace(slopes[i][k], body, slopes[j][k]) for k, body in enumerate(bodies)
            )
        mass[i, i] += mp.mpf(link.armature)
        force[i] = (
            -mp.mpf(link.stiffness) * (q[i] - mp.mpf(link.rest)) - mp.mpf(link.damping) * v[i]
        )
        force[i] += sum(
            _trace(slopes[i][k], b, falls - curvatures[k]) for k, b in enumerate(bodies)
        )
    for drive in mechanism.drives:
        wave = mp.sin(mp.mpf(drive.rate) * t + mp.mpf(drive.phase))
        force[drive.joint] += mp.mpf(drive.offset) + mp.mpf(drive.amplitude) * wave
    return mp.lu_solve(mass, force)


def _trace(a: Matrix, body: Matrix, b: Matrix) -> Number:
    """Return the trace of a body b^T: the virtual work of accelerations b over displacements a."""
    first = a * body
    return sum(first[r, c] * b[r, c] for r in range(3) for c in range(4))


def poses(mechanism: RandomMechanism, q: Sequence[Any]) -> list[Matrix]:
    """Return the poses of all bodies, 4 x 4."""
    frames: list[Matrix] = []
    for link, x in zip(mechanism.links, q, strict=True):
        frame = _shift(link.position) * turned(link.turn, mechanism.format)
        axis = [mp.mpf(a) for a in link.axis]
        length = mp.sqrt(sum(a * a for a in axis))
        by = x - mp.mpf(link.reference)
        if link.hinge:
            anchor = [mp.mpf(a) for a in link.anchor]
            around = _rotation([a / length * by for a in axis])
            frame = frame * _shift(anchor) * around * _shift([-a for a in anchor])
        else:
            frame = frame * _shift([a / length * by for a in axis])
        frames.append(frame if link.parent < 0 else frames[link.parent] * frame)
    return frames


def moments(link: MechanismLink, form: str) -> Matrix:
    """Integrate (x, y, z, 1) times its transpose over a body, in the body's frame, 4 x 4."""
    xx, yy, zz, xy, xz, yz = (mp.mpf(x) for x in (*link.inertia, 0.0, 0.0, 0.0)[:6])
    half = (xx + yy + zz) / 2
    body = mp.zeros(4)
    for (i, j), value in {
        (0, 0): half - xx, (1, 1): half - yy, (2, 2): half - zz,
        (0, 1): -xy, (0, 2): -xz, (1, 2): -yz,
    }.items():  # fmt: skip
        body[i, j] = body[j, i] = value
    body[3, 3] = mp.mpf(link.mass)
    frame = _shift(link.centre) * turned(link.inertial_turn, form)
    return frame * body * frame.T


def turned(turn: Sequence[float], form: str) -> Matrix:
    numbers = [mp.mpf(x) for x in turn]
    if not numbers:
        return mp.eye(4)
    if form == MJCF:
        sine = mp.sqrt(sum(x * x for x in numbers[1:]))
        angle = 2 * mp.atan2(sine, numbers[0])
        return _rotation([x / sine * angle for x in numbers[1:]])
    roll, pitch, yaw = numbers
    return _rotation([0, 0, yaw]) * _rotation([0, pitch, 0]) * _rotation([roll, 0, 0])


def _rotation(vector: Sequence[Any]) -> Matrix:
    x, y, z = vector
    cross = mp.matrix([[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, 0], [0, 0, 0, 0]])
    angle = mp.sqrt(x * x + y * y + z * z)
    if angle == 0:
        return mp.eye(4)
    return (
        mp.eye(4)
        + cross * (mp.sin(angle) / angle)
        + cross * cross * (2 * (mp.sin(angle / 2) / angle) ** 2)
    )


def _shift(by: Sequence[Any]) -> Matrix:
    frame = mp.eye(4)
    for row, x in enumerate(by):
        frame[row, 3] = mp.mpf(x)
    return frame


def end(mechanism: RandomMechanism, t: float, state: Sequence[float], length: float) -> list[Any]:
    """Return (q, v) after a segment by Gragg's modified midpoint rule, extrapolated to order 16."""
    n = len(state) // 2
    table: list[list[Any]] = []
    counts = [2 * (k + 1) for k in range(8)]

    def slope(time: Number, y: list[Any]) -> list[Any]:
        return [*y[n:], *accelerations(mechanism, time, y[:n], y[n:])]

    for k, count in enumerate(counts):
        h = mp.mpf(length) / count
        before = [mp.mpf(x) for x in state]
        here = [x + h * s for x, s in zip(before, slope(mp.mpf(t), before), strict=True)]
        for i in range(1, count):
            s = slope(mp.mpf(t) + i * h, here)
            before, here = here, [x + 2 * h * d for x, d in zip(before, s, strict=True)]
        row = [here]
        for j in range(1, k + 1):
            factor = (mp.mpf(count) / counts[k - j]) ** 2 - 1
            last, other = row[-1], table[k - 1][j - 1]
            row.append([a + (a - b) / factor for a, b in zip(last, other, strict=True)])
        table.append(row)
    return list(table[-1][-1])
