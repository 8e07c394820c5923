"""Settings for MuJoCo: of a specification before it is compiled, and of a rollout."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.pulls import actuators, control, held_state
from physics_crosscheck.harness.engines.mujoco.smooth import switch_off
from physics_crosscheck.harness.engines.protocol import Array, EngineError, ModelSpec

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
