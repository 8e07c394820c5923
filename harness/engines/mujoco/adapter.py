"""MuJoCo, on MJCF and on URDF."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from harness.engines.compiled import CompiledTree
from harness.engines.mistake import LeftOut
from harness.engines.mujoco.mjcf import checked_numbers, checked_step, refusal, sources
from harness.engines.mujoco.poses import Poses
from harness.engines.mujoco.remarks import model_remarks
from harness.engines.mujoco.smooth import switch_off
from harness.engines.mujoco.tree import compiled_tree
from harness.engines.mujoco.warnings import Warnings
from harness.engines.protocol import (
    Array,
    Engine,
    EngineError,
    Force,
    Model,
    ModelSpec,
    Sample,
    StateForce,
    within,
)
from harness.engines.remark import Remark
from harness.engines.source import XmlSource, engine_errors
from harness.engines.urdf import IDLE, SETTINGS, joint_springs, read_urdf, sample_urdf
from harness.engines.urdf_copy import Change, rewritten, without_mimics, without_shapes

_ORDERS = {"mjINT_EULER": 1, "mjINT_IMPLICIT": 1, "mjINT_IMPLICITFAST": 1, "mjINT_RK4": 4}


_SOFT = "soft equality (solref, solimp)"
_OWN: Mapping[str, object] = {"solref": [0.02, 1.0], "solimp": [0.9, 0.95, 0.001, 0.5, 2.0]}
_STIFF: Mapping[str, object] = {"solref": [1e-6, 0.5], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2]}
"""Equalities as soft as MuJoCo makes them, and as stiff as a step allows, settled after one."""

_SAMPLE = """<mujoco><option timestep="0.004" integrator="{}" jacobian="dense"/>
<compiler angle="radian"/><worldbody>
<body><joint name="q1" type="slide" axis="1 0 0" stiffness="50" damping="1.5"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
<body><joint name="q2" type="hinge" axis="0 -1 0" damping="0.1"/>
<inertial pos="0 0 -0.5" mass="0.7" diaginertia="0.01 0.01 0.01"/></body>
</worldbody><tendon><fixed stiffness="30" damping="0.4" springlength="0">
<joint joint="q1" coef="-1"/><joint joint="q2" coef="1"/></fixed></tendon></mujoco>
"""


class MujocoEngine(Engine):
    """Adapter of MuJoCo (Todorov, Erez and Tassa 2012)."""

    name = "mujoco"
    title = "MuJoCo"
    formats = (".xml", ".urdf")
    capabilities = (
        "MJCF and URDF", "slides and hinges", "joint springs and dampers",
        "springs on joint combinations", "armature", "joint equalities (soft), URDF mimic",
        "batched rollouts in C",
    )  # fmt: skip
    unstated = "2 ms and -9.81"
    takes_springs = (".urdf",)
    stated_settings = MappingProxyType({"integrator": "Euler"})
    idle = MappingProxyType(
        {
            **IDLE,
            r"mujoco/(visual|asset|statistic)/.*|.*/(light|camera)@.*|.*@rgba": "looks",
            r".*/site@(size|fromto)|.*/(spatial|default)@(width|rgba)|.*/replicate@.*": "looks",
            r".*/(geom|pair|exclude)@.*": "shapes that touch nothing",
            r".*/(joint|spatial|fixed)@range": "limits",
            r".*/option@(timestep|.*iterations|.*tolerance|impratio|o_.*)": "step and solver",
        }
    )
    choices = (
        r".*@(contype|conaffinity|condim|group|priority|.*iterations|count)"
        r"|.*/(texture|global|quality|hfield)@\w+"
    )
    compiles = (".xml",)
    usual_mistakes = (
        LeftOut(
            name="soft equality, solref left out", within="equality", defaults=_OWN, cause=_SOFT
        ),
    )

    def version(self) -> str | None:
        """Version of the installed package, or None."""
        if importlib.util.find_spec("mujoco") is None:
            return None
        return importlib.metadata.version("mujoco")

    def load(self, spec: ModelSpec) -> MujocoModel:
        """Load an MJCF or URDF file."""
        import mujoco

        robot = read_urdf(spec.path) if spec.path.suffix == ".urdf" else None
        found, warnings = sources(spec.path), Warnings()
        try:
            with warnings.heard(), rewritten(robot, spec.path, _changes(spec)) as path:
                tree = mujoco.MjSpec.from_file(str(path))
                if robot is not None:
                    _complete_urdf(tree, spec, robot)
                _apply_settings(tree, spec)
                model = tree.compile()
        except EngineError:
            raise
        except Exception as error:
            raise refusal(error, spec.path, found) from None
        checked_step(model.opt.timestep, found, spec, mujoco.mjMINVAL)
        checked_numbers(_not_finite(model), found, spec.path)
        for joint in range(model.njnt):
            kind = mujoco.mjtJoint(model.jnt_type[joint])
            if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
                raise EngineError(
                    f"{spec.path}: joint {model.joint(joint).name!r} is a"
                    f" {kind.name[6:].lower()} joint; only slides and hinges are supported so far"
                )
        if not model.njnt:
            raise EngineError(f"{spec.path}: it has no moving joint")
        if (model.nu or model.na) and not _is_on(spec, "smooth", otherwise=False):
            raise EngineError(f"{spec.path}: it has actuators; inputs are applied to joints here")
        # A run that blows up must stay blown up: the automatic reset would return zeros, and every
        # rung would agree with itself.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        return MujocoModel(model, spec, found, warnings)

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Of a URDF, step and gravity; MuJoCo's own are the same."""
        return SETTINGS if suffix == ".urdf" else {}

    def compiled(self, path: Path) -> CompiledTree:
        """An MJCF as MuJoCo compiles it."""
        return compiled_tree(path)

    def samples(self) -> tuple[Sample, ...]:
        """Every order and treatment of damping, in MJCF; the first in a URDF too."""
        names = ("Euler", "implicit", "implicitfast", "RK4")
        mjcf = (Sample(file=f"{name}.xml", text=_SAMPLE.format(name)) for name in names)
        return (*mjcf, sample_urdf())


def _not_finite(model: Any) -> dict[str, object]:
    """Fields of a compiled model that are not finite; ranges may well be."""
    parts = ((model, _reals("model")), (model.opt, _reals("options")))
    fields = {name: getattr(part, name) for part, names in parts for name in names}
    return {name: value for name, value in fields.items() if not np.isfinite(value).all()}


@cache
def _reals(of: str) -> tuple[str, ...]:
    """Which attributes of a model, or of its options, are arrays of real numbers."""
    import mujoco

    empty = mujoco.MjSpec().compile()
    part = empty if of == "model" else empty.opt
    return tuple(
        name
        for name in dir(part)
        if name[0] != "_" and "range" not in name
        if isinstance(value := getattr(part, name), np.ndarray) and value.dtype.kind == "f"
    )


def _complete_urdf(tree: Any, spec: ModelSpec, robot: ET.Element) -> None:
    """Add what a URDF cannot say to MuJoCo: Gazebo's joint springs, and the sidecar's springs."""
    for joint, (stiffness, rest) in joint_springs(robot, spec.path).items():
        element = tree.joint(joint)
        if element is None:
            raise EngineError(f"{spec.path}: <gazebo reference={joint!r}> names no moving joint")
        element.stiffness = _spring_terms(stiffness)
        element.springref = rest
    for index, spring in enumerate(spec.springs):
        tendon = tree.add_tendon(name=f"crosscheck_spring_{index}")
        for joint, coefficient in spring.joints.items():
            tendon.wrap_joint(joint, coefficient)
        tendon.stiffness = _spring_terms(spring.stiffness)
        tendon.damping = _spring_terms(spring.damping)
        tendon.springlength = [spring.rest, spring.rest]


def _spring_terms(value: float) -> Any:
    """MuJoCo 4 takes a polynomial for stiffness and damping, 3 a number."""
    import mujoco

    if int(mujoco.__version__.split(".")[0]) >= 4:
        return [value, 0.0, 0.0]
    return value


def _changes(spec: ModelSpec) -> list[Change]:
    """What settings change in a URDF before it is loaded."""
    found: list[Change] = [without_shapes] if _is_on(spec, "smooth", otherwise=False) else []
    return found if _is_on(spec, "couplings", otherwise=True) else [*found, without_mimics]


def _is_on(spec: ModelSpec, key: str, *, otherwise: bool) -> bool:
    """A setting that switches something on or off.

    Raises:
        EngineError: where it is neither true nor false.
    """
    value = spec.settings.get(key, otherwise)
    if not isinstance(value, bool):
        told = f"[settings] {key} is {value!r}, where true or false belongs"
        raise EngineError(f"{spec.path}.toml: {told}")
    return value


def _apply_settings(tree: Any, spec: ModelSpec) -> None:
    settings = dict(spec.settings)
    smooth, coupled = settings.pop("smooth", False), settings.pop("couplings", True)
    switch_off(tree, smooth=bool(smooth), coupled=bool(coupled))
    if "step" in settings:
        tree.option.timestep = settings.pop("step")
    if "gravity" in settings:
        tree.option.gravity = settings.pop("gravity")
    if "integrator" in settings:
        import mujoco

        name = f"mjINT_{str(settings.pop('integrator')).upper()}"
        if not hasattr(mujoco.mjtIntegrator, name):
            raise EngineError(f"{spec.path}.toml: MuJoCo has no integrator {name[6:].lower()!r}")
        tree.option.integrator = getattr(mujoco.mjtIntegrator, name)
    for key in ("solref", "solimp"):
        if key in settings:
            value = settings.pop(key)
            for equality in tree.equalities:
                setattr(equality, key, value)
    if settings:
        names = ", ".join(sorted(settings))
        raise EngineError(f"{spec.path}.toml: MuJoCo has no setting {names}")


class MujocoModel(Model):
    """A compiled model of slides and hinges, whose state is (qpos, qvel)."""

    def __init__(
        self, model: Any, spec: ModelSpec, found: tuple[XmlSource, ...], warnings: Warnings
    ) -> None:
        import mujoco

        self.model, self._spec, self._sources, self._warnings = model, spec, found, warnings
        # In the order of qpos.
        self.coordinates = tuple(model.joint(i).name or f"joint_{i}" for i in range(model.njnt))
        # The step is read now: every rollout sets another.
        self.step = float(model.opt.timestep)
        name: str = mujoco.mjtIntegrator(model.opt.integrator).name
        self.integrator = name.removeprefix("mjINT_").lower()
        self.gravity = tuple(float(component) for component in model.opt.gravity)

    @property
    def home(self) -> Array:
        """Positions as the file draws the mechanism, (nz,)."""
        return np.array(self.model.qpos0, dtype=float)

    @property
    def reach(self) -> Array:
        """Where positions may be drawn, (nz, 2): limits, a turn of a hinge, 1 m of a slide."""
        import mujoco

        hinge = np.array(self.model.jnt_type) == mujoco.mjtJoint.mjJNT_HINGE
        half = np.where(hinge, np.pi, 1.0)
        free = np.stack([self.home - half, self.home + half], axis=1)
        limited = np.array(self.model.jnt_limited, dtype=bool)
        return within(free, np.where(limited[:, None], self.model.jnt_range, free))

    @property
    def limits(self) -> Array:
        """Of limited joints, less the margin at which their stops begin to act, (nz, 2)."""
        limited = np.array(self.model.jnt_limited, dtype=bool)[:, None]
        margin = np.array(self.model.jnt_margin)[:, None] * [1.0, -1.0]
        return np.where(limited, self.model.jnt_range + margin, [-np.inf, np.inf])

    @property
    def remedies(self) -> dict[str, Mapping[str, object]]:
        """What stiffens equalities."""
        return {_SOFT: dict(_STIFF)} if self.model.neq else {}

    @property
    def integrators(self) -> dict[str, dict[str, object]]:
        """Not with equalities: their limits are resolved with Euler alone."""
        other = "Euler" if self.integrator == "rk4" else "RK4"
        return {} if self.model.neq else {other: {"integrator": other}}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What MuJoCo and its formats add or drop."""
        with self._warnings.heard():
            yield from model_remarks(self.model, self._spec, self._sources, z, w)
        for warning in self._warnings:
            yield Remark(message=f"MuJoCo warns: {warning}", address="")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What MuJoCo has warned of, on loading and since."""
        return tuple(self._warnings)

    @cached_property
    def _poses(self) -> Poses:
        import mujoco

        if self._spec.path.suffix != ".urdf":
            return Poses(self.model, "body")
        # By default links on fixed joints, such as a tool's, become part of what they are fixed to.
        with self._warnings.heard():
            tree = mujoco.MjSpec.from_file(str(self._spec.path))
            tree.compiler.fusestatic = False
            return Poses(tree.compile(), "link")

    @property
    def places(self) -> tuple[str, ...]:
        """Bodies, their centres, sites and geoms that have a name."""
        return self._poses.places

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """By its forward kinematics, without a step."""
        return self._poses.at(places, z)

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """RK4 keeps order 4 until an input is held over the step; the others have order 1."""
        order = _ORDERS.get(f"mjINT_{self.integrator.upper()}", 1)
        return (1 if varying_input else order), 1

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
        """Batched in C (`mujoco.rollout`), each state with a fresh warm start."""
        quiet = np.errstate(all="ignore")
        with engine_errors(self._spec.path, "MuJoCo"), self._warnings.heard(), quiet:
            if isinstance(force, StateForce):
                return self._step_by_state(q, v, h, n, force, every)
            return self._step_all(q, v, h, n, force, every)

    def _step_all(
        self, q: Array, v: Array, h: float, n: int, force: Array | None, every: int
    ) -> tuple[Array, Array]:
        import mujoco

        self.model.opt.timestep = h
        # A rollout without controls keeps the forces that an earlier one left in its data.
        mujoco.mj_resetData(self.model, self._data)
        batch, size = q.shape
        # The full physics state is (time, qpos, qvel) for slides and hinges without activations.
        state = np.zeros((batch, 1 + 2 * size))
        state[:, 1 : 1 + size], state[:, 1 + size :] = q, v
        states, _ = self._rollout.rollout(
            self.model,
            self._data,
            state,
            force,
            nstep=n,
            control_spec=int(mujoco.mjtState.mjSTATE_QFRC_APPLIED),
        )
        # A run that blows up ends early, and its last state fills the rest: its clock stands still.
        states[states[:, :, 0] < h * (np.arange(n) + 0.5)] = np.nan
        kept = states[:, every - 1 :: every]
        return kept[:, :, 1 : 1 + size].copy(), kept[:, :, 1 + size :].copy()

    def _step_by_state(
        self, q: Array, v: Array, h: float, n: int, force: StateForce, every: int
    ) -> tuple[Array, Array]:
        import mujoco

        self.model.opt.timestep = h
        data = self._data
        out_q = np.empty((len(q), n // every, q.shape[1]))
        out_v = np.empty_like(out_q)
        for b in range(len(q)):
            mujoco.mj_resetData(self.model, data)
            data.qpos[:], data.qvel[:] = q[b], v[b]
            held = force.inputs[b].tolist()
            for i in range(n):
                data.qfrc_applied[:] = force.at(data.qpos.tolist(), held[i])
                mujoco.mj_step(self.model, data)
                if (i + 1) % every == 0:
                    out_q[b, i // every], out_v[b, i // every] = data.qpos, data.qvel
        return out_q, out_v
