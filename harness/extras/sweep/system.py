"""A system folder in a sweep: its equations and its models, prepared once for all its cases."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from physics_crosscheck.harness.checks.by_steps import SteppedModel, StepsVerdict, decide_by_steps
from physics_crosscheck.harness.checks.case import StepError
from physics_crosscheck.harness.checks.prepare import STEPPED
from physics_crosscheck.harness.checks.verdict import (
    CaseJudgement,
    component_scale,
    failure,
    judged,
    nonzero_scale,
)
from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.bindings import (
    ParametricModelFile,
    parametric_model_file,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.convergence import largest
from physics_crosscheck.harness.numerics.coordinates import (
    CoordinateFamily,
    CoordinateMap,
    coordinate_family,
)
from physics_crosscheck.harness.numerics.full_run import SampledRun, sampled_run, why_no_run
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.outcome import FLOOR, Outcome
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.mechanism.declaration import Scenario
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.next_state import (
    DrawnEquations,
    Family,
    stepped_equations,
)
from physics_crosscheck.reference.solving.segments import Motion, even_indices
from physics_crosscheck.reference.solving.solve import solve
from .planned import KEPT, Block, CaseRecord, Integrators, Planned, Source, StepClock


@dataclass(frozen=True)
class PreparedModel:
    """A model in an engine, ready for any constants.

    Attributes:
        model_file: its file.
        coordinates: map between the system and the engine.
        integrator: name of its own integrator.
        integrators: other integrators of the engine, with the settings that select them.
    """

    model_file: ParametricModelFile
    coordinates: CoordinateFamily
    integrator: str
    integrators: Mapping[str, Mapping[str, object]]


class Swept(Source):
    """A system folder, and the data that its cases share.

    Attributes:
        varied: names of the varied constants.
        system: the declared system.
        family: its equations, for any constants.
    """

    signed = True  # the equations are simplified with the sign

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.varied = frozenset[str]()
        self.system: System = load_system(folder)
        self.family = Family.compile(derive(self.system))
        self._models: dict[tuple[str, str], PreparedModel] = {}
        self.motion = lru_cache(maxsize=KEPT)(self._motion)

    def varying(self, varied: frozenset[str]) -> Swept:
        """Return the folder with other varied constants in its models; the equations are shared."""
        other = copy(self)
        other.varied, other._models = varied, {}
        return other

    @property
    def own_constants(self) -> frozenset[str]:
        """Varied constants of this system."""
        return self.varied & self.constants.keys()

    @property
    def needed(self) -> frozenset[str]:
        """Varied constants that its accelerations depend on."""
        symbols = set[sp.Basic]().union(
            *(e.free_symbols for e in self.family.equations.acceleration)
        )
        return frozenset(c.name for c in self.system.constants if c.symbol in symbols)

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.system.name

    @property
    def constants(self) -> Mapping[str, float]:
        """All constants, with declared values."""
        return {c.name: c.value for c in self.system.constants}

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios."""
        return tuple(one.name for one in self.system.scenarios)

    def prepare(self, model: str, engine: str) -> Integrators:
        """Load the unchanged model, find its literals, and compile coordinates and scales."""
        _ = self.declared_motions
        prepared = self.model(model, engine)
        return prepared.integrator, prepared.integrators

    def model(self, name: str, engine: str) -> PreparedModel:
        """Return a model in an engine, prepared on first use.

        Raises:
            SidecarError, LocationError, EngineError: naming file, place and remedy.
        """
        if (name, engine) not in self._models:
            sidecar = self.sidecar(name)
            loaded = engines()[engine].load(sidecar.spec(engine))
            coordinates = coordinate_family(self.system, sidecar, loaded.coordinates)
            needed = self.needed | coordinates.constants
            model_file = parametric_model_file(self.system, sidecar, self.own_constants, needed)
            self._models[name, engine] = PreparedModel(
                model_file, coordinates, loaded.integrator, loaded.integrators
            )
        return self._models[name, engine]

    def _motion(self, constants: tuple[tuple[str, float], ...], scenario: str) -> Motion:
        """Return the reference motion of a scenario with other constants.

        Raises:
            DeclarationError, ReferenceError: if no motion exists.
        """
        equations = self.family.with_constants(dict(constants))
        return solve(equations, self.system.scenario(scenario), bound_along=False)

    @cached_property
    def declared_motions(self) -> Mapping[str, Motion]:
        """Motions of all scenarios at the declared constants, as scales of the components."""
        equations = self.family.with_constants({})
        scenarios: tuple[Scenario, ...] = self.system.scenarios
        return {one.name: solve(equations, one, bound_along=False) for one in scenarios}

    @cached_property
    def amplitude(self) -> Array:
        """Largest magnitude of each component over all scenarios as declared, (2n,)."""
        amplitudes: Array = np.max([m.amplitude for m in self.declared_motions.values()], axis=0)
        return amplitudes

    def run(self, case: Planned, block: Block, place: Path, record: CaseRecord) -> None:
        """Judge the drawn motion, and run it once at the time step."""
        row = case.row
        equations = self.family.with_constants(row.constants)
        with record.timing("reference_seconds"):
            motion = self.motion(tuple(row.constants.items()), row.scenario)
        prepared = self.model(row.model, row.engine)
        constants = {c.name: c.value for c in equations.system.constants}
        with record.timing("loading_seconds"):
            sidecar = prepared.model_file.write(constants, place)
            model = loaded(sidecar, row.engine, row.step, case.settings)
        record.check_step(model, case)
        if why := why_no_run(motion.duration, model.step):
            raise StepError(f"{row.model}: {why}")
        with record.stepping(StepClock(model)):
            coordinates = prepared.coordinates.with_constants(equations.values)
            loaded_model = model, coordinates
            steps = None
            if not block.thorough:
                steps = self._by_steps(equations, motion, *loaded_model, block.resolution)
            run: SampledRun
            if steps is not None and steps.motion is not None:
                verdict, run = steps.verdict, steps.motion.run
            else:
                verdict = self._by_segments(case, motion, *loaded_model, block.resolution)
                run = sampled_run(*loaded_model, motion, model.step)
            record.set_verdict(verdict)
            self._set_error(case, motion, run, model, record)

    def _by_steps(
        self,
        equations: DrawnEquations,
        motion: Motion,
        model: LoadedModel,
        coordinates: CoordinateMap,
        resolution: float,
    ) -> StepsVerdict | None:
        """Return the verdict by single steps; None where segments must decide."""
        stepped = stepped_equations(equations)
        if stepped is None:
            return None
        some = motion.pick(even_indices(len(motion.t), STEPPED))
        compared = SteppedModel(
            model=model,
            coordinates=coordinates,
            stepped=stepped,
            components=self._components,
            inputs=some.start_inputs.shape[1],
            resolution=resolution,
        )
        states = some.start, some.start_inputs
        stepping = compared.single_steps(*states, fastest=motion.fastest)
        return decide_by_steps(compared, stepping, compared.accelerations(*states), motion)

    @property
    def _components(self) -> tuple[str, ...]:
        names = [c.name for c in self.system.coordinates]
        return (*names, *(f"{name}_dot" for name in names))

    def _by_segments(
        self,
        case: Planned,
        motion: Motion,
        model: LoadedModel,
        coordinates: CoordinateMap,
        resolution: float,
    ) -> CaseJudgement:
        others = [m for name, m in self.declared_motions.items() if name != case.row.scenario]
        segments = replace(motion, scale=component_scale(motion, others))
        return judged(
            extrapolate(model, coordinates, segments, resolution=resolution),
            segments,
            components=self._components,
            coordinates=tuple(model.coordinates),
            claimed=model.exponents(motion.varying)[0],
            resolution=resolution,
        )

    def _set_error(
        self, case: Planned, motion: Motion, run: SampledRun, model: LoadedModel, record: CaseRecord
    ) -> None:
        """Set the error at the time step, and why the run failed if it did."""
        amplitude = nonzero_scale(np.maximum(motion.amplitude, FLOOR * self.amplitude))
        error = largest(run, amplitude[: len(self.system.coordinates)])
        record.update(global_error=number(error))
        why, kind = failure(run, error, motion)
        if why:
            message = "; the engine warns: ".join((f"{case.row.model}: {why}", *model.warnings))
            record.update(outcome=Outcome.FAILED, reason=message, kind=kind)


def loaded(
    sidecar: Sidecar, engine: str, step: float | None, settings: Mapping[str, Any]
) -> LoadedModel:
    """Load a model with another step and integrator, if requested.

    Raises:
        EngineError: naming file, place and remedy.
    """
    merged_settings = {**sidecar.engine_settings.get(engine, {}), **settings}
    if step is not None:
        merged_settings["step"] = step
    changed = replace(sidecar, engine_settings={**sidecar.engine_settings, engine: merged_settings})
    return engines()[engine].load(changed.spec(engine))
