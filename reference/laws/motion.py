"""Motions with events: smooth stretches between impacts, changes of friction and of drives.

Each stretch has the equations of its mode, and is solved as a smooth motion is. Events are roots of
the modes' guards. At an impact velocities jump by Newton's restitution, with friction that sticks
where the needed impulse is inside the cone (Pfeiffer and Glocker 1996, chapter 8).

Segments are laid by the events: each is free of events, or has one in its middle.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

import numpy as np
import sympy as sp

from physics_crosscheck.reference.dynamics.derive import Equations
from physics_crosscheck.reference.mechanism.declaration import DeclarationError, Scenario, about
from physics_crosscheck.reference.mechanism.laws import SoftLaw
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction
from physics_crosscheck.reference.mechanism.signal import SignalPiece, numeric_inputs, pieces
from physics_crosscheck.reference.solving.bounds import with_bounds
from physics_crosscheck.reference.solving.collocation import collocate
from physics_crosscheck.reference.solving.integrate import (
    ReferenceError,
    by_runge_kutta,
    checked_bound,
    field_of,
    solve_numerically,
)
from physics_crosscheck.reference.solving.segments import (
    EventMark,
    Motion,
    PressedContact,
    Segments,
    Span,
    chebyshev_nodes,
)
from physics_crosscheck.reference.solving.solve import (
    SEGMENTS_A_PERIOD,
    SEGMENTS_AT_LEAST,
    fastest_rate,
    start_of,
)
from .modes import FREE, Contacting, ModeEquations, Modes, Part, mode_equations, parts_of

TOUCH = 1e-9
"""Largest value of an expression that counts as zero when a mode begins, relative to the state."""

SOON_SHARE = 1e-4
"""Share of a segment after which the guards of a new mode must be positive."""

LEAST_SHARE = 1e-3
"""Smallest length of segments near close events, relative to those of a smooth motion."""

OVERSHOOT = 1.5
"""Length of a step over the time to the next event, as guards predict it linearly."""

MOST_EVENTS = 200
"""Events after which a motion is refused."""


class EventError(ReferenceError):
    """An event that has no unique continuation; the message names the configuration."""

    kind = "event"


@dataclass(frozen=True, kw_only=True)
class Event:
    """One event of a motion.

    Attributes:
        mark: its time, its interactions, and how they change.
        before, after: states, (2n,).
    """

    mark: EventMark
    before: Array
    after: Array

    @property
    def time(self) -> float:
        """Time, s."""
        return self.mark.time


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A smooth stretch of a motion: its mode, start and stop (s), and the state at its start."""

    mode: ModeEquations
    start: float
    stop: float
    state: Array


@dataclass(kw_only=True)
class Hybrid:
    """A system with interactions: its modes, and the transitions between them.

    Attributes:
        equations: without interactions.
        parts: the interactions.
        signal: the inputs.
        derived: equations of the modes that were reached.
        beginnings: expressions that are zero when a mode begins.
        largest: largest rates so far, (2n,); those of a mechanism that comes to rest vanish.
    """

    equations: Equations
    parts: tuple[Part, ...]
    signal: SignalPiece
    derived: dict[Modes, ModeEquations | None] = field(default_factory=dict)
    beginnings: dict[Modes, NumericFunction] = field(default_factory=dict)
    largest: Array | None = None

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.equations.system.coordinates)

    def mode(self, modes: Modes) -> ModeEquations | None:
        """Return the equations of a mode; None if its closed rows are dependent."""
        if modes not in self.derived:
            try:
                self.derived[modes] = mode_equations(self.equations, self.parts, modes)
            except ZeroDivisionError:
                self.derived[modes] = None
        return self.derived[modes]

    def zeros(self, modes: Modes) -> NumericFunction:
        """Return expressions of (q, v, u, (t,)) that are zero when a mode begins."""
        if modes not in self.beginnings:
            each_part = [part.contribution(m) for part, m in zip(self.parts, modes, strict=True)]
            wanted = [zero for each in each_part for zero in each.zeros]
            self.beginnings[modes] = self.equations.compile(wanted)
        return self.beginnings[modes]

    def evaluate(self, function: NumericFunction, time: Array, states: Array) -> Array:
        """Return a function of (q, v, u, (t,)) at states (B, 2n)."""
        u = self.signal.numeric(time[:, None])
        return function(states[:, : self.n], states[:, self.n :], u, time[:, None])

    def flow(self, mode: ModeEquations, time: float, state: Array, length: float) -> Array:
        """Return the states at the Chebyshev nodes of a stretch, (NODES, 2n)."""
        rates, times = field_of(mode.equations, self.signal), np.array([time])
        here = np.abs(rates(times, state[None])[0])
        self.largest = here if self.largest is None else np.maximum(here, self.largest)
        floor = np.maximum(self.largest, 1e-300)
        nodes: Array = collocate(rates, times, state[None], length, floor=floor)[1][0]
        return nodes

    def end(self, mode: ModeEquations, time: float, state: Array, length: float) -> Array:
        """Return the state after a stretch, (2n,); `length` may be negative."""
        end: Array = self.flow(mode, time, state, length)[-1]
        return end

    def begins(self, modes: Modes, time: float, state: Array, soon: float) -> bool:
        """Return whether a mode can begin: its guards are positive soon, and its zeros are zero."""
        times, here = np.array([time]), state[None]
        zeros = self.evaluate(self.zeros(modes), times, here)
        # Before the mode is derived, which takes longer.
        if np.any(np.abs(zeros) > TOUCH * (1 + np.abs(state).max())):
            return False
        mode = self.mode(modes)
        if mode is None:
            return False
        if np.any(self.evaluate(mode.guards, times, here) < -TOUCH * self.sizes(mode, time, state)):
            return False
        later = self.end(mode, time, state, soon)
        return bool(np.all(self.evaluate(mode.guards, times + soon, later[None]) > 0))

    def sizes(self, mode: ModeEquations, time: float, state: Array) -> Array:
        """Return magnitudes of a mode's guards near a state, (G,)."""
        size = np.abs(self.evaluate(mode.guards, np.array([time]), 1.01 * state[None]))
        sizes: Array = np.maximum(1.0, size[0])
        return sizes

    def next_mode(
        self, time: float, state: Array, changing: Mapping[int, tuple[str, ...]],
        now: Modes, soon: float,
    ) -> ModeEquations:  # fmt: skip
        """Return the one mode that can begin, where some parts may change.

        Raises:
            EventError: if none, or more than one, can.
        """
        choices = [changing.get(i, (mode,)) for i, mode in enumerate(now)]
        fitting = [m for m in product(*choices) if self.begins(m, time, state, soon)]
        if len(fitting) == 1 and (mode := self.mode(fitting[0])) is not None:
            return mode
        if len(fitting) > 1:
            raise EventError(
                f"at t = {time:.6g} s the motion is not unique (a Painleve configuration, or "
                f"dependent contacts): {' or '.join(map(str, fitting))}"
            )
        raise EventError(
            f"at t = {time:.6g} s no mode of {self.names(changing)} can begin (a Painleve "
            "configuration, or more closed contacts than the equations determine)"
        )

    def names(self, parts: Mapping[int, object] | Sequence[int]) -> str:
        """Return the names of parts."""
        return ", ".join(self.parts[i].name for i in parts)


def solve_events(
    equations: Equations, scenario: Scenario, laws: Mapping[str, SoftLaw] | None = None
) -> Motion:
    """Return the motion of a system with interactions; its segments avoid or centre its events.

    Args:
        equations: of the energies.
        scenario: of the system.
        laws: soft laws in place of rigid contacts and friction, by name.

    Raises:
        EventError: for a motion that is not unique, and for events too close to compare.
        DeclarationError, ReferenceError: as `solve`.
    """
    with about("Scenario", scenario.name):
        hybrid = hybrid_of(equations, scenario, laws or {})
        stretches, events, fastest = march(hybrid, scenario)
        return lay_segments(hybrid, stretches, events, fastest)


def hybrid_of(equations: Equations, scenario: Scenario, laws: Mapping[str, SoftLaw]) -> Hybrid:
    """Return a system's modes under the inputs of a scenario.

    Raises:
        DeclarationError: if an input has breaks.
    """
    system = equations.system
    signals = pieces(system, scenario)
    if len(signals) > 1:
        raise DeclarationError(
            f"system {system.name!r}, scenario {scenario.name!r}: inputs with breaks are not "
            "supported beside contacts, friction or drives; use one scenario for each inputs"
        )
    home = dict.fromkeys(system.q, sp.Integer(0))
    parts = parts_of(equations, system.interactions, laws, home)
    return Hybrid(equations=equations, parts=parts, signal=signals[0])


def march(hybrid: Hybrid, scenario: Scenario) -> tuple[list[Stretch], list[Event], float]:
    """Follow a motion from event to event; return its stretches, events and fastest rate, rad/s.

    Raises:
        EventError: as `solve_events`.
    """
    duration = float(scenario.duration)
    state, time = start_of(hybrid.equations.system, scenario), 0.0
    soon = SOON_SHARE * duration / SEGMENTS_AT_LEAST
    every = {i: part.modes for i, part in enumerate(hybrid.parts)}
    try:
        mode = hybrid.next_mode(time, state, every, tuple(FREE for _ in every), soon)
    except EventError:
        _check_start(hybrid, state)
        raise
    stretches, events = list[Stretch](), list[Event]()
    fastest = 0.0
    while True:
        rate = _rate(hybrid, mode, time, state)
        fastest = max(fastest, rate)
        step = _step(rate, duration)
        stop, before, guards = _until_event(hybrid, mode, time, state, step, duration)
        stretches.append(Stretch(mode=mode, start=time, stop=stop, state=state))
        if not guards:
            return stretches, events, fastest
        crossed = sorted({mode.owners[g] for g in guards})
        check_room(stop - time, _step(fastest, duration), time)
        if len(events) == MOST_EVENTS:
            raise EventError(f"more than {MOST_EVENTS} events before t = {stop:.6g} s")
        after, changing = _jump(hybrid, mode, stop, before, crossed)
        ended, mode = mode, hybrid.next_mode(stop, after, changing, mode.modes, SOON_SHARE * step)
        mark = EventMark(
            time=stop,
            part=hybrid.names(crossed),
            change=_change(ended.modes, mode.modes, crossed),
            guards=ended.guards,
            guard=guards[0],
        )
        events.append(Event(mark=mark, before=before, after=after))
        time, state = stop, after


def _check_start(hybrid: Hybrid, state: Array) -> None:
    """Raise an error that names a rigid contact in which the motion starts, or an impact."""
    for part in hybrid.parts:
        if not isinstance(part, Contacting) or part.law is not None:
            continue
        numbers = hybrid.equations.compile([part.gap, part.rate.value])
        gap, rate = hybrid.evaluate(numbers, np.zeros(1), state[None])[0].tolist()
        if gap < -TOUCH:
            raise EventError(
                f"the motion starts inside {part.name}, where the gap is {gap:.4g} m; start it "
                "where no gap is negative"
            )
        if gap < TOUCH and rate < 0:
            raise EventError(
                f"the motion starts with an impact: {part.name} is closed, and its gap falls by "
                f"{-rate:.4g} m/s; start it earlier, or with the velocity after the impact"
            )


def _change(before: Modes, after: Modes, crossed: Sequence[int]) -> str:
    """Return how the modes of some parts change, in words."""
    changes = ["impact" if before[i] == after[i] else f"{before[i]} to {after[i]}" for i in crossed]
    return ", ".join(dict.fromkeys(changes))


def _rate(hybrid: Hybrid, mode: ModeEquations, time: float, state: Array) -> float:
    inputs = replace(hybrid.signal, start=0.0, stop=max(hybrid.signal.stop, time))
    return fastest_rate(mode.equations, (inputs,), np.array([time]), state[None])


def _step(rate: float, duration: float) -> float:
    """Return the length of a segment, s."""
    wanted = max(SEGMENTS_A_PERIOD * rate / (2 * np.pi), SEGMENTS_AT_LEAST / duration)
    return 1 / wanted


def _until_event(
    hybrid: Hybrid, mode: ModeEquations, time: float, state: Array, step: float, duration: float
) -> tuple[float, Array, list[int]]:
    """Return the time and state of the next event, and its guards; at the duration, none."""
    share = chebyshev_nodes()
    while time < duration:
        length = min(_step_to_event(hybrid, mode, time, state, step), duration - time)
        inside = hybrid.flow(mode, time, state, length)
        values = hybrid.evaluate(mode.guards, time + length * share, inside)
        below = (values[1:] <= 0).any(axis=1)
        if below.any():
            node = int(np.argmax(below)) + 1
            low = share[node - 1] * length if node > 1 else SOON_SHARE * length / 2
            roots = {
                g: _root(hybrid, mode, time, state, g, (low, float(share[node]) * length))
                for g in np.flatnonzero(values[node] <= 0).tolist()
            }
            first = min(roots.values())
            together = [g for g, root in roots.items() if root - first <= 1e-12 * length]
            return time + first, hybrid.end(mode, time, state, first), together
        time, state = time + length, inside[-1]
    return duration, state, []


def _step_to_event(
    hybrid: Hybrid, mode: ModeEquations, time: float, state: Array, step: float
) -> float:
    """Return a length that goes little beyond the next event, where formulas may be singular."""
    soon = SOON_SHARE * step
    # An Euler step suffices, since only the length of a step follows from it.
    rates = field_of(mode.equations, hybrid.signal)
    later = state + soon * rates(np.array([time]), state[None])[0]
    now, then = hybrid.evaluate(
        mode.guards, np.array([time, time + soon]), np.stack([state, later])
    )
    falling = (then < now) & (then > 0)
    if not falling.any():
        return step
    remaining = float(np.min(then[falling] / (now - then)[falling])) * soon
    return min(step, max(OVERSHOOT * remaining, 2 * soon))


def _root(
    hybrid: Hybrid, mode: ModeEquations, time: float, state: Array, guard: int,
    bracket: tuple[float, float],
) -> float:  # fmt: skip
    """Return the time after `time` at which a guard crosses zero, to the last digits."""
    from scipy.optimize import brentq  # slow import

    def value(length: float) -> float:
        there = hybrid.end(mode, time, state, length)
        return float(hybrid.evaluate(mode.guards, np.array([time + length]), there[None])[0, guard])

    low, high = bracket
    if value(low) <= 0:
        raise EventError(
            f"an event at t = {time + low:.6g} s follows the last one within {low:.1e} s; "
            f"impacts that accumulate have no end; end the motion before t = {time:.6g} s"
        )
    return float(brentq(value, low, high, xtol=1e-16, rtol=4 * np.finfo(float).eps))


def _jump(
    hybrid: Hybrid, mode: ModeEquations, time: float, state: Array, crossed: Sequence[int]
) -> tuple[Array, dict[int, tuple[str, ...]]]:
    """Return the state after an event, and the modes that its parts can take.

    Raises:
        EventError: for simultaneous impacts that act on each other.
    """
    changing = {i: hybrid.parts[i].modes for i in crossed}
    hits = [
        part
        for i in crossed
        if isinstance(part := hybrid.parts[i], Contacting)
        and part.law is None
        and mode.modes[i] == FREE
    ]
    if not hits:
        return state, changing
    closed = {
        i: part
        for i, (part, now) in enumerate(zip(hybrid.parts, mode.modes, strict=True))
        if isinstance(part, Contacting) and part.law is None and now != FREE
    }
    after, parting = impact(hybrid, time, state, hits, closed)
    return after, changing | dict.fromkeys(parting, (FREE,))


def impact(
    hybrid: Hybrid, time: float, state: Array, hits: Sequence[Contacting],
    closed: Mapping[int, Contacting],
) -> tuple[Array, list[int]]:  # fmt: skip
    """Return the state after impacts, (2n,), and the closed contacts that separate.

    Velocities jump by Newton's restitution and Coulomb's friction. A closed contact that separates
    has no impulse: a box that rocks leaves one edge as the other one lands.

    Raises:
        EventError: if several contacts act on each other at once.
    """
    n, times, here = hybrid.n, np.array([time]), state[None]
    mass = hybrid.evaluate(hybrid.equations.numeric_mass, times, here).reshape(n, n)

    def rows(part: Contacting) -> tuple[Array, float, Array, float, float, float]:
        slip = part.slip or replace(part.rate, value=sp.Integer(0), row=sp.zeros(1, n))
        values = [*part.rate.row, part.rate.value, *slip.row, slip.value, part.mu, part.e]
        numbers = hybrid.evaluate(hybrid.equations.compile(values), times, here)[0]
        return (numbers[:n], numbers[n], numbers[n + 1 : 2 * n + 1], *numbers[2 * n + 1 :])

    def coupled(part: Contacting, others: Iterable[Contacting]) -> Contacting | None:
        smallest = TOUCH * np.abs(np.linalg.inv(mass)).max()
        pushed = np.linalg.solve(mass, rows(part)[0])
        return next((o for o in others if abs(rows(o)[0] @ pushed) > smallest), None)

    velocity = state[n:].copy()
    for part in hits:
        normal, approach, across, slip, mu, e = rows(part)
        velocity += np.linalg.solve(
            mass, _impulse(mass, normal, across, approach, slip, mu=mu, e=e)
        )
    parting = list[int]()
    for i, part in enumerate(hits):
        _check_single(time, part, coupled(part, hits[:i]))
    for i, part in closed.items():
        other = coupled(part, hits)
        if other is not None and rows(part)[0] @ velocity > TOUCH * np.abs(velocity).max():
            parting.append(i)
        else:
            _check_single(time, part, other)
    return np.concatenate([state[:n], velocity]), parting


def _check_single(time: float, part: Contacting, other: Contacting | None) -> None:
    if other is not None:
        raise EventError(
            f"at t = {time:.6g} s {part.name} and {other.name} act at once; simultaneous "
            "impacts have no unique outcome; separate them"
        )


def _impulse(
    mass: Array, normal: Array, across: Array, approach: float, slip: float, *, mu: float, e: float
) -> Array:
    """Return the generalized impulse of one impact, (n,).

    Friction is inside the cone of the whole normal impulse, as in impulse engines. Without coupling
    between both directions, Poisson's compression and restitution give the same impulse.

    Raises:
        EventError: if the impact jams, or gains energy.
    """
    both, before = np.stack([normal, across]), np.array([approach, slip])
    mobility = both @ np.linalg.solve(mass, both.T)
    wanted = -(1 + e) * approach
    rough = mu > 0 and bool(np.any(across))
    sticking = np.linalg.solve(mobility, [wanted, -slip]) if rough else np.zeros(2)
    if rough and abs(sticking[1]) <= mu * sticking[0]:
        impulse = sticking
    else:
        direction = np.array([1.0, np.sign(sticking[1]) * mu])
        share = mobility[0] @ direction
        if share <= 0:
            raise EventError("an impact against friction jams (a Painleve configuration)")
        impulse = wanted / share * direction
    gain = impulse @ (before + mobility @ impulse / 2)
    if gain > TOUCH * abs(impulse[0] * approach):
        raise EventError(
            f"an impact at {approach:.3g} m/s gains energy, by restitution {e:g} and friction "
            f"{mu:g} at a slanted contact; Newton's restitution has no meaning here; lower one"
        )
    return np.asarray(both.T @ impulse)


def lay_segments(
    hybrid: Hybrid, stretches: Sequence[Stretch], events: Sequence[Event], fastest: float
) -> Motion:
    """Return the motion in segments that are free of events or have one in their middle.

    Raises:
        EventError: if two events are nearer than the shortest segment.
    """
    usual = _step(fastest, stretches[-1].stop)
    rooms = [stretch.stop - stretch.start for stretch in stretches]
    for stretch, room in zip(stretches, rooms, strict=True):
        check_room(room, usual, stretch.start)
    halves = [min(usual, before / 2, after / 2) / 2 for before, after in pairwise(rooms)]
    motions = list[Motion]()
    for k, stretch in enumerate(stretches):
        first = halves[k - 1] if k else 0.0
        last = halves[k] if k < len(events) else 0.0
        bounds = stretch.start + first, stretch.stop - last
        motions.append(_smooth(hybrid, stretch, graded(*bounds, (2 * first, 2 * last), usual)))
        if k < len(events):
            motions.append(_centred(hybrid, stretch, stretches[k + 1], events[k], halves[k]))
    motion = _chained(motions, [event.mark for event in events], fastest)
    return replace(motion, pressed=tuple(_pressed(hybrid, stretches)))


def _pressed(hybrid: Hybrid, stretches: Sequence[Stretch]) -> Iterator[PressedContact]:
    for i, part in enumerate(hybrid.parts):
        there = [stretch for stretch in stretches if stretch.mode.modes[i] != FREE]
        if isinstance(part, Contacting) and there:
            gap = hybrid.equations.compile([part.gap])
            for stretch in there:
                yield PressedContact(
                    name=part.name, start=stretch.start, stop=stretch.stop, gap=gap
                )


def graded(
    start: float, stop: float, ends: tuple[float, float], usual: float
) -> list[tuple[float, float, int]]:
    """Tile a stretch with segments that grow from both ends: start, length and count of each.

    A coarsest step of each segment is shorter than its distance from the next event.

    Args:
        start, stop: s.
        ends: lengths of the first and the last segment; 0 for the usual one.
        usual: largest length.
    """
    growing: list[list[float]] = [[], []]
    for lengths, length in zip(growing, ends, strict=True):
        while 0 < length < usual:
            lengths.append(length)
            length *= 2
    first, last = growing
    while sum(first) + sum(last) > (stop - start) * 0.75 and (first or last):
        (first if sum(first) >= sum(last) else last).pop()
    rest = stop - start - sum(first) - sum(last)
    allowed = min(usual, *(2 * lengths[-1] if lengths else end or usual
                           for lengths, end in zip(growing, ends, strict=True)))  # fmt: skip
    count = max(1, int(np.ceil(rest / allowed * (1 - 1e-9))))
    tiles, time = list[tuple[float, float, int]](), start
    for length, number in (
        *((x, 1) for x in first),
        (rest / count, count),
        *((x, 1) for x in last[::-1]),
    ):
        tiles.append((time, length, number))
        time += length * number
    return tiles


def ends_through(hybrid: Hybrid, segments: Segments) -> Array:
    """Return the ends of segments from their starts, through their events, (K, 2n).

    Raises:
        EventError: for a start from which the motion is not unique, or does not exist.
    """
    rows = zip(segments.t.tolist(), segments.start, segments.lengths.tolist(), strict=True)
    return np.stack([_end_through(hybrid, *row) for row in rows])


def _end_through(hybrid: Hybrid, time: float, state: Array, length: float) -> Array:
    every = {i: part.modes for i, part in enumerate(hybrid.parts)}
    stop, soon = time + length, SOON_SHARE * length
    mode = hybrid.next_mode(time, state, every, tuple(FREE for _ in every), soon)
    while True:
        time, state, guards = _until_event(hybrid, mode, time, state, stop - time, stop)
        if not guards:
            return state
        crossed = sorted({mode.owners[g] for g in guards})
        state, changing = _jump(hybrid, mode, time, state, crossed)
        mode = hybrid.next_mode(time, state, changing, mode.modes, soon)


def check_room(room: float, usual: float, last: float) -> None:
    """Check that two events are far enough apart.

    Args:
        room: time between them, s.
        usual: length of the segments of a smooth motion, s.
        last: time of the first of them, s.

    Raises:
        EventError: if they are not.
    """
    if room / 2 < LEAST_SHARE * usual:
        remedy = (
            f"end the motion before t = {last:.6g} s, until which it can be compared"
            if last > 0
            else "shorten the motion, which has too few segments for its events"
        )
        raise EventError(
            f"two events are {room:.2e} s apart, nearer than a coarsest step; {remedy}"
        )


def _smooth(hybrid: Hybrid, stretch: Stretch, tiles: Sequence[tuple[float, float, int]]) -> Motion:
    """Return the segments of a stretch that keep away from its events."""
    signal, equations = hybrid.signal, stretch.mode.equations
    spans = tuple(
        Span(start=start, length=length, count=count, constant_input=signal.constant)
        for start, length, count in tiles
    )
    edges = [*(span.start for span in spans), tiles[-1][0] + tiles[-1][1] * tiles[-1][2]]
    signals = [replace(signal, start=a, stop=b) for a, b in pairwise(edges)]
    state = stretch.state
    if edges[0] > stretch.start:
        state = hybrid.end(stretch.mode, stretch.start, state, edges[0] - stretch.start)
    onto = _projection(hybrid, stretch.mode.modes)
    motion = solve_numerically(equations, state, signals, spans, onto=onto)
    return with_bounds(equations, signals, motion, exact=False, along=False)


def _projection(hybrid: Hybrid, modes: Modes) -> Callable[[Array, Array], Array] | None:
    """Return a projection of states onto the closed contacts of a mode; None if it has none.

    Accelerations keep a contact closed up to the error of the integration, which engines undo.
    """
    zeros = hybrid.zeros(modes)
    if not zeros.size:
        return None

    def project(times: Array, states: Array) -> Array:
        off = hybrid.evaluate(zeros, times, states)
        steps = 1e-6 * np.maximum(np.abs(states).max(axis=0), 1e-6)
        moved = [hybrid.evaluate(zeros, times, states + step) for step in np.diag(steps)]
        slopes = (np.stack(moved, axis=2) - off[..., None]) / steps
        projected: Array = states - np.einsum("bxz,bz->bx", np.linalg.pinv(slopes), off)
        return projected

    return project


def _centred(hybrid: Hybrid, before: Stretch, after: Stretch, event: Event, half: float) -> Motion:
    """Return one segment with an event in its middle."""
    backward = hybrid.flow(before.mode, event.time, event.before, -half)
    forward = hybrid.flow(after.mode, event.time, event.after, half)
    start, end = backward[-1], forward[-1]
    middle = [event.before[None], event.after[None]]
    checks = []
    for stretch, state, length in zip((before, after), middle, (-half, half), strict=True):
        rates = field_of(stretch.mode.equations, hybrid.signal)
        reached = by_runge_kutta(_backward(rates, event.time, length), np.zeros(1), state, half)
        checks.append(reached)
    bound = checked_bound(np.stack([start, end]), np.concatenate(checks))
    inner = np.stack([start, *[event.before] * 9, end])[None]
    span = Span(
        start=event.time - half, length=2 * half, count=1, constant_input=hybrid.signal.constant
    )
    motion = Motion.join(
        (span,),
        numeric_inputs((hybrid.signal,)),
        start=start[None],
        end=end[None],
        nodes=inner,
        bound=JUMPS * bound,
        method="",
    )
    return replace(motion, halves={0: np.stack([backward[::-1], forward])})


JUMPS = 4.0
"""Factor of the bound of a segment with an event: both halves, and the jump between them."""


def _backward(
    rates: Callable[[Array, Array], Array], time: float, length: float
) -> Callable[[Array, Array], Array]:
    """Return dy/ds for s = |t - time|."""
    sign = float(np.sign(length))
    return lambda s, y: sign * rates(time + sign * s, y)


def _chained(motions: Sequence[Motion], marks: Sequence[EventMark], fastest: float) -> Motion:
    first = motions[0]
    rows = np.cumsum([0, *(len(m.start) for m in motions)])
    halves = {
        int(row) + i: nodes
        for row, m in zip(rows, motions, strict=False)
        for i, nodes in m.halves.items()
    }
    motion = Motion.join(
        tuple(span for m in motions for span in m.spans),
        first.inputs,
        start=np.concatenate([m.start for m in motions]),
        end=np.concatenate([m.end for m in motions]),
        nodes=np.concatenate([m.nodes for m in motions]),
        bound=np.max([m.bound for m in motions], axis=0),
        method=f"{first.method}; events by root finding",
    )
    events = tuple(mark.time for mark in marks)
    return replace(motion, fastest=fastest, events=events, marks=tuple(marks), halves=halves)
