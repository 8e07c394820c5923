"""Features of MuJoCo beyond smooth dynamics: switched off under `smooth`, and counted."""

import re
import warnings
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from ..protocol import Array, EngineError, ModelSpec, held_joints
from .pulls import (
    acts,
    actuators,
    box_fluid,
    control,
    covered_actuator,
    covered_tendon,
    ellipsoids,
    equalities_act,
    held_state,
    joint_name,
    pulls_by_itself,
    spatial_tendon,
    straight_equalities,
    without_ellipsoids,
)
from .shapes import without_idle_files

_SOLREF, _SOLIMP = [1e-12, 0.5], [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Equalities as stiff as a step allows, which settle in one step; steps can be 1e-8 s or less."""

_INVERSE_WEIGHT_FACTOR = 1e-2
"""A factor of the inverse weights that scale the softness of equalities.

With it, limits of tendon equalities are known to 3e-12, without it to 2e-9. For two fingers with
seven times their mass in armature these are 3e-12 and 1e-9. The initial error of a soft equality is
gone after one step.
"""


def switch_off(tree: Any, *, smooth: bool, actuated: bool) -> None:
    """Disable the features that `smooth` and `actuators` of a sidecar exclude."""
    import mujoco

    names = ("CONTACT", "LIMIT", "FRICTIONLOSS", "CLAMPCTRL") if smooth else ()
    for name in (*names, *(() if actuated else ("ACTUATION",))):
        tree.option.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    if smooth:
        without_idle_files(tree)


def keep_equalities(m: Any, followers: Collection[str] | None) -> None:
    """Activate only those equalities whose followers are named; None activates all."""
    if followers is not None:
        held = {
            i
            for i, (follower, *_) in straight_equalities(m).items()
            if joint_name(m, follower) in followers
        }
        for i in set(range(m.neq)) - held:
            m.eq_active0[i] = 0


def remove_uncovered(m: Any) -> None:
    """Remove features without a formula here, and all saturation, from a compiled model.

    The remaining equalities settle in one step. Their solver iterates to the last digit, under
    Euler steps, since their limits are not known for the other integrators.
    """
    import mujoco

    m.eq_solref[:], m.eq_solimp[:] = _SOLREF, _SOLIMP
    if m.eq_active0.any():
        m.opt.tolerance, m.opt.iterations = 0.0, 100
        m.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Implicit dampers act after the solver, so they would break equalities.
        m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
        # Without this safeguard an equality as stiff as here would diverge at any step.
        m.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
        m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # 4.0.0 has a wrong sparse Hessian
        # The inverse weights scale the softness of an equality. They are much larger than a
        # tendon's effective inverse mass, and for a body at its own center they omit the
        # joint's armature.
        m.tendon_invweight0[:] *= _INVERSE_WEIGHT_FACTOR
        m.dof_invweight0[:] *= _INVERSE_WEIGHT_FACTOR
    limited = ("actuator_forcelimited", "actuator_actlimited", "jnt_actfrclimited")
    for name in (*limited, "tendon_actfrclimited"):
        getattr(m, name)[:] = 0
    without_ellipsoids(m)
    own_fields = ("damping", "dampingpoly", "armature")
    force = ("gainprm", "biasprm", "gaintype", "biastype", "dyntype")  # type 0 is constant
    _zero(m, "actuator", (*force, *own_fields), _uncovered_actuators(m))
    _zero(m, "tendon", ("armature",), _spatial_tendons_with_armature(m))
    _zero(m, "actuator", ("armature",), _actuators_with_armature(m))
    _zero(m, "tendon", ("stiffness", "stiffnesspoly", *own_fields), _uncovered_tendons(m))


def _zero(m: Any, prefix: str, names: tuple[str, ...], rows: Iterable[int]) -> None:
    """Set fields of some rows to zero, if this version has them."""
    wanted = list(rows)
    for name in names:
        if hasattr(m, f"{prefix}_{name}"):
            getattr(m, f"{prefix}_{name}")[wanted] = 0


def _uncovered_actuators(m: Any) -> list[int]:
    return [i for i in range(actuators(m)) if not covered_actuator(m, i)]


def _uncovered_tendons(m: Any) -> list[int]:
    return [i for i in range(m.ntendon) if pulls_by_itself(m, i) and not covered_tendon(m, i)]


def _spatial_tendons_with_armature(m: Any) -> list[int]:
    return [i for i in range(m.ntendon) if spatial_tendon(m, i) and m.tendon_armature[i]]


def _actuators_with_armature(m: Any) -> list[int]:
    import mujoco

    if not hasattr(m, "actuator_armature"):
        return []
    on = int(mujoco.mjtTrn.mjTRN_TENDON)
    return [
        i
        for i in range(actuators(m))
        if m.actuator_armature[i] and m.actuator_trntype[i] == on
        if spatial_tendon(m, int(m.actuator_trnid[i][0]))
    ]


def without_joints(tree: Any, spec: ModelSpec) -> ModelSpec:
    """Remove held joints from a specification, so that their bodies stay at the drawn positions.

    Unnamed joints have the adapter's names. Actuators, sensors and equalities of such a joint are
    removed with it, and so are all keyframes, which contain its position.

    Returns:
        The settings without the controls of these actuators.
    """
    joints, controls = held_joints(spec), spec.settings.get("controls")
    acting = [one.target not in joints for one in tree.actuators]
    if isinstance(controls, list) and len(controls) == len(acting):
        kept = [value for value, acts in zip(controls, acting, strict=True) if acts]
        spec = replace(spec, settings={**spec.settings, "controls": kept})
    users = (
        *((user, (user.target,)) for user in tree.actuators),
        *((user, (user.objname,)) for user in tree.sensors),
        *((user, (user.name1, user.name2)) for user in tree.equalities),
    )
    gone = [user for user, targets in users if set(targets) & set(joints)]
    gone += list(tree.keys) if joints else []
    rows = enumerate(tree.joints)
    gone += [joint for i, joint in rows if (joint.name or f"joint_{i}") in joints]
    for user in gone:
        tree.delete(user)
    return spec


_SMOOTH = _WRAPPED, _ARMATURES, _ELLIPSOIDS = (
    "tendons around shapes that pull",
    "armatures along tendons in space",
    "ellipsoids in a medium",
)
"""Smooth forces among the features that `besides` counts."""


def besides(m: Any) -> tuple[tuple[str, int], ...]:
    """Return the features of a compiled model that these settings leave out, with their counts."""
    held = int(np.count_nonzero(m.eq_active0)) if equalities_act(m) else 0
    touching = (np.array(m.geom_contype) | np.array(m.geom_conaffinity)) != 0
    counts: dict[str, Any] = {
        "actuators of other laws or transmissions": len(_uncovered_actuators(m)),
        "saturation of actuators": sum(map(bool, _saturation(m)))
        + np.count_nonzero(m.jnt_actfrclimited)
        + np.count_nonzero(m.tendon_actfrclimited),
        _WRAPPED: len(_uncovered_tendons(m)),
        _ARMATURES: len(_spatial_tendons_with_armature(m)) + len(_actuators_with_armature(m)),
        "equality constraints": held - len(straight_equalities(m)),
        "limits of position": np.count_nonzero(m.jnt_limited) + np.count_nonzero(m.tendon_limited),
        "dry friction": np.count_nonzero(m.dof_frictionloss)
        + np.count_nonzero(m.tendon_frictionloss),
        "contact geometry": np.count_nonzero(touching),
        _ELLIPSOIDS: np.count_nonzero(ellipsoids(m)) if box_fluid(m) else 0,
    }
    return tuple((what, int(count)) for what, count in counts.items() if count)


def _saturation(m: Any) -> Iterator[bool]:
    """Yield whether each actuator limits its control, its state or its force."""
    for i in range(actuators(m)):
        limited = m.actuator_ctrllimited[control(m, i)], m.actuator_actlimited[i]
        yield any((*limited, m.actuator_forcelimited[i]))


def smooth_omissions(m: Any) -> tuple[str, ...]:
    """Return the smooth forces of a compiled model that have no formula."""
    return (*uncovered(m), *(what for what, _ in besides(m) if what in _SMOOTH))


def uncovered(m: Any) -> tuple[str, ...]:
    """Return features that act under all settings and that no tree of bodies represents."""
    lifted = bool(np.any(m.body_gravcomp)) and bool(np.any(m.jnt_actgravcomp))
    features = {
        "flexible bodies": bool(getattr(m, "nflex", 0)),
        "plugins": m.nplugin > len({*map(int, m.sensor_plugin)} - {-1}),  # sensors exert no force
        # MuJoCo counts it among the forces of actuators, which this flag takes away.
        "gravity compensation by actuators that are off": lifted and not acts(m, "ACTUATION"),
    }
    return tuple(what for what, there in features.items() if there)


WITHOUT = "without_"
"""Begin of the settings that leave an attribute in `<mujoco>` of a URDF out, by its name."""


def is_on(spec: ModelSpec, key: str, *, otherwise: bool) -> bool:
    """Return a boolean setting.

    Raises:
        EngineError: if it is neither true nor false.
    """
    value = spec.settings.get(key, otherwise)
    if not isinstance(value, bool):
        problem = f"[settings] {key} is {value!r}; expected true or false"
        raise EngineError(f"{spec.path}.toml: {problem}")
    return value


def apply_settings(tree: Any, spec: ModelSpec) -> None:
    """Apply settings to a specification.

    Raises:
        EngineError: naming the setting that MuJoCo does not have.
    """
    settings = dict(spec.settings)
    actuated = is_on(spec, "actuators", otherwise=True)
    switch_off(tree, smooth=bool(settings.pop("smooth", False)), actuated=actuated)
    settings.pop("couplings", None)
    for key in (
        *(key for key in spec.settings if key.startswith(WITHOUT)),
        "controls",
        "activations",
        "floating",
        "shape_masses",
        "held",
        "actuators",
        "exact_frames",
        "compensated",
    ):  # settings of a rollout, or already applied
        settings.pop(key, None)
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


def rounded_frames(model: Any) -> bool:
    """Return whether MuJoCo treats a body's inertial frame as the body's own although it differs.

    It does so if position components differ by less than 1e-6 m and quaternion components by less
    than 1e-6 (`kFrameEps` in user_model.cc). Then `body_sameframe` is set, and kinematics copies
    the body's frame.
    """
    import mujoco

    same = np.array(model.body_sameframe)
    whole = same == mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    turned = np.any(np.array(model.body_iquat)[:, 1:], axis=1)
    moved = np.any(model.body_ipos, axis=1)
    rotation = whole | (same == mujoco.mjtSameFrame.mjSAMEFRAME_BODYROT)
    return bool(np.any(rotation & turned) or np.any(whole & moved))


def states_move(model: Any, spec: ModelSpec) -> bool:
    """Return whether the states of actuators are coordinates, which `smooth` excludes."""
    return bool(model.na) and not is_on(spec, "smooth", otherwise=False)


def state_names(model: Any) -> Iterator[str]:
    """Yield the actuator of each state."""
    for i in range(actuators(model)):
        name = model.actuator(i).name or f"actuator_{i}"
        count = int(model.actuator_actnum[i])
        yield from (name if count == 1 else f"{name}.{k}" for k in range(count))


def held_controls(model: Any, spec: ModelSpec) -> tuple[Array, Array]:
    """Return held controls and the states of actuators; zero unless the settings state them.

    For an actuator with a state, the control sets that state: an integrator is constant without an
    input, a filter is constant if its input equals its state. If `activations` gives the initial
    states, or they are coordinates, controls are inputs and states move.

    Raises:
        EngineError: if the numbers are not one per control, or per state.
    """
    import mujoco

    count = int(getattr(model, "nctrl", model.nu))
    inputs, states = _listed(spec, "controls", count), np.zeros(model.na)
    if states_move(model, spec):
        return inputs, states
    if "activations" in spec.settings:
        return inputs, _listed(spec, "activations", int(model.na))
    for i in range(actuators(model)):
        if (state := held_state(model, i)) >= 0:
            index = control(model, i)
            states[state] = inputs[index]
            if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_INTEGRATOR:
                inputs[index] = 0.0
    return inputs, states


def _listed(spec: ModelSpec, key: str, count: int) -> Array:
    """Return the numbers that a setting lists, (count,); zeros if it is not set.

    Raises:
        EngineError: for any other value.
    """
    given = spec.settings.get(key, [0.0] * count)
    numbers = isinstance(given, list) and all(type(one) in (int, float) for one in given)
    if not numbers or len(given) != count:  # type: ignore[arg-type]  # a list
        raise EngineError(
            f"{spec.path}.toml: [settings] {key} is {given!r}; expected {count} number"
            + "s" * (count != 1)
        )
    return np.array(given, dtype=float)


MAX_WARNINGS = 20
"""The most warnings that are kept; each kind counts once."""

_TIME = re.compile(r"\s*Time = \S+$")


class Warnings:
    """Warnings as sentences, each kind once, in the order of arrival."""

    def __init__(self) -> None:
        self._kinds: dict[str, str] = {}

    def __call__(self, message: str) -> None:
        """Add a warning of MuJoCo."""
        sentence = " ".join(message.split())
        if len(self._kinds) < MAX_WARNINGS:
            self._kinds.setdefault(_TIME.sub("", sentence), sentence)

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds.values())

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Collect all warnings that MuJoCo gives in this block, its own and Python's."""
        import mujoco

        mujoco.set_mju_user_warning(self)
        try:
            # While it reads a file, MuJoCo uses Python's warnings, which a user may have made
            # errors.
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                yield
        finally:
            mujoco.set_mju_user_warning(None)
            for warning in caught:
                self(str(warning.message))
