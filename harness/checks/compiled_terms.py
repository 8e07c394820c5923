"""Terms and linearizations of an engine's model, compared with those of the equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.numerics.accelerations import (
    RESOLVED_SHARE,
    Accelerations,
    Estimate,
    force_of,
)
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.differences import MAX_PERTURBATION, OperatingPoint
from physics_crosscheck.harness.numerics.discrete import linearize_step
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.numerics.stops import stopped
from physics_crosscheck.harness.records.finding import AuditFinding, AuditKind
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.results.status import listed
from physics_crosscheck.reference.mechanism.numeric import Array
from .findings import finding
from .prepare import MassAndForce, PreparedSystem, PreparedTree
from .task import ModelTask

Linearized = ModelTask[PreparedSystem | PreparedTree]


def run_linearizations(task: Linearized) -> tuple[EngineLinearization, ...]:
    """Linearize the engine's model about each equilibrium, and compare with Taylor's series.

    There is no linearization where a joint limit acts near the equilibrium, such as a spring that
    presses a joint against its limit.
    """
    model, coordinates = task.load()
    moved = 2 * MAX_PERTURBATION * np.minimum(task.target.amplitude[: coordinates.back.size], 1.0)
    records = []
    for point in task.target.equilibria:
        if stopped(model, coordinates, point.position, moved):
            continue
        # Once for a step of the file's own length, and once as h -> 0.
        step = linearize_step(model, coordinates, task.target.stepped, point, task.resolution)
        limit, _ = linearize_engine(model, coordinates, point, task.resolution, task.thorough)
        records.append(replace(limit, one_step=step))
    return tuple(records)


SEED = 20260101
DRAWS = 24
"""Number of random states at which accelerations are compared."""

MOVED, SLOW, QUICKER = 0.2, 0.3, 0.1
"""Displacement, speed and change of speed of the measured states, in amplitudes. They need not be
small: the equations are evaluated at the same states.
"""

NAMED = 4
"""Number of unresolved terms that a note names."""

EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Compiled:
    """The engine's compiled terms and those of the equations.

    Attributes:
        mechanics: M and the generalized forces of the equations.
        inertia: the diagonal of M, a scale.
    """

    task: Linearized
    accelerations: Accelerations
    mechanics: MassAndForce
    names: tuple[str, ...]
    inertia: Array

    @staticmethod
    def prepare(task: Linearized, model: LoadedModel, coordinates: CoordinateMap) -> Compiled:
        """Prepare the measurement of a loaded model's terms."""
        names = task.target.names
        n = len(names)
        speed = np.where(task.target.amplitude[n:] > 0, task.target.amplitude[n:], 1.0)
        accelerations = Accelerations(
            model=model,
            coordinates=coordinates,
            speed=speed,
            fastest=max(task.target.fastest, 1e-6),
        )
        # The scale may come from any equilibrium.
        inertia = np.abs(np.diagonal(task.target.equilibria[0].matrices["M"]))
        return Compiled(task, accelerations, task.target.mechanics(), names, inertia)

    def findings(self) -> Iterator[AuditFinding]:
        """Yield differences about each equilibrium, each term once, and of accelerations."""
        # A term is often wrong about every equilibrium; report it once.
        seen: dict[tuple[str, tuple[str, ...]], AuditFinding] = {}
        for equilibrium in self.task.target.equilibria:
            for difference in self._about(equilibrium):
                seen.setdefault((difference.kind, difference.subject), difference)
        yield from seen.values()
        states, inputs = self._drawn()
        yield from self._anywhere(
            states, inputs, any(f.severity == "finding" for f in seen.values())
        )
        if self.accelerations.coordinates.redundant:
            yield from self._off_the_map(states, inputs)

    def _drawn(self) -> tuple[Array, Array]:
        """Draw random states (DRAWS, 2n) and inputs, of the size of the system's motions."""
        n = len(self.names)
        random = np.random.default_rng(SEED)
        # Combine positions that the motions pass with velocities from other times. Coordinates
        # drawn one by one could be outside the range of motion.
        places, speeds = random.integers(0, len(self.task.target.visited), (2, DRAWS))
        states = np.hstack(
            [self.task.target.visited[places, :n], self.task.target.visited[speeds, n:]]
        )
        return states, random.uniform(
            -1, 1, (DRAWS, len(self.task.target.push))
        ) * self.task.target.push

    def _off_the_map(self, states: Array, inputs: Array) -> Iterator[AuditFinding]:
        accelerations, scale = self.accelerations.off_the_map(states, inputs)
        if not np.isfinite(accelerations.value).all():
            return  # reported with the accelerations
        model = self.accelerations.model
        size = np.abs(accelerations.value)
        for j, name in enumerate(model.coordinates):
            differing = size[:, j] > accelerations.uncertainty[:, j]
            if differing.any():
                row = int(np.argmax(np.where(differing, size[:, j], 0.0)))
                yield finding(
                    "freedom",
                    (name,),
                    f"{name} accelerates away from the coordinate map with"
                    f" {accelerations.value[row, j]:.6g} at {self._state_text(states[row])}"
                    f" ({int(differing.sum())} of {DRAWS} random states differ): the model has an"
                    " additional degree of freedom",
                    expected=0.0,
                    actual=float(accelerations.value[row, j]),
                )
            elif (accelerations.uncertainty[:, j] > RESOLVED_SHARE * scale[j]).any():
                yield finding(
                    "unresolved",
                    (name,),
                    f"the audit can't resolve whether {name} follows the coordinate map",
                    severity="note",
                )

    def _state_text(self, state: Array) -> str:
        names = (*self.names, *(f"{x}_dot" for x in self.names))
        return ", ".join(f"{name} = {x:.4g}" for name, x in zip(names, state, strict=True))

    def _reference(self, states: Array, inputs: Array) -> tuple[Array, Array]:
        """Return mass matrices (B, n, n) and generalized forces (B, n) of the equations."""
        return self.mechanics(states, inputs)

    def _about(self, equilibrium: OperatingPoint) -> Iterator[AuditFinding]:
        n = len(self.names)
        step = MOVED * np.where(
            self.task.target.amplitude[:n] > 0, self.task.target.amplitude[:n], 1.0
        )
        going, more = SLOW * self.accelerations.speed, np.diag(QUICKER * self.accelerations.speed)
        position, still = self._smooth(equilibrium.position, step), np.zeros((1, n))
        yield from self._held(equilibrium, position, step)
        if position is None:
            return
        places = np.concatenate(
            [position[None], position + np.diag(step), position - np.diag(step)]
        )
        speeds = np.concatenate([going[None], going + more, going - more])
        # Measure inertia in motion: static friction would hold the model at rest.
        k, ends = len(places), np.concatenate([speeds, -speeds])
        moving = np.hstack([places, np.tile(going, (k, 1))])
        rest = np.hstack([places, np.tile(still, (k, 1))])
        driven = np.hstack([np.tile(position, (len(ends), 1)), ends])
        none = np.zeros((len(driven), len(self.task.target.push)))
        masses, _ = self._reference(moving, none[:k])
        _, forces = self._reference(driven, none)
        sizes = (
            np.abs(np.diagonal(masses[0])) * self.accelerations.speed * self.accelerations.fastest
        )
        mass, _ = self.accelerations.mechanics(moving, sizes)
        yield from self._entries(
            "inertia", equilibrium.name, masses[0], mass.value[0], mass.uncertainty[0]
        )
        # `_anywhere` would find an inertia that depends on the velocity.
        force = self._times(
            driven,
            Estimate(
                value=np.repeat(mass.value[:1], 2 * k, axis=0),
                uncertainty=np.repeat(mass.uncertainty[:1], 2 * k, axis=0),
            ),
        )
        # Odd in the velocity: damping, and a constant that only changes its sign.
        odd = (force.value[:k] - force.value[k:]) / 2
        odd_error = (force.uncertainty[:k] + force.uncertainty[k:]) / 2
        wanted = (forces[:k] - forces[k:]) / 2
        miss, miss_error = odd - wanted, odd_error + 16 * EPSILON * np.abs(wanted)
        slope = -_slopes(miss, np.diag(more))
        slope_error = _slope_errors(miss_error, np.diag(more))
        expected = equilibrium.matrices["C"]
        yield from self._entries(
            "damping", equilibrium.name, expected, expected + slope, slope_error
        )
        residual = -(miss[0] + slope @ going)
        left_error = miss_error[0] + slope_error @ going
        sticky = False
        for i, name in enumerate(self.names):
            if abs(residual[i]) > left_error[i]:
                sticky = True
                yield finding(
                    "friction",
                    (name,),
                    f"a friction of {residual[i]:.6g} acts on {name} at any speed, but the"
                    " equations have none",
                    expected=0.0,
                    actual=float(residual[i]),
                )
        if sticky:
            yield finding(
                "unresolved",
                ("stiffness", "rest"),
                "friction hides stiffness and rest forces: it holds what is at rest",
                severity="note",
            )
            return
        # At rest: the engine's accelerations times the inertia measured in motion.
        forces_at_rest = self._times(
            rest, Estimate(value=mass.value[:k], uncertainty=mass.uncertainty[:k])
        )
        wanted = self._reference(rest, np.zeros((k, len(self.task.target.push))))[1]
        miss, miss_error = (
            forces_at_rest.value - wanted,
            forces_at_rest.uncertainty + 16 * EPSILON * np.abs(wanted),
        )
        for i, name in enumerate(self.names):
            if abs(miss[0, i]) > miss_error[0, i]:
                yield finding(
                    "rest",
                    (name,),
                    self._rest(equilibrium, position, name, float(forces_at_rest.value[0, i])),
                    expected=float(wanted[0, i]),
                    actual=float(forces_at_rest.value[0, i]),
                )
        expected = equilibrium.matrices["K"]
        yield from self._entries(
            "stiffness",
            equilibrium.name,
            expected,
            expected - _slopes(miss, step),
            _slope_errors(miss_error, step),
        )

    def _rest(self, equilibrium: OperatingPoint, position: Array, name: str, force: float) -> str:
        if np.array_equal(position, equilibrium.position) and not equilibrium.hold.any():
            where, other = f"in equilibrium {equilibrium.name!r}", "have none there"
        else:
            where = f"where {self._place(position)}"
            other = "have another force"
        return f"a force of {force:.6g} acts on {name} at rest {where}, but the equations {other}"

    def _held(
        self, equilibrium: OperatingPoint, position: Array | None, step: Array
    ) -> Iterator[AuditFinding]:
        """Yield a note if joint limits act about an equilibrium, so that terms are measured
        elsewhere.
        """
        held = tuple(stopped(*self._loaded, equilibrium.position, step))
        if held:
            where = "nowhere" if position is None else f"where {self._place(position)}"
            message = f"a joint limit holds {', '.join(held)} in equilibrium {equilibrium.name!r}:"
            message += f" no linearization is compared there, and terms are compared {where}"
            yield finding("unresolved", (*held, equilibrium.name), message, severity="note")

    def _place(self, position: Array) -> str:
        return ", ".join(f"{name} = {x:.4g}" for name, x in zip(self.names, position, strict=True))

    @property
    def _loaded(self) -> tuple[LoadedModel, CoordinateMap]:
        return self.accelerations.model, self.accelerations.coordinates

    def _smooth(self, position: Array, step: Array) -> Array | None:
        """Return the equilibrium, or the middle of the motions if a joint limit acts near it.

        The equations are evaluated at the same place, so any place will do. Return None if joint
        limits act everywhere.
        """
        passed = self.task.target.visited[:, : len(position)]
        away = np.linalg.norm((passed - np.median(passed, axis=0)) / step, axis=1)
        for place in (position, *passed[np.argsort(away)]):
            if not stopped(*self._loaded, place, step):
                return np.array(place)
        return None

    def _times(self, states: Array, mass: Estimate) -> Estimate:
        """Compute forces at states from the accelerations there and the known inertias."""
        none = np.zeros((len(states), len(self.task.target.push)))
        return force_of(
            mass, self.accelerations.measure(states, none, np.zeros((len(states), len(self.names))))
        )

    def _entries(
        self, kind: AuditKind, equilibrium: str, expected: Array, measured: Array, error: Array
    ) -> Iterator[AuditFinding]:
        """Yield each matrix entry that differs, and one note for the entries without a limit."""
        error = error + 16 * EPSILON * np.max(np.abs(expected), initial=0.0)
        # Scale of an entry: the inertia times a power of the fastest rate.
        inertia = np.sqrt(np.outer(self.inertia, self.inertia))
        resolved = error <= RESOLVED_SHARE * inertia * self.accelerations.fastest ** _RATES[kind]
        unresolved = []
        differing = np.abs(measured - expected) > error
        for i, row_name in enumerate(self.names):
            for j, other in enumerate(self.names):
                if j < i and (differing[j, i] or not resolved[j, i]):
                    continue  # symmetric: already reported
                subject = (row_name,) if i == j else (row_name, other)
                about = " and ".join(subject)
                if differing[i, j]:
                    here, there = float(measured[i, j]), float(expected[i, j])
                    message = _sentence(kind, about, i == j, here, there, float(error[i, j]))
                    if len(self.task.target.equilibria) > 1:
                        message += f" (about {equilibrium!r})"
                    yield finding(kind, subject, message, expected=there, actual=here)
                elif not resolved[i, j]:
                    unresolved.append(about)
        if unresolved:
            yield finding(
                "unresolved",
                (kind, *unresolved),
                f"the audit can't resolve {kind} of {listed(unresolved, NAMED)} without motion",
                severity="note",
            )

    def _anywhere(self, states: Array, inputs: Array, is_explained: bool) -> Iterator[AuditFinding]:
        n = len(self.names)
        masses, forces = self._reference(states, inputs)
        wanted = np.linalg.solve(masses, forces[:, :, None])[:, :, 0]
        accelerations = self.accelerations.measure(states, inputs, np.zeros((DRAWS, n)))
        if not np.isfinite(accelerations.value).all():
            message = "accelerations at random states are not finite"
            yield finding("acceleration", ("not finite",), message)
            return
        scale = np.max(np.abs(wanted), axis=0)
        error = accelerations.uncertainty + 16 * EPSILON * scale
        miss = np.abs(accelerations.value - wanted)
        differing = miss > error
        natural = np.maximum(scale, self.accelerations.speed * self.accelerations.fastest)
        lost = (error > RESOLVED_SHARE * natural).any(axis=1) & ~differing.any(axis=1)
        if lost.any():
            yield finding(
                "unresolved",
                ("acceleration",),
                f"the audit can't resolve the accelerations at {int(lost.sum())} of {DRAWS}"
                " random states",
                severity="note",
            )
        if not differing.any():
            return
        share = np.where(differing, miss / np.where(scale > 0, scale, 1.0), 0.0)
        row, i = np.unravel_index(int(np.argmax(share)), share.shape)
        here, there = float(accelerations.value[row, i]), float(wanted[row, i])
        shown = _told_apart(here, there)
        count = f"{int(differing.any(axis=1).sum())} of {DRAWS} random states differ"
        yield finding(
            "acceleration",
            (self.names[i],),
            f"the acceleration of {self.names[i]} is {shown[0]} in the model and {shown[1]} in the"
            f" equations at {self._state_text(states[row])} ({count})",
            expected=there,
            actual=here,
            severity="note" if is_explained else "finding",
        )


def _slopes(values: Array, steps: Array) -> Array:
    """Compute central differences: column j from the rows moved by +steps[j] and -steps[j]."""
    n = len(steps)
    slopes: Array = ((values[1 : n + 1] - values[n + 1 :]) / (2 * steps[:, None])).T
    return slopes


def _slope_errors(errors: Array, steps: Array) -> Array:
    n = len(steps)
    slopes: Array = ((errors[1 : n + 1] + errors[n + 1 :]) / (2 * steps[:, None])).T
    return slopes


_RATES: Mapping[str, int] = {"inertia": 0, "damping": 1, "stiffness": 2}

_COUPLING: Mapping[str, str] = {
    "inertia": "inertial coupling", "damping": "damping between", "stiffness": "stiffness between",
}  # fmt: skip


def _sentence(
    kind: str, about: str, is_own: bool, measured: float, expected: float, error: float
) -> str:
    name = f"{kind} of {about}" if is_own else f"{_COUPLING[kind]} {about}"
    nothing = max(error, 1e-9 * abs(expected - measured))
    if abs(measured) <= nothing:
        return f"{name} is 0 in the model and {expected:.6g} in the equations"
    if abs(expected) <= nothing:
        return f"{name} is {measured:.6g} in the model and 0 in the equations"
    shown = _told_apart(measured, expected)
    return f"{name} is {shown[0]} in the model and {shown[1]} in the equations"


def _told_apart(measured: float, expected: float) -> tuple[str, str]:
    share = abs(measured - expected) / max(abs(measured), abs(expected))
    digits = int(np.clip(np.ceil(-np.log10(share)) + 2, 4, 17)) if share > 0 else 17
    return f"{measured:.{digits}g}", f"{expected:.{digits}g}"
