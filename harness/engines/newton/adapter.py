"""Newton, on URDF, MJCF and USD: its own solver in generalized coordinates, with 32-bit numbers.

There are no contacts: Newton detects them in a separate call, which the adapter does not make.

A batch of worlds of one model, one per state, stepped together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from ..mjcf_engine import sample_mjcf
from ..protocol import (
    Array,
    EngineError,
    Force,
    LoadedModel,
    ModelSpec,
    Sample,
    StateForce,
    StepRule,
    clip_ranges,
)
from ..remark import Remark
from ..source import engine_errors, sample_stages, shortened
from ..tree_model import SpringForces
from ..urdf import UrdfReader, sample_urdf
from ..urdf_copy import with_changes, without_crossed_bounds
from ..urdf_engine import UrdfEngine, UrdfModel
from ..urdf_sidecar import ROBOTS
from .layout import Layout
from .mjcf import DROPS, read_mjcf
from .reading import (
    ParsedModel,
    collapse,
    collect_warnings,
    correct_inertias,
    limits_of,
    new_builder,
    without_limit_forces,
)
from .usd import USD_NON_PHYSICAL, read_usd

KEPT = 8
"""The most batch sizes whose worlds are kept, and step sizes whose launches are kept."""

TILED_JOINTS = 30
"""Joints of a world from which Newton multiplies matrices by tiles."""


class Worlds:
    """A model in B worlds.

    Args:
        builder: Newton's `ModelBuilder` of one world.
        layout: of its coordinates.
        springs: added along slides and hinges.
    """

    def __init__(self, builder: Any, layout: Layout, springs: SpringForces) -> None:
        self._builder, self._layout, self._springs = builder, layout, springs
        self._batch = lru_cache(maxsize=KEPT)(self._batch_of)

    def _batch_of(self, count: int) -> _Batch:
        import newton

        given = self._builder
        builder = newton.ModelBuilder(up_axis=given.up_axis, gravity=given.gravity)
        builder.replicate(given, count)
        return _Batch(builder.finalize(device="cpu", skip_validation_inertia=True))

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step all worlds, as in `Model.rollout`."""
        layout, batch = self._layout, self._batch(len(q))
        launch, pushed = batch.step(h), force is not None or not self._springs.empty
        batch.set_state(
            *layout.given(q, v)
        )  # the recording also steps the state, so record before setting it
        out = np.empty((2, len(q), n // every, q.shape[1]))
        near = q
        for i in range(n):
            if pushed:
                near = layout.coordinates_of(batch.q, near)
                batch.push(layout.forces(near, self._forces(batch, near, force, i)))
            launch()
            if (i + 1) % every == 0:
                near = layout.coordinates_of(batch.q, near)
                out[0, :, i // every], out[1, :, i // every] = near, layout.rates(near, batch.v)
        return out[0], out[1]

    def _forces(self, batch: _Batch, z: Array, force: Force, i: int) -> Array:
        if isinstance(force, StateForce):
            rows = zip(z.tolist(), force.inputs[:, i].tolist(), strict=True)
            forces = np.array([force.evaluate(at, u) for at, u in rows], dtype=float)
        else:
            forces = np.zeros_like(z) if force is None else np.array(force[:, i])
        if not self._springs.empty:
            indices = self._layout.singles
            forces[:, indices] += self._springs.forces(z[:, indices], batch.v[:, indices])
        return forces


class _Batch:
    """A finalized model with its solver, state and forces; arrays share their memory."""

    def __init__(self, model: Any) -> None:
        import newton

        self._model = model
        # Tiles compile for 5 to 15 s, once; then a step of 78 joints takes 0.2 instead of 15 ms.
        tiles = model.joint_count > TILED_JOINTS * model.world_count
        self._solver = newton.solvers.SolverFeatherstone(model, use_tile_gemm=tiles)
        self._state, self._control = model.state(), model.control()
        shape = model.world_count, -1
        self.q = self._state.joint_q.numpy().reshape(shape)
        self.v = self._state.joint_qd.numpy().reshape(shape)
        self._force = self._control.joint_f.numpy().reshape(shape)
        self.step = lru_cache(maxsize=KEPT)(self._recorded)

    def set_state(self, q: Array, v: Array) -> None:
        """Set a state, without forces."""
        self.q[:], self.v[:], self._force[:] = q, v, 0.0

    def push(self, force: Array) -> None:
        """Set the forces of the next step."""
        self._force[:] = force

    def _recorded(self, h: float) -> Any:
        """Record the launches of a step of h once, since calls from Python take most of its
        time.
        """
        import warp as wp

        self._once(h)  # allocate memory before the capture
        with wp.ScopedCapture(device="cpu") as capture:
            self._once(h)
        return lambda: wp.capture_launch(capture.graph)

    def _once(self, h: float) -> None:
        self._solver.step(self._state, self._state, self._control, None, h)


READER = UrdfReader(
    name="newton",
    no_inertial="the mass of its collision shapes at 1000 kg/m^3, or none",
    equal_bounds=True,
    no_friction="Newton",
    stops_turns="Newton",
)


def without_idle_shapes(robot: XmlElement) -> None:
    """Remove shapes, except those from which Newton computes a mass."""
    for link in robot.findall("link"):
        tags = ("visual",) if link.find("inertial") is None else ("visual", "collision")
        for shape in [shape for tag in tags for shape in link.findall(tag)]:
            link.remove(shape)


def read_urdf(model: UrdfModel) -> ParsedModel:
    """Read a URDF and its sidecar's declarations.

    Raises:
        EngineError: naming file and joint.
    """
    robot = with_changes(model.declared.robot, model.declared.changes)
    builder, messages = new_builder(model.gravity), list[str]()
    with collect_warnings(messages):
        text = robot.written().decode()
        builder.add_urdf(text, floating=model.floats, enable_self_collisions=False)
    if model.settings["smooth"]:
        without_limit_forces(builder)
    corrected = correct_inertias(builder, messages) if model.settings["corrected_inertias"] else ()
    lost = collapse(builder, bool(model.settings["collapse_fixed_joints"]))
    prefix = f"{robot.get('name')}/" if robot.get("name") else ""
    names: list[list[str]] = []
    for label, (lines, turns) in zip(builder.joint_label, builder.joint_dof_dim, strict=True):
        name = label.removeprefix(prefix)
        if lines + turns > 1 and not (model.floats and not names):
            raise EngineError(f"{model.path}: joint {name!r} is neither a slide nor a hinge")
        names.append([model.root if model.floats and not names else name][: lines + turns])
    layout = Layout(builder, names, np.zeros(len(builder.joint_qd)))
    springs = model.declared.springs
    return ParsedModel(
        builder=builder,
        layout=layout,
        springs=springs,
        lost=lost,
        corrected=corrected,
        messages=messages,
    )


DEFAULTS: Mapping[str, bool] = MappingProxyType({
    **ROBOTS,
    # Whether Newton enlarges small moments, and drops those without mass, its default.
    "corrected_inertias": True,
    # Whether welded links of a URDF are merged by Newton, which does it wrongly in 1.8.0.
    "collapse_fixed_joints": False,
    # Whether an MJCF's fixed tendons are added as forces; Newton's own solvers leave them out.
    "tendons": True,
    # Whether an MJCF's joint equalities become mimics, which its solver enforces; it drops
    # equalities.
    "equalities": True,
    # Whether joints of a USD stage without an articulation root are put into one; Newton's own
    # solver leaves them out.
    "articulations": False,
})  # fmt: skip


class NewtonEngine(UrdfEngine):
    """Adapter of Newton (Newton Developers 2025), on Warp."""

    name = "newton"
    title = "Newton"
    formats = (".urdf", ".xml", *USD_SUFFIXES)
    package, distribution, extra = "newton", "newton", "newton"
    defaults = DEFAULTS
    non_physical = MappingProxyType({**UrdfEngine.non_physical, **USD_NON_PHYSICAL})
    capabilities = (
        "joints: slide, hinge, ball, free",
        "springs: joint springs; fixed tendons by the adapter",
        "mimic: yes",
        "next state: with slides and hinges only",
        "accelerations: no",
        "linearization: from steps, 32 bits",
        "steps: semi-implicit Euler, order 1, 32 bits",
        "whole step: not judged",
    )
    default_settings_note = "no step, since it takes none, and -9.81 m/s^2"
    ignores = frozenset({"dynamics@friction", "joint@frictionloss"})

    def load(self, spec: ModelSpec) -> LoadedModel:
        """Load a file; an MJCF states step and gravity itself."""
        if "controls" in spec.settings:
            raise EngineError(f"{spec.path}: it has actuators, which {DROPS}")
        return super().load(spec)

    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Load a file whose settings are valid."""
        if spec.path.suffix == ".urdf":
            return NewtonUrdf(spec)
        return NewtonTree(spec, read_usd if spec.path.suffix in USD_SUFFIXES else read_mjcf)

    def samples(self) -> tuple[Sample, ...]:
        """Return one sample of each format."""
        return (sample_urdf(), sample_mjcf(armature=""), *sample_stages())


class NewtonModel(LoadedModel):
    """A tree in one world per state; the shared part of both formats."""

    integrator = "semi-implicit euler"
    epsilon = float(np.finfo(np.float32).eps)

    def _take(self, spec: ModelSpec, read: ParsedModel) -> None:
        if not read.layout.names:
            raise EngineError(f"{spec.path}: it has no moving joint")
        self.coordinates, self._file, self._read = tuple(read.layout.names), spec.path, read
        self._corrected, self._messages = read.corrected, tuple(dict.fromkeys(read.messages))
        springs = SpringForces(read.springs, read.layout.scalars, spec.path)
        self._worlds = Worlds(read.builder, read.layout, springs)
        start, still = self.home[None], np.zeros((1, len(self.coordinates)))
        if not np.isfinite(self.rollout(start, still, 1e-3, 1, None, 1)).all():
            raise EngineError(f"{spec.path}: a joint moves nothing with inertia")

    @property
    def home(self) -> Array:
        """Positions of the drawn configuration."""
        home: Array = self._read.layout.home
        return home

    @property
    def limits(self) -> Array:
        """Positions at which a limit's spring and damper begin to act."""
        return limits_of(self._read)

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1 for every input."""
        return 1, 1

    @property
    def step_rule(self) -> StepRule | None:
        """The rule: all forces at the step's start; rotations have a different rule."""
        plain = len(self._read.layout.scalars) == len(self.coordinates)
        return StepRule(scheme="semi-implicit Euler") if plain else None

    @property
    def _changed_cause(self) -> str:
        """The cause that a diagnosis reports; empty if no inertia was changed."""
        names = shortened(self._corrected)
        return f"inertias that Newton changes ({names})" if names else ""

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """Changes by Newton, and elements that its solver leaves out under the settings, with
        corrections.
        """
        settings = dict(self._read.lost)
        return (
            {**settings, self._changed_cause: {"corrected_inertias": False}}
            if self._corrected
            else settings
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of Newton while it loaded the file."""
        return self._messages

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield elements that Newton changes, leaves out or ignores."""
        if self._corrected:
            message = (
                f"{self._changed_cause}: they are too small relative to the body's other "
                "moments, violate the triangle inequality, or have no mass"
            )
            yield Remark(kind="replaced", message=message, address="", shows_in=("inertia",))
        for cause in self._read.lost:
            yield Remark(kind="setting", message=f"{cause}, by a setting", address="", fault=True)
        for message, address in self._read.notes.items():
            yield Remark(message=message, address=address)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step all states, with one world for each."""
        with engine_errors(self._file, "Newton"), np.errstate(all="ignore"):
            return self._worlds.rollout(q, v, h, n, force, every)


class NewtonUrdf(NewtonModel, UrdfModel):
    """A URDF."""

    def __init__(self, spec: ModelSpec) -> None:
        further = (without_idle_shapes, without_crossed_bounds)
        UrdfModel.__init__(self, spec, "Newton", READER, DEFAULTS, further)
        self._take(spec, read_urdf(self))

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield also ignored parts of the URDF."""
        yield from UrdfModel.remarks(self, z, w)
        yield from NewtonModel.remarks(self, z, w)


class NewtonTree(NewtonModel):
    """An MJCF or a stage of USD, which `read` parses."""

    def __init__(
        self, spec: ModelSpec, read: Callable[[ModelSpec, Mapping[str, object]], ParsedModel]
    ) -> None:
        settings = {**DEFAULTS, **spec.settings}
        others = ("held", "floating") if read is read_mjcf else ()
        for key in (*others, "collapse_fixed_joints"):
            if settings.get(key):
                raise EngineError(f"{spec.path}.toml: Newton's adapter takes {key} only for URDFs")
        self.step = float(settings["step"])  # type: ignore[arg-type]  # checked
        self.gravity = tuple(map(float, settings["gravity"]))  # type: ignore[call-overload]
        self._take(spec, read(spec, settings))

    @property
    def sampling_range(self) -> Array:
        """Sampling range around home, within limits."""
        return clip_ranges(super().sampling_range + self.home[:, None], self.limits)
