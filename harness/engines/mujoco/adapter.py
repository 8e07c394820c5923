"""MuJoCo, on MJCF and URDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache, cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.urdf import UrdfFile
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia, from_quaternion
from ..compiled import CompiledTree
from ..installed import version_of
from ..mjcf_engine import MJCF_NON_PHYSICAL, sample_mjcf
from ..protocol import (
    Array,
    DefaultLeftOn,
    Engine,
    EngineError,
    Force,
    LeftOut,
    LoadedModel,
    ModelSpec,
    Sample,
    StateForce,
    StepRule,
    clip_ranges,
)
from ..remark import Remark
from ..source import engine_errors
from ..urdf import SETTINGS, URDF_NON_PHYSICAL, load_urdf, sample_urdf
from ..urdf_copy import (
    Change,
    bare_cause,
    followers_of,
    temporary_urdf,
    with_forms,
    without_visuals,
)
from .mjcf import checked_numbers, checked_step, included, load_error, sources
from .pulls import equalities_act
from .remarks import UNCOMPENSATED, file_remarks, idle_compensation, model_remarks
from .shapes import (
    mesh_of,
    mesh_offset,
    placed_shapes,
    shape_name,
    without_idle_files,
    without_mesh_files,
)
from .smooth import (
    WITHOUT,
    Warnings,
    apply_settings,
    held_controls,
    is_on,
    keep_equalities,
    remove_uncovered,
    rounded_frames,
    state_names,
    states_move,
    without_joints,
)
from .state import States, equality_errors, forward, holds_exactly, step_rule
from .tree import compiled_tree
from .urdf import (
    FORMS,
    SHAPE_MASSES,
    changes,
    complete_urdf,
    extension_cause,
    extensions,
    name_collisions,
    shaped_links,
    urdf_whole,
)
from .whole import MujocoWhole


class PoseEvaluator:
    """Poses by `kind:name`; `centre` is a body's centre of mass, in the body's axes.

    Args:
        model: compiled; for a URDF, without fusing links on fixed joints.
        body: the file's word for a body: `body`, or `link` in a URDF.
        scales: of meshes, by name, if their files are replaced.
    """

    def __init__(
        self, model: Any, body: str, scales: Mapping[str, tuple[float, ...]] | None = None
    ) -> None:
        import mujoco

        self._model, self._data, self._scales = model, mujoco.MjData(model), scales or {}
        self._named = body == "link"
        kinds = {
            body: (model.nbody, model.body, "xpos", "xmat"),
            "centre": (model.nbody, model.body, "xipos", "xmat"),
            "site": (model.nsite, model.site, "site_xpos", "site_xmat"),
            "geom": (model.ngeom, model.geom, "geom_xpos", "geom_xmat"),
        }
        self._rows = {
            f"{kind}:{name}": (at, turn, i)
            for kind, (count, named, at, turn) in kinds.items()
            for i in range(count)
            if (name := named(i).name)
        }
        for i in range(1, model.nbody):
            if not model.body(i).name:
                self._rows.setdefault(f"{body}:body_{i}", (*kinds[body][2:], i))
        for kind in ("geom", "site"):
            count, _, *fields = kinds[kind]
            for i in range(count):
                self._rows.setdefault(shape_name(kind, "", i), (fields[0], fields[1], i))
        self._rows = {self._place(place): row for place, row in self._rows.items()}
        self._meshes = {
            i: mesh_offset(model, mesh)
            for i in range(model.ngeom)
            if (mesh := mesh_of(model, i)) >= 0
        }

    @cached_property
    def shapes(self) -> Mapping[str, tuple[float, ...]]:
        """Geoms and sites with their sizes, or the scales of meshes; those of a URDF have names."""
        return {
            self._place(shape.name): self._scales.get(shape.mesh, shape.size)
            for shape in placed_shapes(self._model)
        }

    def _place(self, name: str) -> str:
        return name.removeprefix("geom:") if self._named else name

    @property
    def places(self) -> tuple[str, ...]:
        """All places with a name."""
        places = (one for one in self._rows if not one.startswith("collision:"))
        return tuple(place for place in places if ":#" not in place)

    def evaluate(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return origins (K, F, 3) and rotations (K, F, 3, 3) at positions z, (K, nz)."""
        import mujoco

        wanted = [self._rows[place] for place in places]
        origins, turns = np.empty((len(z), len(wanted), 3)), np.empty((len(z), len(wanted), 3, 3))
        with _own_frames(self._model):
            for k, qpos in enumerate(z):
                self._data.qpos[:] = qpos
                mujoco.mj_kinematics(self._model, self._data)
                for f, (positions_field, turn, i) in enumerate(wanted):
                    origins[k, f] = getattr(self._data, positions_field)[i]
                    turns[k, f] = getattr(self._data, turn)[i].reshape(3, 3)
        for f, (field, _, i) in enumerate(wanted):
            if field == "geom_xpos" and i in self._meshes:
                origin, quaternion = self._meshes[i]
                origins[:, f] += turns[:, f] @ origin
                turns[:, f] = turns[:, f] @ from_quaternion(quaternion)
        return origins, turns


@contextmanager
def _own_frames(model: Any) -> Iterator[None]:
    """Compute the frames of shapes and sites as they are compiled.

    MuJoCo takes those within 1e-6 of a body's frame for that frame, like inertial frames: see
    `rounded_frames`.
    """
    flags = model.geom_sameframe, model.site_sameframe
    kept = [each.copy() for each in flags]
    try:
        for each in flags:
            each[:] = 0
        yield
    finally:
        for each, before in zip(flags, kept, strict=True):
            each[:] = before


_ORDERS = {"mjINT_EULER": 1, "mjINT_IMPLICIT": 1, "mjINT_IMPLICITFAST": 1, "mjINT_RK4": 4}


_SOFT = "soft equality (solref, solimp)"
_SAME = "inertial frames within 1e-6 of their bodies' frames are taken for these"
_DEFAULT_SOFTNESS: Mapping[str, object] = {
    "solref": [0.02, 1.0],
    "solimp": [0.9, 0.95, 0.001, 0.5, 2.0],
}
_STIFF: Mapping[str, object] = {"solref": [1e-6, 0.5], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2]}
"""The default softness of equalities, and the stiffest that a step allows, which settles in one
step.
"""

LAW_VERSION = 4
"""Major version whose constraint law is known here; earlier ones mix margins otherwise."""


class MujocoEngine(Engine):
    """Adapter of MuJoCo (Todorov, Erez and Tassa 2012)."""

    name = "mujoco"
    title = "MuJoCo"
    formats = (".xml", ".urdf")
    capabilities: tuple[str, ...] = (
        "joints: slide, hinge, ball, free",
        "springs: joint, tendon, combination (URDF)",
        "mimic: soft equality",
        "next state: yes",
        "accelerations: yes",
        "linearization: from steps",
        "steps: Euler, implicit, implicitfast: order 1; RK4: order 4",
        "whole step: by the documented law",
    )
    default_settings_note = "2 ms and -9.81"
    takes_springs = (".urdf",)
    stated_settings = MappingProxyType({"integrator": "Euler"})
    non_physical = MappingProxyType({**URDF_NON_PHYSICAL, **MJCF_NON_PHYSICAL})
    choices = (
        r".*@(contype|conaffinity|condim|group|priority|.*iterations|count)"
        r"|.*/(texture|global|quality|hfield|size)@\w+|.*/numeric@size"
    )
    compiles: tuple[str, ...] = (".xml",)
    places: tuple[str, ...] = (".xml", ".urdf")
    switches = frozenset({"smooth", "couplings", "held", "actuators", "controls", "activations"})
    usual_mistakes: tuple[DefaultLeftOn | LeftOut, ...] = (
        LeftOut(
            name="soft equality, solref left out",
            within="equality",
            defaults=_DEFAULT_SOFTNESS,
            cause=_SOFT,
        ),
        DefaultLeftOn(
            name="the solver stops at its default tolerance",
            setting="tolerance",
            value=1e-8,
            cause="the solver stops before it converges",
            whole=True,
        ),
    )

    def version(self) -> str | None:
        """Return the version of the installed package, or None."""
        return version_of("mujoco", "mujoco")

    def load(self, spec: ModelSpec) -> MujocoModel:
        """Load an MJCF or URDF file."""
        import mujoco

        file = load_urdf(spec.path) if spec.path.suffix == ".urdf" else None
        document = None if file is None else file.document
        robot = None if document is None else document.root
        xml_sources, warnings = sources(spec.path, document), Warnings()
        try:
            with warnings.collecting(), temporary_urdf(robot, spec.path, changes(spec)) as path:
                tree = mujoco.MjSpec.from_file(str(path))
                if file is not None:
                    complete_urdf(tree, spec, file)
                apply_settings(tree, spec)
                if robot is None:  # a URDF's copy holds them
                    spec = without_joints(tree, spec)
                model = tree.compile()
        except EngineError:
            raise
        except Exception as error:
            raise load_error(error, spec.path, xml_sources) from None
        if is_on(spec, "exact_frames", otherwise=False):
            model.body_sameframe[:] = 0
        if is_on(spec, "compensated", otherwise=False):
            model.jnt_actgravcomp[:] = 0
        keep_equalities(model, followers_of(spec.settings, f"{spec.path}.toml"))
        if is_on(spec, "smooth", otherwise=False):
            remove_uncovered(model)
        checked_step(model.opt.timestep, xml_sources, spec, mujoco.mjMINVAL)
        checked_numbers(_not_finite(model), xml_sources, spec.path)
        if not model.njnt:
            raise EngineError(f"{spec.path}: it has no moving joint")
        if (model.nu or model.na) and not (
            is_on(spec, "smooth", otherwise=False) or "controls" in spec.settings
        ):
            raise EngineError(
                f"{spec.path}: it has actuators, but crosscheck applies inputs to joints; "
                "hold them at [settings] controls, or remove them"
            )
        controls = held_controls(model, spec)
        # A diverged run must stay diverged: the automatic reset would return zeros, so that all
        # step sizes would agree.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        return self.model_of(model, spec, file, xml_sources, warnings, controls)

    def load_whole(self, spec: ModelSpec) -> MujocoWhole | None:
        """Load a file with all its forces."""
        import mujoco

        if mujoco.mj_version() // 1_000_000 != LAW_VERSION:
            return None
        whole = (self._urdf_whole if spec.path.suffix == ".urdf" else self._mjcf_whole)(spec)
        if "tolerance" in spec.settings:
            whole.solver = {**whole.solver, "tolerance": spec.settings["tolerance"]}
        return whole

    def _mjcf_whole(self, spec: ModelSpec) -> MujocoWhole:
        import mujoco

        xml_sources, warnings = sources(spec.path), Warnings()
        try:
            with warnings.collecting():
                tree = mujoco.MjSpec.from_file(str(spec.path))
                without_idle_files(tree, contacts=True)
                model = tree.compile()
        except Exception as error:
            raise load_error(error, spec.path, xml_sources) from None
        return self._whole_of(spec, model)

    def _whole_of(self, spec: ModelSpec, model: Any) -> MujocoWhole:
        with engine_errors(spec.path, self.title):
            return self.whole_of(model)

    def _urdf_whole(self, spec: ModelSpec) -> MujocoWhole:
        file, warnings = load_urdf(spec.path), Warnings()
        try:
            with warnings.collecting():
                return urdf_whole(spec, file, partial(self._whole_of, spec))
        except EngineError:
            raise
        except Exception as error:
            raise load_error(error, spec.path, sources(spec.path, file.document)) from None

    def whole_of(self, compiled: Any) -> MujocoWhole:
        """Return the model of whole steps."""
        return MujocoWhole(compiled)

    def model_of(self, model: Any, spec: ModelSpec, *further: Any) -> MujocoModel:
        """Return the model to step; the arguments are those of `MujocoModel`."""
        return (ActuatedModel if states_move(model, spec) else MujocoModel)(model, spec, *further)

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return the settings of a URDF: step and gravity, with MuJoCo's own defaults."""
        return SETTINGS if suffix == ".urdf" else {}

    def parts(self, path: Path) -> tuple[Path, ...]:
        """Return an MJCF and its includes."""
        return included(path)

    def file_remarks(self, path: Path) -> Iterator[Remark]:
        """Yield masses and inertias that the compiler replaces, and elements without effect."""
        robot = load_urdf(path).document.root if path.suffix == ".urdf" else None
        if robot is not None and robot.find("mujoco/compiler") is None:
            return
        with temporary_urdf(
            robot, path, changes(ModelSpec(path, settings={"smooth": True}))
        ) as copy:
            yield from file_remarks(copy, path)

    def compiled(self, path: Path, texts: Mapping[Path, bytes] | None = None) -> CompiledTree:
        """Return an MJCF as MuJoCo compiles it."""
        return compiled_tree(path, texts or {})

    def samples(self) -> tuple[Sample, ...]:
        """Return MJCF samples with every order and treatment of damping, and a URDF."""
        names = ("Euler", "implicit", "implicitfast", "RK4")
        options = ' integrator="{}" jacobian="dense"'
        mjcf = (sample_mjcf(name, options.format(name), armature="") for name in names)
        return (*mjcf, sample_urdf())


def _not_finite(model: Any) -> dict[str, object]:
    """Return fields of a compiled model that are not finite, except ranges."""
    parts = ((model, _reals("model")), (model.opt, _reals("options")))
    fields = {name: getattr(part, name) for part, names in parts for name in names}
    if np.isfinite(np.concatenate([one.ravel() for one in fields.values() if one.size])).all():
        return {}  # one call: a large share of the time to load a small model
    return {name: value for name, value in fields.items() if not np.isfinite(value).all()}


@cache
def _reals(owner: str) -> tuple[str, ...]:
    """Return the attributes of a model, or of its options, that are real arrays."""
    import mujoco

    empty = mujoco.MjSpec().compile()
    part = empty if owner == "model" else empty.opt
    return tuple(
        name
        for name in dir(part)
        if name[0] != "_" and "range" not in name
        if isinstance(value := getattr(part, name), np.ndarray) and value.dtype.kind == "f"
    )


class MujocoModel(LoadedModel):
    """A compiled model, whose state is (qpos, qvel)."""

    def __init__(
        self,
        model: Any,
        spec: ModelSpec,
        file: UrdfFile | None,
        xml_sources: tuple[Document, ...],
        warnings: Warnings,
        controls: tuple[Array, Array],
    ) -> None:
        import mujoco

        self._controls, self._activations = controls

        self.model, self._spec, self._sources, self._warnings = model, spec, xml_sources, warnings
        self._urdf_file = file
        self._states = States(model)
        self.coordinates = self._states.names
        # Read the step now: every rollout sets another.
        self.step = float(model.opt.timestep)
        name: str = mujoco.mjtIntegrator(model.opt.integrator).name
        self.integrator = name.removeprefix("mjINT_").lower()
        self.gravity = tuple(float(component) for component in model.opt.gravity)

    @property
    def home(self) -> Array:
        """Positions in the drawn configuration, (nz,)."""
        qpos = np.array(self.model.qpos0, dtype=float)
        return np.array(self._states.coordinates_of(qpos, None))

    @property
    def sampling_range(self) -> Array:
        """Sampling range of positions, (nz, 2): limits, or one turn of a hinge, or 1 m or 1 rad
        each way.
        """
        import mujoco

        joints = self._states.joints
        hinge = np.array(self.model.jnt_type)[joints] == mujoco.mjtJoint.mjJNT_HINGE
        half = np.where(hinge, np.pi, 1.0)
        free = np.stack([self.home - half, self.home + half], axis=1)
        limited = self._limited
        return clip_ranges(free, np.where(limited[:, None], self.model.jnt_range[joints], free))

    @property
    def limits(self) -> Array:
        """Joint limits, less the margin at which their forces begin, (nz, 2)."""
        joints = self._states.joints
        margin = np.array(self.model.jnt_margin)[joints, None] * [1.0, -1.0]
        bounds = self.model.jnt_range[joints] + margin
        return np.where(self._limited[:, None], bounds, [-np.inf, np.inf])

    @property
    def _limited(self) -> NDArray[np.bool_]:
        """Mask of coordinates with limits, (nz,)."""
        limited = np.array(self.model.jnt_limited, dtype=bool)[self._states.joints]
        result: NDArray[np.bool_] = np.logical_and(limited, self._states.single)
        return result

    @property
    def corrective_settings(self) -> dict[str, Mapping[str, object]]:
        """Settings that stiffen equalities, compensate gravity, or compute body frames exactly."""
        settings: dict[str, Mapping[str, object]] = {_SOFT: dict(_STIFF)} if self.model.neq else {}
        if self._shaped:
            cause = bare_cause(self._shaped, "MuJoCo's masses from the shapes")
            settings[cause] = {SHAPE_MASSES: False}
        settings |= self._extended
        if idle_compensation(self.model):
            settings[UNCOMPENSATED] = {"compensated": True}
        return (
            {**settings, _SAME: {"exact_frames": True}} if rounded_frames(self.model) else settings
        )

    @cached_property
    def _extended(self) -> dict[str, Mapping[str, object]]:
        """Attributes in `<mujoco>` of a URDF, with the masses that each changes."""
        settings: dict[str, Mapping[str, object]] = {}
        chosen = self._spec.settings
        for element, key in extensions(self._urdf_file.document.root) if self._urdf_file else ():
            without = {WITHOUT + key: True}
            if not without.items() <= chosen.items():
                other = MujocoEngine().load(replace(self._spec, settings={**chosen, **without}))
                stated, compiled = (
                    {name: one.mass for name, one in model.inertias.items()}
                    for model in (other, self)
                )
                settings[extension_cause(element, key, stated, compiled)] = without
        return settings

    @cached_property
    def _shaped(self) -> list[XmlElement]:
        """Links without `<inertial>` whose masses come from shapes."""
        if self._urdf_file is None or not is_on(self._spec, SHAPE_MASSES, otherwise=True):
            return []
        floats = is_on(self._spec, "floating", otherwise=False)
        return shaped_links(self._urdf_file.document.root, floats=floats)

    @property
    def integrators(self) -> dict[str, dict[str, object]]:
        """Another integrator; none with equalities, which only Euler resolves implicitly."""
        other = "Euler" if self.integrator == "rk4" else "RK4"
        return {} if equalities_act(self.model) else {other: {"integrator": other}}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield changes that MuJoCo and its formats make to the model."""
        with self._warnings.collecting():
            file = self._urdf_file
            q = self._states.qpos(z)
            yield from model_remarks(self.model, self._spec, file, self._sources, q, w)
        for warning in self._warnings:
            yield Remark(kind="warning", message=f"MuJoCo warns: {warning}", address="")

    @property
    def step_rule(self) -> StepRule | None:
        """The step rule of its integrator."""
        with self._warnings.collecting():
            return step_rule(self.model)

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return accelerations by `mj_forward`; under `smooth`, equalities hold exactly.

        None for a model with soft equalities, whose softness would affect them.
        """
        if equalities_act(self.model) and not self._equalities_hold:
            return None
        held = self._controls, self._activations
        with engine_errors(self._spec.path, "MuJoCo"), self._warnings.collecting():
            return forward(self.model, self._data, self._states, (z, w, force), held)

    def equality_errors(self, z: Array) -> Array | None:
        """Return the errors of equalities that `accelerations` holds exactly."""
        if not self._equalities_hold:
            return None
        with engine_errors(self._spec.path, "MuJoCo"), self._warnings.collecting():
            return equality_errors(self.model, self._data, self._states.qpos(z))

    @cached_property
    def _equalities_hold(self) -> bool:
        """True if equalities must hold exactly and all are linear in joint positions."""
        smooth = is_on(self._spec, "smooth", otherwise=False)
        return smooth and equalities_act(self.model) and holds_exactly(self.model)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of MuJoCo, since the file was loaded."""
        return tuple(self._warnings)

    @cached_property
    def _poses(self) -> PoseEvaluator:
        file, spec = self._urdf_file, self._spec
        if file is None:
            return PoseEvaluator(self.model, "body")
        whole = replace(spec, settings={**spec.settings, "smooth": False})
        named = name_collisions, without_visuals, with_forms((*FORMS, "mesh"))
        for edits in ([*changes(whole), *named], changes(spec)):
            # A shape may be wrong, and a free joint of a link whose parent stands still must fuse.
            with suppress(ValueError):
                return self._poses_of(file, edits)
        return PoseEvaluator(self.model, "link")

    def _poses_of(self, file: UrdfFile, edits: list[Change]) -> PoseEvaluator:
        import mujoco

        with (
            self._warnings.collecting(),
            temporary_urdf(file.document.root, self._spec.path, edits) as path,
        ):
            tree = mujoco.MjSpec.from_file(str(path))
            complete_urdf(tree, self._spec, file)  # a floating root has coordinates
            # By default MuJoCo fuses links on fixed joints, such as a tool's, with their parents.
            tree.compiler.fusestatic = False
            scales = without_mesh_files(tree)
            return PoseEvaluator(tree.compile(), "link", scales)

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies, their centres, and sites and geoms with a name."""
        return self._poses.places

    @property
    def inertias(self) -> Mapping[str, SpatialInertia]:
        """Mass and inertia of each body."""
        model = self.model
        return {
            model.body(i).name or f"body_{i}": SpatialInertia(
                float(model.body_mass[i]),
                np.array(model.body_ipos[i]),
                (turn := from_quaternion(model.body_iquat[i])) * model.body_inertia[i] @ turn.T,
            )
            for i in range(1, model.nbody)
        }

    @property
    def shapes(self) -> Mapping[str, tuple[float, ...]]:
        """Geoms and sites of an MJCF, or collision shapes of a URDF, with their sizes."""
        return self._poses.shapes

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by MuJoCo's forward kinematics, without a step."""
        return self._poses.evaluate(places, self._states.qpos(z))

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 4 for RK4 unless an input is held over the step, and 1 for the others.

        Exact filters whose states move under RK4 have order 1 as well (observed in 4.0.0).
        """
        import mujoco

        order = _ORDERS.get(f"mjINT_{self.integrator.upper()}", 1)
        exact = np.array(self.model.actuator_dyntype) == mujoco.mjtDyn.mjDYN_FILTEREXACT
        moves = "activations" in self._spec.settings and bool(exact.any())
        return (1 if varying_input or moves else order), 1

    @cached_property
    def _data(self) -> Any:
        import mujoco

        return mujoco.MjData(self.model)

    @cached_property
    def _rollout(self) -> Any:
        from mujoco import rollout

        return rollout.Rollout(nthread=0)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Run a batch in C (`mujoco.rollout`), with a fresh warm start for each state."""
        quiet = np.errstate(all="ignore")
        with engine_errors(self._spec.path, "MuJoCo"), self._warnings.collecting(), quiet:
            if isinstance(force, StateForce):
                return self._step_by_state(q, v, h, n, force, every)
            return self._step_all(q, v, h, n, force, every)

    def _step_all(
        self, q: Array, v: Array, h: float, n: int, force: Array | None, every: int
    ) -> tuple[Array, Array]:
        qpos, qvel = self._states.qpos(q), self._states.qvel(q, v)
        along = self._states_along(qpos, qvel, self._activations, h, n, force)
        out_q, out_v, _ = (one[:, every - 1 :: every] for one in along)
        return self._states.motion_of(out_q, out_v, qpos)

    def _states_along(
        self, qpos: Array, qvel: Array, act: Array, h: float, n: int, force: Array | None
    ) -> tuple[Array, Array, Array]:
        """Return qpos, qvel and states of actuators after each step of a batch, (B, n, ...)."""
        import mujoco

        self.model.opt.timestep = h
        # A rollout without controls keeps the forces that an earlier one left in its data.
        mujoco.mj_resetData(self.model, self._data)
        nq, nv, na = self.model.nq, self.model.nv, self.model.na
        # The full physics state is (time, qpos, qvel), activations, and further entries that stay
        # zero.
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        state = np.zeros((len(qpos), size))
        state[:, 1 : 1 + nq], state[:, 1 + nq : 1 + nq + nv] = qpos, qvel
        state[:, 1 + nq + nv : 1 + nq + nv + na] = act
        held = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
        if self._controls.any():
            held |= int(mujoco.mjtState.mjSTATE_CTRL)
            force = self._with_controls(force, (len(qpos), n))
        states, _ = self._rollout.rollout(
            self.model, self._data, state, force, nstep=n, control_spec=held
        )
        # A diverged run ends early and its last state fills the rest, so its clock stands still.
        states[states[:, :, 0] < h * (np.arange(n) + 0.5)] = np.nan
        q, v, a, _ = np.split(states, np.cumsum([1 + nq, nv, na]), axis=2)
        return q[:, :, 1:], v, a

    def _with_controls(self, force: Array | None, shape: tuple[int, int]) -> Array:
        """Return controls, followed by applied forces."""
        applied = np.zeros((*shape, self.model.nv)) if force is None else force
        same = np.broadcast_to(self._controls, (*shape, len(self._controls)))
        return np.concatenate([same, applied], axis=2)

    def _step_by_state(
        self, q: Array, v: Array, h: float, n: int, force: StateForce, every: int
    ) -> tuple[Array, Array]:
        import mujoco

        self.model.opt.timestep = h
        data = self._data
        qpos, qvel = self._states.qpos(q), self._states.qvel(q, v)
        out_q = np.empty((len(q), n // every, self.model.nq))
        out_v = np.empty((len(q), n // every, self.model.nv))
        for b in range(len(q)):
            mujoco.mj_resetData(self.model, data)
            data.qpos[:], data.qvel[:], data.ctrl[:] = qpos[b], qvel[b], self._controls
            data.act[:] = self._activations
            held = force.inputs[b].tolist()
            for i in range(n):
                data.qfrc_applied[:] = force.evaluate(
                    self._states.coordinates_of(data.qpos, q[b]), held[i]
                )
                mujoco.mj_step(self.model, data)
                if (i + 1) % every == 0:
                    out_q[b, i // every], out_v[b, i // every] = data.qpos, data.qvel
        return self._states.motion_of(out_q, out_v, qpos)


class ActuatedModel(MujocoModel):
    """A model whose actuators have states.

    Each is the velocity of a coordinate `NAME.act`, whose position is the integral over time.
    """

    def __init__(self, *compiled: Any) -> None:
        super().__init__(*compiled)
        self.coordinates = (*self.coordinates, *(f"{one}.act" for one in state_names(self.model)))

    @property
    def home(self) -> Array:
        """Positions in the drawn configuration, (nz,)."""
        return np.concatenate([super().home, np.zeros(self.model.na)])

    @property
    def sampling_range(self) -> Array:
        """Sampling range of positions, (nz, 2)."""
        return np.concatenate([super().sampling_range, np.tile([-1.0, 1.0], (self.model.na, 1))])

    @property
    def limits(self) -> Array:
        """Joint limits, (nz, 2)."""
        open_ends = np.tile([-np.inf, np.inf], (self.model.na, 1))
        return np.concatenate([super().limits, open_ends])

    @property
    def step_rule(self) -> StepRule | None:
        """None: rules have no states of actuators."""
        return None

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return None: those of the actuators' states do not exist."""
        return None

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield changes that MuJoCo and its formats make to the model."""
        return super().remarks(z[:, : self.model.nv], w[:, : self.model.nv])

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by MuJoCo's forward kinematics, without a step."""
        return super().poses(places, z[:, : self.model.nv])

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Run a batch in C; integrate the actuators' states by the trapezoidal rule.

        Raises:
            EngineError: for a force on such a state, or one that depends on the state.
        """
        nv, path = self.model.nv, self._spec.path
        if isinstance(force, StateForce) or (force is not None and force[..., nv:].any()):
            raise EngineError(
                f"{path}: inputs can't act on {', '.join(self.coordinates[nv:])}, nor depend on "
                "positions; state the actuators' inputs as [settings] controls"
            )
        applied = None if force is None else force[..., :nv]
        qpos, qvel = self._states.qpos(q[:, :nv]), self._states.qvel(q[:, :nv], v[:, :nv])
        quiet = np.errstate(all="ignore")
        with engine_errors(path, "MuJoCo"), self._warnings.collecting(), quiet:
            out_q, out_v, act = self._states_along(qpos, qvel, v[:, nv:], h, n, applied)
        before = np.concatenate([v[:, None, nv:], act[:, :-1]], axis=1)
        integral = q[:, None, nv:] + h / 2 * np.cumsum(before + act, axis=1)
        kept = slice(every - 1, None, every)
        moved = self._states.motion_of(out_q[:, kept], out_v[:, kept], qpos)
        z, w = (
            np.concatenate([one, more[:, kept]], axis=2)
            for one, more in zip(moved, (integral, act), strict=True)
        )
        return z, w
