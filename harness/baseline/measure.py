"""Measurement of a case's model for the baseline: limits on a snapshot, and fitted constants.

The model and the equations also run on the accepted snapshot, if there is one. So a change can be
attributed to the model or to the equations.

Snapshots: selected segments of a scenario in numbers, for later runs to repeat.

From the recorded states under the recorded inputs, an engine must end where it ended before, even
if the declaration has changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache

import msgspec
import numpy as np
import sympy as sp

from physics_crosscheck.harness.checks.law_comparison import Evaluated, LawComparison
from physics_crosscheck.harness.checks.prepare import Prepared, PreparedSystem, PreparedTree
from physics_crosscheck.harness.checks.task import ModelTask
from physics_crosscheck.harness.checks.whole_step import case_whole_step
from physics_crosscheck.harness.diagnosis.diagnose import NAMED
from physics_crosscheck.harness.engines.protocol import LoadedModel, WholeState
from physics_crosscheck.harness.modelfiles.code_reads import record_reads
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.harness.records.base import number, numbers, rows
from physics_crosscheck.harness.records.baseline import (
    Identified,
    LawNumber,
    Measurement,
    OnAccepted,
    Snapshot,
    StepEnds,
    WholeSteps,
)
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.laws.motion import EventError
from physics_crosscheck.reference.mechanism.numeric import Array, Rows
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.samples import ends_of
from physics_crosscheck.reference.solving.segments import Segments
from physics_crosscheck.reference.solving.variants import Variants
from .diff import equations_movement


def measure_steps(
    task: ModelTask[Prepared],
    loaded: tuple[LoadedModel, CoordinateMap],
    accepted: WholeSteps | None,
) -> tuple[WholeSteps | None, StepEnds | None]:
    """Return the steps from drawn states, and the engine's present steps from accepted ones.

    Return None for both if the engine has no law for the file; also for the second one if the file
    has other coordinates, controls or states of drives.
    """
    target = task.target
    if not isinstance(target, PreparedTree) or case_whole_step(task, *loaded) is None:
        return None, None
    comparison, evaluated = target.steps.kept(task.engine)
    if comparison is None or not evaluated:
        return None, None
    ends = _ends(comparison, evaluated)
    steps = WholeSteps(
        coordinates=comparison.model.coordinates,
        components=comparison.components,
        controls=comparison.model.controls,
        states=rows(np.concatenate(sample.state).tolist() for sample in evaluated),
        scale=numbers(comparison.compare(evaluated).scale.tolist()),
        ends=ends,
        laws=dict(_leaves(comparison.laws.laws, "")),
    )
    if accepted is None or not _is_comparable(steps, accepted):
        return steps, None
    again = [comparison.evaluate([state]) for state in _states(accepted)]
    nothing = (None,) * len(comparison.components)
    present = [_ends(comparison, samples) for samples in again]
    return steps, StepEnds(
        values=tuple(one.values[0] if one.values else nothing for one in present),
        uncertainty=tuple(one.uncertainty[0] if one.uncertainty else nothing for one in present),
    )


def _ends(comparison: LawComparison, evaluated: Sequence[Evaluated]) -> StepEnds:
    return StepEnds(
        values=rows(comparison.answer(sample).tolist() for sample in evaluated),
        uncertainty=rows(comparison.uncertainty(sample).tolist() for sample in evaluated),
    )


def _is_comparable(steps: WholeSteps, accepted: WholeSteps) -> bool:
    shapes = [
        (one.coordinates, one.components, one.controls, len(one.states[0]))
        for one in (steps, accepted)
    ]
    return shapes[0] == shapes[1]


def _states(accepted: WholeSteps) -> Iterator[WholeState]:
    n = len(accepted.coordinates)
    for row in np.array(accepted.states, dtype=float):  # None, for a control that is off, is nan
        yield WholeState(*np.split(row, (n, 2 * n, 2 * n + accepted.controls)))


def _leaves(value: object, name: str) -> Iterator[tuple[str, LawNumber]]:
    """Yield the numbers and words of laws, each with its name, such as `limits[0].upper`."""
    if is_dataclass(value) and not isinstance(value, type):
        dot = "." if name else ""
        parts = ((f"{name}{dot}{one.name}", getattr(value, one.name)) for one in fields(value))
    elif isinstance(value, Mapping):
        parts = ((f"{name}[{key}]", each) for key, each in sorted(value.items()))
    elif isinstance(value, frozenset):
        parts = ((name, " ".join(map(str, sorted(value)))) for _ in range(1))
    elif isinstance(value, list | tuple):
        parts = ((f"{name}[{i}]", each) for i, each in enumerate(value))
    else:
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, bool | int | str):
            yield name, value
        elif isinstance(value, float):
            yield name, value if np.isfinite(value) else str(value)
        return
    for inner, each in parts:
        yield from _leaves(each, inner)


PICKED = 16
"""Number of segments in a snapshot: evenly spaced, at least two between breaks of the motion."""

SAME = 1e-9
"""Relative difference of starts, ends and inputs up to which two motions are the same. Another
machine reproduces them to about 1e-13.
"""

_FIRST_NODES, _MOST_NODES = 12, 96
_INTERPOLATED = 1e-13


@dataclass(frozen=True)
class RecordedInputs:
    """Inputs of K segments at inner Chebyshev points of each, (nodes, inputs)."""

    nodes: tuple[Array, ...]

    def over_steps(self, rows: Rows, t: Array, lengths: Array, steps: int) -> Array:
        """Return u at the starts of equal steps, (B, steps, inputs)."""
        fractions = np.arange(steps) / steps
        return np.stack([_interpolate(self.nodes[row], fractions) for row in rows])

    def within(self, rows: Rows, t: Array, lengths: Array, times: Array) -> Array:
        """Return u at times within each segment, (B, S, inputs)."""
        inside = (times - t[:, None]) / lengths[:, None]
        return np.stack(
            [_interpolate(self.nodes[row], x) for row, x in zip(rows, inside, strict=True)]
        )

    def pick(self, rows: Rows) -> RecordedInputs:
        """Return the inputs of the chosen segments alone."""
        return RecordedInputs(tuple(self.nodes[row] for row in rows))


def segments_of(snapshot: Snapshot) -> Segments:
    """Convert the segments of a snapshot to arrays; it does not record the bound of the ends."""
    start = np.array(snapshot.start)
    nodes = (np.array(one).reshape(len(one), -1) for one in snapshot.input_nodes)
    return Segments(
        start=start,
        lengths=np.array(snapshot.length),
        inputs=RecordedInputs(tuple(nodes)),
        end=np.array(snapshot.end),
        bound=np.full(start.shape[1], np.inf),
        t=np.array(snapshot.t, dtype=float),  # None becomes nan
        varying=snapshot.varying,
        scale=np.array(snapshot.scale),
        fastest=snapshot.fastest,
        name=snapshot.scenario,
        events=snapshot.events,
    )


def snapshot_of(
    segments: Segments, scenario: str, components: tuple[str, ...], inputs: tuple[str, ...]
) -> Snapshot:
    """Select informative segments of a scenario.

    Args:
        segments: all segments.
        scenario: its name.
        components: names of the state's components.
        inputs: the inputs as text.
    """
    some = segments.pick(segments.informative(PICKED))
    return Snapshot(
        scenario=scenario,
        components=components,
        duration=float(segments.duration),
        inputs=inputs,
        fastest=float(some.fastest),
        varying=some.varying,
        t=numbers(some.t.tolist()),
        length=tuple(some.lengths.tolist()),
        start=_table(some.start),
        input_nodes=tuple(_table(_nodes(some, row)) for row in range(len(some.t))),
        end=_table(some.end),
        scale=tuple(some.unit.tolist()),
        events=some.events,
    )


def _table(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())


def same_motion(first: Snapshot, second: Snapshot) -> bool:
    """Return whether two snapshots hold the same segments of the same motion."""
    if (first.components, first.varying) != (second.components, second.varying):
        return False
    a, b = segments_of(first), segments_of(second)
    if a.start.shape != b.start.shape:
        return False
    pairs: list[tuple[Array, Array, Array | float]] = [
        (np.isnan(a.t) * 1.0, np.isnan(b.t) * 1.0, 0.0),
        (np.nan_to_num(a.t), np.nan_to_num(b.t), 1.0),
        (a.lengths, b.lengths, float(np.max(a.lengths))),
        (a.start, b.start, a.unit),
        (a.end, b.end, a.unit),
        (a.unit, b.unit, a.unit),
        *(
            (u, v, 1.0 + float(np.max(np.abs(u), initial=0.0)))
            for u, v in zip(
                map(np.array, first.input_nodes), map(np.array, second.input_nodes), strict=True
            )
        ),
    ]
    return all(
        x.shape == y.shape and bool(np.all(np.abs(x - y) <= SAME * scale)) for x, y, scale in pairs
    )


def ends(model: LoadedModel, coordinates: CoordinateMap, segments: Segments) -> tuple[Array, Array]:
    """Return the ends of the segments in an engine as h -> 0, with their uncertainty, (K, 2n) each.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    limit = extrapolate(model, coordinates, segments).limit
    return limit.value, limit.uncertainty


def _nodes(segments: Segments, row: int) -> Array:
    """Sample inputs at Chebyshev points inside a segment, enough to restore them up to rounding."""
    start, length = segments.t[row], segments.lengths[row]

    def inputs(times: Array) -> Array:
        values: Array = segments.inputs_within(np.array([row]), times[None])[0]
        return values

    check = start + length * (np.arange(33) + 0.5) / 33
    wanted = inputs(check)
    if bool(np.all(wanted == wanted[:1])):
        return wanted[:1]
    count = _FIRST_NODES
    while True:
        nodes = inputs(start + length * _points(count))
        miss = np.max(np.abs(_interpolate(nodes, (check - start) / length) - wanted))
        if miss <= _INTERPOLATED * np.max(np.abs(wanted)) or count >= _MOST_NODES:
            return nodes
        count *= 2


def _points(count: int) -> Array:
    """Return Chebyshev points of the first kind on (0, 1), none at a break of the input."""
    points: Array = (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2
    return points


def _interpolate(nodes: Array, places: Array) -> Array:
    """Interpolate between nodes at places in [0, 1], (len(places), inputs)."""
    if len(nodes) == 1:
        return np.repeat(nodes, len(places), axis=0)
    values: Array = _matrix(len(nodes), tuple(places.tolist())) @ nodes
    return values


@lru_cache(maxsize=512)
def _matrix(count: int, places: tuple[float, ...]) -> Array:
    """Return a barycentric interpolation matrix (Berrut and Trefethen 2004, eq. 4.2 and 5.3)."""
    k = np.arange(count)
    weights = np.where(k % 2 == 0, 1.0, -1.0) * np.sin(np.pi * (k + 0.5) / count)
    gaps = np.array(places)[:, None] - _points(count)
    exact = np.abs(gaps) < 1e-15
    factors = weights / np.where(exact, 1.0, gaps)
    hit = exact.any(axis=1)
    factors[hit] = exact[hit]
    matrix: Array = factors / factors.sum(axis=1)[:, None]
    return matrix


TIED = 1e-6
"""Smallest effect of an identifiable constant, as a share of its unit change. Other constants
compensate a smaller one: no segment moves by more than rounding.
"""

ITERATIONS = 6
NUDGE = 1e-4


def measure(task: ModelTask[Prepared]) -> Measurement:
    """Measure one case: on the accepted snapshot if comparable, and on its own.

    Raises:
        EngineError, SidecarError, BlownUpError, ReferenceError: naming the model that cannot run.
    """
    if task.sidecar is None:
        return _measured(task, task.snapshot)  # a file alone is hashed with all files that it names
    with record_reads(task.target.place) as reads:
        measurement = _measured(task, task.snapshot)
    return msgspec.structs.replace(measurement, reads={**task.target.reads, **reads.states})


def _measured(task: ModelTask[Prepared], accepted: Snapshot | None) -> Measurement:
    model, coordinates = task.load()
    present, on_accepted = _snapshot(task), None
    accepted_steps = None if accepted is None else accepted.steps
    if accepted is not None:
        accepted = msgspec.structs.replace(accepted, steps=None)
    steps, steps_on_accepted = measure_steps(task, (model, coordinates), accepted_steps)
    by_equations = None
    if accepted is not None and comparable(present, accepted):
        by_equations = _by_equations(task.target, segments_of(accepted))
    if accepted is not None and by_equations is not None:
        segments = segments_of(accepted)
        end, uncertainty = ends(model, coordinates, segments)
        on_accepted = OnAccepted(
            end=rows(end.tolist()),
            uncertainty=rows(uncertainty.tolist()),
            equations=rows(by_equations.tolist()),
            steps=steps_on_accepted,
        )
        if is_accepted(present, accepted, on_accepted):
            present = accepted
    if present is not accepted:
        segments = segments_of(present)
        end, uncertainty = ends(model, coordinates, segments)
    target, constants = task.target, dict[str, Identified]()
    # Of bodies the diagnosis finds the changed number.
    if isinstance(target, PreparedSystem):
        constants = identify(target.variants, segments, end, uncertainty)
    return Measurement(
        snapshot=present,
        end=rows(end.tolist()),
        uncertainty=rows(uncertainty.tolist()),
        constants=constants,
        on_accepted=on_accepted,
        time_step=None if task.sidecar else number(model.step),
        integrator="" if task.sidecar else model.integrator,
        steps=steps,
    )


def _snapshot(task: ModelTask[Prepared]) -> Snapshot:
    target = task.target
    inputs = tuple(f"a force on {name}, held" for name in target.names)
    if isinstance(target, PreparedSystem):
        given = target.system.scenario(task.scenario).inputs
        inputs = tuple(f"{i.name} = {sp.sstr(sp.sympify(given[i]))}" for i in target.system.inputs)
    segments = target.segments(task.scenario)
    return snapshot_of(segments, task.scenario, target.components, inputs)


def _by_equations(target: Prepared, segments: Segments) -> Array | None:
    """Return the ends of segments by the present equations, (K, 2n).

    None if the motion cannot begin at a start, since the contacts have changed.
    """
    if isinstance(target, PreparedSystem) and target.system.interactions:
        with suppress(EventError):
            return target.ends_through_events(segments)
        return None
    if isinstance(target, PreparedSystem):
        ends: Array = target.variants.flows(target.variants.nominal[None], segments)[0]
        return ends
    assert isinstance(target, PreparedTree)
    equations = TreeEquations(target.system)
    return ends_of(equations, segments.start, segments.start_inputs, segments.length)


def is_accepted(present: Snapshot, accepted: Snapshot, now: OnAccepted) -> bool:
    """Return whether the accepted snapshot still fits: the same motion, and the same equations.

    Otherwise a change of the equations too small to change the motion would be reported in every
    later run, since the old ends would remain the reference.
    """
    return same_motion(present, accepted) and not equations_movement(accepted, now)


def comparable(present: Snapshot, accepted: Snapshot) -> bool:
    """Return whether two snapshots have equal numbers of components and inputs, and similar
    times.
    """
    inputs = {len(row) for one in (present, accepted) for nodes in one.input_nodes for row in nodes}
    timed = {time is None for one in (present, accepted) for time in one.t}
    return len(present.components) == len(accepted.components) and len(inputs) == len(timed) == 1


def identify(
    variants: Variants, segments: Segments, end: Array, uncertainty: Array
) -> dict[str, Identified]:
    """Return the constants of the equations that explain the ends of the segments, by name.

    Gauss-Newton over all constants at once. Constants that this motion cannot distinguish are
    omitted. All are omitted if constants do not explain the motion, which then has another cause.
    """
    chosen = [i for i, p in enumerate(variants.parameters) if p.kind == "constant"]
    is_known = np.isfinite(uncertainty) & np.isfinite(end)
    if not chosen or not is_known.any():
        return {}
    sizes = variants.sizes[chosen]
    target = (end / segments.unit)[is_known]
    weight = np.maximum((uncertainty / segments.unit)[is_known], 1e-16)
    shift = np.zeros(len(chosen))

    def ends_at(shifts: Array) -> Array:
        points = np.tile(variants.nominal, (len(shifts), 1))
        points[:, chosen] += shifts * sizes
        return (variants.flows(points, segments) / segments.unit)[:, is_known]

    try:
        slopes = (ends_at(NUDGE * np.eye(len(chosen))) - ends_at(-NUDGE * np.eye(len(chosen)))) / (
            2 * NUDGE
        )
        _, values, directions = np.linalg.svd(slopes.T, full_matrices=False)
        held = values > TIED * max(float(values[0]), 1e-300)
        free = directions[~held]
        inverse = np.linalg.pinv(slopes.T, rcond=TIED)
        residual = first = target - ends_at(shift[None])[0]
        for _ in range(ITERATIONS):
            step = inverse @ residual
            after = target - ends_at((shift + step)[None])[0]
            if not np.isfinite(after).all() or np.linalg.norm(after) >= np.linalg.norm(residual):
                break
            shift, residual = shift + step, after
    except (ReferenceError, np.linalg.LinAlgError):
        return {}
    explained = np.linalg.norm(residual) <= NAMED * np.linalg.norm(first)
    if not explained and bool(np.any(np.abs(residual) > weight)):
        return {}
    errors = np.sqrt((inverse**2) @ weight**2)
    return {
        variants.parameters[index].name: Identified(
            value=float(variants.nominal[index] + shift[i] * sizes[i]),
            standard_error=float(errors[i] * sizes[i]),
        )
        for i, index in enumerate(chosen)
        if float(np.linalg.norm(free[:, i])) < TIED
    }
