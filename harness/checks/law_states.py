"""States of an engine in which limits, contacts, friction and drives act."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import replace

import numpy as np

from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineStep,
    ModelSpec,
    WholeModel,
    WholeState,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.reference.laws.drives import eased, holding
from physics_crosscheck.reference.laws.mechanics import Posture
from physics_crosscheck.reference.laws.soft import WITHIN, Part, gains, varies
from physics_crosscheck.reference.laws.step import LawModel, LawSolution
from physics_crosscheck.reference.mechanism.laws import ImpulseRules
from .law_comparison import Evaluated, LawComparison

STATES, SEED = 24, 20261125
"""Number of states, and the seed of their draws."""

ATTEMPTS = 3
"""Draws per state; a draw with too many contacts, or that blows up, is replaced."""

MAX_CONTACTS, MAX_SPEED = 100, 1e3
"""Bounds of a drawn state: more contacts take long, and robots are slower."""

SPREAD = 1.5
"""Controls are drawn in this multiple of their range, so that limits act."""

INSIDE = 0.2
"""Share of joints that are inside their limits."""

SIGNS = 0, 0, 0, 1, -1
"""Sides of the ranges of all controls, in turn; 0: each on another one."""

CANDIDATES, ADDED = 16, 8
"""States of each kind that are tried for parts of the laws that never act; most that are added."""

FASTEST, SMALL = 100.0, 0.01
"""Largest factor of a velocity, and largest displacement from a state of the file, rad or m."""

LONG, SHORT = 600, 40
"""Largest number of steps before a state: a fall to the floor, or a change of the contacts."""

DEEPEST = 0.02
"""Largest violation of a limit, as a share of its range."""

NEWTON_STEPS, LARGEST_STEP, SMALLEST_STEP = 10, 0.3, 1e-12
"""Iterations that put a tendon or an equality at a violation; the largest and the last one, rad."""

MAX_OUTWARD = 50.0
"""Half of the largest speed of a joint beyond its limit, rad/s or m/s."""

MAX_FORCED = 300.0
"""The same of a joint that other forces pull back so much that its limit never acted."""


def drawn_states(
    comparison: LawComparison, count: int = STATES
) -> Iterator[tuple[WholeState, EngineStep]]:
    """Yield states in which limits, contacts and drives act, with the engine's step.

    In turn: after a fall or a motion from a state of the file, with some joints that move beyond
    their limits, and at positions anywhere in the joints' ranges. Every other state has controls at
    which drives are not at a limit.
    """
    rng, model = np.random.default_rng(SEED), comparison.model
    starts = list(model.starts)
    for k in range(count):
        start = starts[k % len(starts)]
        for attempt in range(ATTEMPTS):
            state = _driven(comparison, rng, start, k // 2)
            match k % 3:
                case 0:
                    moved = _fallen(comparison, rng, state, 0 if attempt else k)
                case 1:
                    moved = _beyond(comparison, rng, state, k // 3)
                case _:
                    moved = state._replace(z=_anywhere(comparison, rng, state.z))
            speed = model.speed * rng.normal(size=len(moved.m))
            drawn = moved._replace(m=moved.m + speed)
            if k % 2 and _is_slow(drawn):
                drawn = _unsaturated(comparison, rng, drawn)
            if isinstance(model.rules, ImpulseRules):
                drawn = _pressed(comparison, model.rules, drawn)
            step = _usable_step(model, drawn)
            if step is not None:
                yield drawn, step
                break


def evaluated_states(comparison: LawComparison) -> list[Evaluated]:
    """Evaluate drawn states, and a few more at which parts of the laws act that never did."""
    evaluated = comparison.solve_steps(tuple(drawn_states(comparison)))
    if evaluated and isinstance(comparison.laws, LawModel):
        evaluated += tuple(_acting_states(comparison, comparison.laws, evaluated))
    return evaluated


class KeptSteps:
    """A model and its whole steps at drawn states, for all checks of a file in one worker."""

    def __init__(self) -> None:
        self._kept: dict[str, tuple[ModelSpec, WholeModel | None]] = {}
        self._evaluated: dict[str, list[Evaluated]] = {}
        self._comparisons: dict[str, LawComparison] = {}

    def __reduce__(self) -> tuple[type[KeptSteps], tuple[()]]:
        return KeptSteps, ()  # other processes have their own

    def model(self, engine: str, spec: ModelSpec) -> WholeModel | None:
        """Return the loaded model; errors as of `Engine.load_whole`."""
        loaded_spec, model = self._kept.get(engine, (None, None))
        if loaded_spec != spec:
            model = engines()[engine].load_whole(spec)
            self._evaluated.pop(engine, None)
            self._comparisons.pop(engine, None)
            self._kept[engine] = spec, model
        return model

    def evaluated(self, comparison: LawComparison) -> list[Evaluated]:
        """Return the evaluated states of a comparison with a kept model."""
        names = (name for name, (_, model) in self._kept.items() if model is comparison.model)
        engine = next(names, None)
        if engine is None:
            return evaluated_states(comparison)
        if engine not in self._evaluated:
            self._evaluated[engine] = evaluated_states(comparison)
        self._comparisons[engine] = comparison
        return self._evaluated[engine]

    def kept(self, engine: str) -> tuple[LawComparison | None, Sequence[Evaluated]]:
        """Return an engine's comparison and its evaluated states; nothing before `evaluated`."""
        return self._comparisons.get(engine), self._evaluated.get(engine, ())


def _acting_states(
    comparison: LawComparison, laws: LawModel, evaluated: Sequence[Evaluated]
) -> Iterator[Evaluated]:
    """Yield states at which parts of the laws act that don't elsewhere, most of them first."""
    solutions = (sample.solution for sample in evaluated)
    missing = laws.missing_parts(one for one in solutions if isinstance(one, LawSolution))
    states = _candidates(comparison, laws, missing)
    postures = list(comparison.postures(states)) if states else []
    sets = list[set[Part]]()
    for posture, state in zip(postures, states, strict=True):  # without contacts
        inputs = state.controls, state.activations, ()
        sets.append(set(laws.acting(laws.solve(posture, *inputs, np.zeros(len(posture.m))))))
    added = 0
    while added < ADDED and any(acts & missing for acts in sets):
        best = max(range(len(sets)), key=lambda k: len(sets[k] & missing))
        sets[best] = set()
        state, step = states[best], _usable_step(comparison.model, states[best])
        if step is None:
            continue
        solution = comparison.solve(postures[best], state, step)
        assert isinstance(solution, LawSolution)
        if acting := missing & set(laws.acting(solution)):  # contacts may push it back
            missing, added = missing - acting, added + 1
            yield Evaluated(state=state, solution=solution, engine=step)


def _candidates(comparison: LawComparison, laws: LawModel, parts: Set[Part]) -> list[WholeState]:
    """Return states at which some parts are likely to act, at slow and fast velocities."""
    states, ease, held = list[WholeState](), list[int](), list[int]()
    model, rng = comparison.model, np.random.default_rng(SEED + 1)
    starts = list(model.starts)
    limits = sorted(part for part in parts if part.kind == "limit")
    kinds = {part.kind for part in parts if part.way != WITHIN}
    for k in range(CANDIDATES if kinds else 0):
        state = _driven(comparison, rng, starts[k % len(starts)], k)
        fast = state._replace(m=state.m * FASTEST ** rng.uniform(-0.5, 1))
        if "limit" in kinds:
            moved = fast._replace(z=_anywhere(comparison, rng, state.z))
            states.append(_beyond(comparison, rng, moved, k))
        if kinds & {"force", "joint force", "tendon force"}:
            states.append(fast._replace(z=_anywhere(comparison, rng, state.z)))
        if kinds & {"control", "state"}:
            ease.append(len(states))
            states.append(state)
        if "dry friction" in kinds:
            held.append(len(states))
            states.append(_close(rng, state))
    for part in limits:
        elsewhere = starts[0]._replace(z=_anywhere(comparison, rng, starts[0].z))
        for start, forced in ((_close(rng, starts[0]), False), (elsewhere, True)):
            share, speed = 10 ** rng.uniform(-2, 0), MAX_OUTWARD ** rng.uniform(-1, 1)
            held.append(len(states))
            states.append(_at_limit(comparison, laws, start, part, share, speed, forced=forced))
    states += [
        _near_equality(comparison, laws, _close(rng, starts[0]), part, rng.uniform(0.2, 0.8))
        for part in sorted(parts)
        if part.kind == "equality"
    ]
    scale = laws.weights.path_accelerations
    for place, posture in zip(ease, comparison.postures([states[i] for i in ease]) if ease else (),
                              strict=True):  # fmt: skip
        state = states[place]
        by = eased(laws.laws, posture, scale, state.controls, state.activations)
        states[place] = _moved_by(comparison, state, *by)
    for place, posture in zip(held, comparison.postures([states[i] for i in held]) if held else (),
                              strict=True):  # fmt: skip
        # The drives balance the other forces along their paths.
        states[place] = states[place].driven_by(*holding(laws.laws, posture, scale))
    return states


def _moved_by(comparison: LawComparison, state: WholeState, by: Array, sped: Array) -> WholeState:
    """Return a state with other positions and velocities, by changes in the tree's order."""
    z, m = state.z.copy(), state.m.copy()
    z[comparison.order] += by
    m[comparison.order] += sped
    return state._replace(z=z, m=m)


def _at_limit(
    comparison: LawComparison,
    laws: LawModel,
    state: WholeState,
    part: Part,
    share: float,
    speed: float,
    *,
    forced: bool,
) -> WholeState:
    """Return a state beyond a limit, moving outward."""
    limit, tree, order = laws.laws.limits[part.place], laws.tree.tree, comparison.order
    way = -1 if part.way < 0 else 1
    end, depth = (limit.lower, limit.upper)[way > 0], DEEPEST * (limit.upper - limit.lower)
    if part.way == WITHIN:
        depth = limit.softness.impedance[2]
    beyond = end + way * (share * depth - (part.way == WITHIN) * limit.margin)
    if limit.joint < 0:

        def miss(posture: Posture) -> tuple[Array, Array]:
            length = posture.lengths[limit.path]
            return posture.rows[limit.path][None], np.array([length - beyond])

        moved = _moved_to(comparison, state, miss)
        row, _ = miss(next(comparison.postures([moved])))
        moved.m[order] = way * (speed + forced * MAX_OUTWARD) * np.linalg.pinv(row)[:, 0]
        return moved
    there = order[tree.velocities[limit.joint]]
    if tree.links[limit.joint].kind == "ball":
        return _turned(state, there, abs(beyond), speed + forced * MAX_OUTWARD)
    z, m, (place,) = state.z.copy(), state.m.copy(), there
    z[place] = beyond
    if forced:
        outwards = np.zeros(len(z))
        outwards[place] = way
        least = _outward_speed(comparison, state._replace(z=z), outwards, MAX_FORCED)[place]
        speed = max(speed, 1.5 * abs(least))
    m[place] = way * speed
    return state._replace(z=z, m=m)


def _near_equality(
    comparison: LawComparison, laws: LawModel, state: WholeState, part: Part, share: float
) -> WholeState:
    """Return a state that violates an equality by a share of the width of its impedance."""
    equality = laws.laws.equalities[part.place]
    single = laws.under(replace(laws.laws, equalities=(equality,), frictions=(), limits=()))

    def miss(posture: Posture) -> tuple[Array, Array]:
        rows = single.rows(posture, ())
        violation = np.array(rows.violations)
        size = max(float(np.linalg.norm(violation)), np.finfo(float).tiny)
        wanted = share * equality.softness.impedance[2] * violation / size
        return np.array(rows.jacobian), violation - wanted

    return _moved_to(comparison, state, miss)


def _moved_to(
    comparison: LawComparison,
    state: WholeState,
    miss: Callable[[Posture], tuple[Array, Array]],
) -> WholeState:
    """Return a state whose positions are moved by Newton's method, by rows and their errors."""
    for _ in range(NEWTON_STEPS):
        row, error = miss(next(comparison.postures([state])))
        moved = np.linalg.pinv(row) @ error
        largest = max(float(np.max(np.abs(moved))), np.finfo(float).tiny)
        by = -min(1.0, LARGEST_STEP / largest) * moved
        state = _moved_by(comparison, state, by, np.zeros(len(by)))
        if largest < SMALLEST_STEP:
            break
    return state


def _outward_speed(
    comparison: LawComparison, state: WholeState, outwards: Array, largest: float = MAX_OUTWARD
) -> Array:
    """Return speeds at which limits act although other forces pull joints back, (nz,).

    At them the reference of each limit resists the free acceleration. `outwards` are the signs of
    the joints that are beyond a limit, 0 for others, (nz,). No speed is above the largest one.
    """
    model, speed = comparison.laws, np.zeros(len(outwards))
    if not isinstance(model, LawModel):
        return speed
    laws, posture = model.laws, next(comparison.postures([state]))
    free = model.evaluate(posture, state.controls, state.activations, ()).problem.free
    for limit in laws.limits:
        if limit.joint >= 0:
            there = model.tree.tree.velocities[limit.joint].start
            place, softness = comparison.order[there], limit.softness
            damping = gains(softness.reference, softness.impedance[1], laws.step,
                            safe=laws.safe)[1]  # fmt: skip
            back = max(0.0, -outwards[place] * float(free[there]))
            outward = back / damping if damping else np.inf
            speed[place] = outwards[place] * min(largest, outward)
    return speed


def _turned(state: WholeState, places: Sequence[int], angle: float, speed: float) -> WholeState:
    """Return a state with a ball joint at an angle, moving on about the same axis.

    The axis is that of its coordinates, (3,), which are 4 tan(angle / 4) along it.
    """
    z, m = state.z.copy(), state.m.copy()
    size = float(np.linalg.norm(z[places]))
    axis = z[places] / size if size else np.full(3, 3**-0.5)
    z[places] = 4 * np.tan(angle / 4) * axis
    m[places] = speed * axis
    return state._replace(z=z, m=m)


def _close(rng: np.random.Generator, state: WholeState) -> WholeState:
    """Return a slow state that is close to another one."""
    near = SMALL ** rng.uniform(1, 2) * rng.normal(size=len(state.z))
    return state._replace(z=state.z + near, m=SMALL**2 * state.m)


def _is_slow(state: WholeState) -> bool:
    """Return whether a state is finite and has no number that only a blow-up has."""
    values = np.concatenate([state.z, state.m, state.activations])
    return bool(np.max(np.abs(values), initial=0.0) <= MAX_SPEED)


def _usable_step(model: WholeModel, state: WholeState) -> EngineStep | None:
    """Return the step from a state; None if it is not finite, too fast, or has many contacts."""
    if not _is_slow(state):
        return None
    step = model.evaluate(state)
    finite = np.isfinite(step.acceleration).all() and np.isfinite(step.after.m).all()
    usable = finite and step.converged and len(step.contacts) <= MAX_CONTACTS
    return step if usable else None


def _driven(
    comparison: LawComparison, rng: np.random.Generator, start: WholeState, turn: int
) -> WholeState:
    """Return a start with random velocities, controls and states of drives.

    In turn, the controls are inside and beyond both ends of their ranges, then all on one side, so
    that limits of sums act: each control is beyond each end in some of the turns. So are states.
    """
    model = comparison.model
    controls, activations = comparison.laws.drive_ranges(model.controls, model.activations)
    places = (np.arange(model.controls) + turn) % 3 - 1
    sign = SIGNS[turn % len(SIGNS)]
    inside, outside = rng.uniform(-1, 1, (2, model.controls)) + 0 * start.controls  # NaN: off
    beyond = (SPREAD + 1) / 2 + (SPREAD - 1) / 2 * outside
    share = np.where(places == 0, inside, places * beyond)
    if sign:
        share = sign * SPREAD * np.abs(inside)
    lower, upper = controls.T
    limited = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(limited, lower, -1.0), np.where(limited, upper, 1.0)
    middle, half = (low + high) / 2, (high - low) / 2
    return WholeState(
        z=start.z,
        m=0.3 * rng.normal(size=len(start.m)),
        controls=middle + half * share,
        activations=_drawn_activations(activations, rng, start.activations),
    )


def _drawn_activations(ranges: Array, rng: np.random.Generator, start: Array) -> Array:
    """Return states of drives, (activations,), up to an eighth of their ranges beyond them."""
    low, high = ranges.T
    share, limited = rng.uniform(0, 1, len(start)), np.isfinite(low) & np.isfinite(high)
    low, width = (
        np.where(limited, low, 0.0),
        np.where(limited, high, 0.0) - np.where(limited, low, 0.0),
    )
    return np.where(limited, low + width * (1.25 * share - 0.125), start + share)


def _fallen(
    comparison: LawComparison, rng: np.random.Generator, state: WholeState, turn: int
) -> WholeState:
    """Return the state after some steps.

    After the first turn a motion is long. It begins with other rotations of free and ball joints,
    and of hinges without limits, so that each side may touch.
    """
    model = comparison.model
    if not turn:
        return model.moved(state, int(rng.integers(1, SHORT)))
    z = state.z.copy()
    tree = comparison.laws.tree.tree
    for link, there in zip(tree.links, tree.velocities, strict=True):
        turns = {"free": 3, "ball": 3, "hinge": 1}.get(link.kind, 0)
        for place in comparison.order[there.start : there.start + turns]:
            if np.any(np.isinf(comparison.ranges[place])):
                z[place] += rng.normal()
    return model.moved(state._replace(z=z), int(rng.integers(LONG // 2, LONG)))


def _unsaturated(
    comparison: LawComparison, rng: np.random.Generator, state: WholeState
) -> WholeState:
    """Return a state with controls at which no drive is at a limit."""
    posture = next(comparison.postures([state]))
    shares = rng.uniform(-0.8, 0.8, comparison.laws.drive_count)
    controls, activations = comparison.laws.unsaturated(posture, shares)
    return state.driven_by(controls, activations)


def _pressed(comparison: LawComparison, rules: ImpulseRules, state: WholeState) -> WholeState:
    """Return a state whose joints beyond their limits move outward, and are not driven back."""
    model, (low, high) = comparison.model, comparison.ranges.T
    outward = np.sign(np.maximum(state.z - high, 0.0) - np.maximum(low - state.z, 0.0))
    controls = state.controls.copy()
    for i, name in enumerate(rules.controls):
        place = model.coordinates.index(name) if name in model.coordinates else -1
        if place >= 0 and outward[place] and np.isfinite(controls[i]):
            controls[i] = state.z[place]
    m = np.where(outward, outward * np.abs(state.m), state.m)
    return state._replace(m=m, controls=controls)


def _beyond(
    comparison: LawComparison, rng: np.random.Generator, state: WholeState, turn: int
) -> WholeState:
    """Return a state with half of the limited joints at a limit, up to 2 % beyond it.

    The turns put each joint at both of its limits. Balls are always beyond theirs, about any axis.
    """
    z, count = state.z, len(state.z)
    ranges, place = comparison.ranges, np.arange(count) + turn
    chosen = np.isfinite(ranges).all(axis=1) & (place % 2 == 0)
    end = place // 2 % 2
    width = np.where(chosen, ranges[:, 1] - ranges[:, 0], 0.0)
    bound = np.where(chosen, ranges[np.arange(count), end], z)
    outwards = np.where(chosen, 2 * end - 1, 0)
    sign = np.where(rng.uniform(size=count) < INSIDE, -1, 1)
    # One state of each end is deep, so that a limit that acts elsewhere shows.
    drawn = rng.uniform(-2, 0, count)
    shallow = place // 4 % 2 == 1
    depth = width * DEEPEST * np.where(shallow, 10**drawn, 1 + drawn / 4)
    margin, soft = _hardening(comparison).T
    depth = sign * np.where(shallow & (soft > 0), -drawn / 2 * soft - margin, depth)
    moved = state._replace(z=bound + outwards * depth)
    speed = _outward_speed(comparison, moved, outwards) * rng.uniform(1, 2, count)
    moved = moved._replace(m=state.m + speed)
    for i, (places, angle) in enumerate(_balls(comparison)):
        if (i + turn) % 2 == 0:
            moved.z[places] = rng.normal(size=3)
            beyond = angle * (1 + DEEPEST * 10 ** rng.uniform(-2, 0))
            moved = _turned(moved, places, beyond, 0.2 * MAX_OUTWARD * rng.uniform())
    return moved


def _hardening(comparison: LawComparison) -> Array:
    """Return margins of limits, and the widths over which they harden, (nz, 2); 0 without one."""
    model, result = comparison.laws, np.zeros((len(comparison.order), 2))
    for limit in model.laws.limits if isinstance(model, LawModel) else ():
        if limit.joint >= 0 and varies(limit.softness):
            places = comparison.order[model.tree.tree.velocities[limit.joint]]
            result[places] = limit.margin, limit.softness.impedance[2]
    return result


def _balls(comparison: LawComparison) -> Iterator[tuple[list[int], float]]:
    """Yield the engine's coordinates of each limited ball joint, and its largest angle."""
    tree = comparison.laws.tree.tree
    for joint, lower, upper in comparison.laws.limits:
        if tree.links[joint].kind == "ball":
            yield comparison.order[tree.velocities[joint]], max(lower, upper)


def _anywhere(comparison: LawComparison, rng: np.random.Generator, z: Array) -> Array:
    """Return positions anywhere in the joints' ranges."""
    ranges = comparison.ranges
    limited = np.isfinite(ranges).all(axis=1)
    low, high = (np.where(limited, end, 0.0) for end in ranges.T)
    place = low + (high - low) * rng.uniform(size=len(z))
    result = np.where(limited, place, z)
    for places, angle in _balls(comparison):
        axis = rng.normal(size=3)
        share = angle * rng.uniform()
        result[places] = 4 * np.tan(share / 4) * axis / np.linalg.norm(axis)
    return result
