"""A system's equations with its constants as arguments: derived and compiled once, for any values.

A motion at other constants costs no derivation, no compilation and no symbol: `Family.at` puts
numbers in. The reference motion is found by multiple shooting: a rough motion, Gauss collocation of
all segments at once, and Newton's method for where they start (Deuflhard and Bornemann 2002,
Scientific Computing with Ordinary Differential Equations, section 8.1). Each segment is checked by
a second integration, as in `reference.solving.integrate`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import sympy as sp

from physics_crosscheck.reference.dynamics.derive import Equations, known, slopes_by
from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.dynamics.roundoff import running_error
from physics_crosscheck.reference.mechanism.declaration import Declaration, Scenario, about, t
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, compile_function
from physics_crosscheck.reference.mechanism.signal import Piece, numeric_inputs, pieces
from physics_crosscheck.reference.solving.bounds import each, rounded_away, transitions
from physics_crosscheck.reference.solving.collocation import CONVERGED, collocate
from physics_crosscheck.reference.solving.integrate import (
    ReferenceError,
    by_runge_kutta,
    field_of,
    held_together,
    trajectory,
)
from physics_crosscheck.reference.solving.motion import Motion, Span
from physics_crosscheck.reference.solving.solve import (
    check_duration,
    check_motion,
    fastest_rate,
    start_of,
    tile,
)

SHOTS = 8
"""Newton iterations at most; two are the rule."""

JOINED = 1e-12
"""Of the motion's size: by so much starts may still move where the shooting ends."""

SETTLED = 1e-9
"""Where they move by less, and by hardly less than before, rounding is what moves them."""

FAR = 0.1
"""Of the motion's size: where starts are to be moved by more, Newton's method is not begun."""

ROUGHLY = 1e-8
"""Change of rates that ends the iterations of the first shot, see `collocate`."""

ROUGH = 400
"""Samples of the rough motion, as in `solving.solve`: Newton's method squares what it is off."""


@dataclass(frozen=True)
class Family:
    """The equations of a system, for any values of its constants.

    Attributes:
        equations: with symbols for the constants.
        acceleration, power, mass, derivatives: functions whose last group are the constants.
    """

    equations: Equations
    acceleration: NumericFunction
    power: NumericFunction
    mass: NumericFunction
    derivatives: NumericFunction | None

    @staticmethod
    def of(equations: Equations) -> Family:
        """Compile everything once."""
        one, system = equations, equations.system
        symbols = [c.symbol for c in system.constants]

        def compiled(expressions: Sequence[sp.Expr]) -> NumericFunction:
            return compile_function(expressions, system.q, system.v, system.u, (t,), symbols)

        return Family(
            equations=one,
            acceleration=compiled(list(one.acceleration)),
            power=compiled([one.energy, one.supplied, one.dissipated]),
            mass=compiled(list(one.mass)),
            derivatives=None if one.long else compiled(one.derivatives),
        )

    @cached_property
    def declared(self) -> Declaration:
        """What the system declares, without its checks, which other values need not repeat."""
        system = self.equations.system
        return Declaration(**{f.name: getattr(system, f.name) for f in fields(Declaration)})

    @cached_property
    def _signals(self) -> dict[str, tuple[Piece, ...]]:
        return {}

    def signals(self, system: Declaration, scenario: Scenario) -> tuple[Piece, ...]:
        """The inputs of a scenario; those that no constant stands in are resolved once."""
        symbols = {c.symbol for c in system.constants}
        free = set[sp.Basic]().union(
            *(sp.sympify(scenario.inputs[i]).free_symbols for i in system.inputs)
        )
        if free & symbols:
            return pieces(system, scenario)
        if scenario.name not in self._signals:
            self._signals[scenario.name] = pieces(system, scenario)
        return self._signals[scenario.name]

    def at(self, constants: Mapping[str, float]) -> DrawnEquations:
        """The equations at values of the constants; those that are not named keep their own."""
        system = self.declared
        changed = tuple(
            replace(c, value=float(constants.get(c.name, c.value))) for c in system.constants
        )
        return DrawnEquations(self, replace(system, constants=changed))


@dataclass(frozen=True)
class DrawnEquations(EquationsOfMotion):
    """A family's equations at some values of the constants, those of `system`."""

    family: Family
    system: Declaration

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Of the constants, as they are declared."""
        return tuple(float(c.value) for c in self.system.constants)

    @property
    def linear(self) -> bool:
        """Whatever the values."""
        return self.family.equations.linear

    @cached_property
    def numeric_acceleration(self) -> NumericFunction:
        """a(q, v, u, (t,))."""
        return self.family.acceleration.at(self.values)

    @cached_property
    def numeric_power(self) -> NumericFunction:
        """(energy, supplied, dissipated) of (q, v, u, (t,))."""
        return self.family.power.at(self.values)

    @cached_property
    def numeric_mass(self) -> NumericFunction:
        """M of (q, v, u, (t,)), row after row."""
        return self.family.mass.at(self.values)

    def acceleration_error(
        self,
        states: Array,
        inputs: Array,
        times: Array,
        *,
        off: Array,
        late: Array,
        rounded: bool,
    ) -> Array:
        """Bound of the error of the accelerations, operation by operation."""
        variables = known(self.system, states, inputs, times, off=off, late=late)
        expressions = list(self.family.equations.acceleration)
        return running_error(expressions, variables, rounded=rounded)

    def slopes(self, states: Array, inputs: Array, times: Array) -> Array:
        """Number by number from the derivatives of M and f."""
        if self.family.derivatives is None:
            return super().slopes(states, inputs, times)
        return slopes_by(self.family.derivatives.at(self.values), states, inputs, times)


def solve_drawn(equations: DrawnEquations, scenario: Scenario) -> Motion:
    """The reference motion of a scenario at drawn constants; no global bound is found.

    Raises:
        DeclarationError, ReferenceError: as `reference.solving.solve.solve`.
    """
    with about("Scenario", scenario.name):
        place = f"system {equations.system.name!r}, scenario {scenario.name!r}"
        try:
            motion = _shot(equations, scenario, place)
        except ReferenceError as error:
            raise ReferenceError(f"{place}: {error}") from error
        check_motion(equations, motion, place)
        return motion


def _shot(equations: DrawnEquations, scenario: Scenario, place: str) -> Motion:
    import scipy.interpolate  # takes a part of a second, in every command

    system = equations.system
    signals = equations.family.signals(system, scenario)
    start, duration = start_of(system, scenario), float(scenario.duration)
    fastest = fastest_rate(equations, signals, np.zeros(1), start[None])
    check_duration(fastest, duration, place)
    rough = np.linspace(0.0, duration, ROUGH)
    states = trajectory(equations, start, signals, rough, rtol=1e-6)
    if not equations.linear:
        fastest = fastest_rate(equations, signals, rough, states)
        check_duration(fastest, duration, place)
    spans = tile(signals, fastest)
    times = np.concatenate([s.start + s.length * np.arange(s.count) for s in spans])
    guess = scipy.interpolate.CubicSpline(rough, states)(times)
    guess[0] = start
    solved = equations, signals, spans, times
    try:
        with np.errstate(all="ignore"):
            starts, (end, nodes, flow) = _joined(*solved, guess)
    except ReferenceError:
        # A motion that multiplies differences: Newton's method begins too far from it.
        starts = trajectory(equations, start, signals, times)
        starts[0] = start
        end, nodes, flow = _segments(*solved, starts, CONVERGED)
    checks, rounded = [], []
    for rows, span, piece in each(spans, signals):
        at, field = times[rows], field_of(equations, piece)
        checks.append(by_runge_kutta(field, at, starts[rows], span.length))
        given = equations, piece, at, nodes[rows], span.length
        rounded.append(rounded_away(*given, flow=flow[rows], rounded=True))
    bound = held_together(end, np.concatenate(checks))
    return Motion(
        t=times,
        start=starts,
        end=end,
        bound=bound + np.max(np.concatenate(rounded), axis=0),
        global_bound=np.full((len(times) + 1, starts.shape[1]), np.inf),
        nodes=nodes,
        spans=spans,
        inputs=numeric_inputs(signals),
        fastest=fastest,
        method="multiple shooting by Gauss collocation, checked by DOP853",
    )


def _segments(
    equations: DrawnEquations,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    times: Array,
    starts: Array,
    converged: float,
) -> tuple[Array, Array, Array]:
    """Ends, nodes and transitions of segments.

    Raises:
        ReferenceError: where the collocation does not converge.
    """
    ends, inner, flows = [], [], []
    for rows, span, piece in each(spans, signals):
        given = field_of(equations, piece), times[rows], starts[rows], span.length
        end, nodes = collocate(*given, converged=converged)
        ends.append(end)
        inner.append(nodes)
        flows.append(transitions(*given))
    return np.concatenate(ends), np.concatenate(inner), np.concatenate(flows)


def _joined(
    equations: DrawnEquations,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    times: Array,
    starts: Array,
) -> tuple[Array, tuple[Array, Array, Array]]:
    """Starts of segments that follow from each other, and `_segments` from there.

    Raises:
        ReferenceError: where Newton's method does not join them.
    """
    size = np.maximum(np.max(np.abs(starts), axis=0), 1e-300)
    worst = np.inf
    for shot in range(SHOTS):
        # What Newton's method will mend anyway need not be known to the last digit.
        converged = ROUGHLY if shot == 0 else CONVERGED
        found = _segments(equations, signals, spans, times, starts, converged)
        end, _, flow = found
        moved = _moves(flow, end[:-1] - starts[1:])
        worst, before = float(np.max(np.abs(moved) / size, initial=0.0)), worst
        # Where it falls no more, rounding along the chain is all that is left of it.
        joined = worst <= JOINED or (worst < SETTLED and worst > before / 4)
        if joined and shot > 0:
            return starts, found
        if not worst <= FAR:
            break
        starts = np.concatenate([starts[:1], starts[1:] + moved])
    raise ReferenceError("the segments of the motion can't be joined because it grows too fast")


def _moves(flow: Array, jumps: Array) -> Array:
    """By how much each start but the first is to be moved, (K - 1, 2n): Newton's step."""
    moved = np.empty_like(jumps)
    carried = np.zeros(flow.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (turn, jump) in enumerate(zip(flow, jumps, strict=False)):
            carried = turn @ carried + jump
            moved[k] = carried
    return moved
