"""What settings ask of MuJoCo: of a specification before it is compiled, and of a rollout."""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.pulls import actuators, control, held_state
from physics_crosscheck.harness.engines.mujoco.smooth import switch_off
from physics_crosscheck.harness.engines.protocol import Array, EngineError, ModelSpec


def is_on(spec: ModelSpec, key: str, *, otherwise: bool) -> bool:
    """A setting that switches something on or off.

    Raises:
        EngineError: where it is neither true nor false.
    """
    value = spec.settings.get(key, otherwise)
    if not isinstance(value, bool):
        told = f"[settings] {key} is {value!r}; expected true or false"
        raise EngineError(f"{spec.path}.toml: {told}")
    return value


def apply_settings(tree: Any, spec: ModelSpec) -> None:
    """Change a specification.

    Raises:
        EngineError: naming the setting that MuJoCo does not have.
    """
    settings = dict(spec.settings)
    actuated = is_on(spec, "actuators", otherwise=True)
    switch_off(tree, smooth=bool(settings.pop("smooth", False)), actuated=actuated)
    settings.pop("couplings", None)
    for key in (
        "controls",
        "activations",
        "floating",
        "held",
        "actuators",
        "exact_frames",
        "compensated",
    ):  # of a rollout; and done
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
    """Whether a body's inertial frame is taken for the body's own, though it is another.

    So it is where no position is 1e-6 m off and no component of the quaternion 1e-6 (`kFrameEps` in
    user_model.cc): `body_sameframe` says so, and kinematics then copies the body's frame.
    """
    import mujoco

    same = np.array(model.body_sameframe)
    whole = same == mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    turned = np.any(np.array(model.body_iquat)[:, 1:], axis=1)
    moved = np.any(model.body_ipos, axis=1)
    rotation = whole | (same == mujoco.mjtSameFrame.mjSAMEFRAME_BODYROT)
    return bool(np.any(rotation & turned) or np.any(whole & moved))


def held_controls(model: Any, spec: ModelSpec) -> tuple[Array, Array]:
    """At which all controls are held, and the states of actuators; zero unless the settings say.

    Of an actuator with a state they say that: an integrator stands without an input, a filter
    under an input that is as large. Where `activations` gives the states that runs start with,
    controls are controls, and states move.

    Raises:
        EngineError: where they are not as many numbers as there are controls, or states.
    """
    import mujoco

    count = int(getattr(model, "nctrl", model.nu))
    inputs, states = _listed(spec, "controls", count), np.zeros(model.na)
    if "activations" in spec.settings:
        return inputs, _listed(spec, "activations", int(model.na))
    for i in range(actuators(model)):
        if (state := held_state(model, i)) >= 0:
            at = control(model, i)
            states[state] = inputs[at]
            if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_INTEGRATOR:
                inputs[at] = 0.0
    return inputs, states


def _listed(spec: ModelSpec, key: str, count: int) -> Array:
    """Return the numbers that a setting lists, (count,); zeros where it is not there.

    Raises:
        EngineError: where it is anything else.
    """
    given = spec.settings.get(key, [0.0] * count)
    numbers = isinstance(given, list) and all(type(one) in (int, float) for one in given)
    if not numbers or len(given) != count:  # type: ignore[arg-type]  # a list
        raise EngineError(
            f"{spec.path}.toml: [settings] {key} is {given!r}; expected {count} number"
            + "s" * (count != 1)
        )
    return np.array(given, dtype=float)
