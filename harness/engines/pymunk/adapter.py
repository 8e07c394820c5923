"""pymunk (Munk2D), on a Python file that builds a Space; errors name the file's lines.

Effects that a Space adds to its bodies and joints.
"""

from __future__ import annotations

import hashlib
import math
import sys
import traceback
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from ..installed import version_of
from ..protocol import (
    Array,
    DefaultLeftOn,
    Engine,
    EngineError,
    Force,
    LoadedModel,
    ModelSpec,
    Sample,
    StateForce,
)
from ..remark import POSITION_FORCE_TERMS, Remark
from ..source import one_line, read_source
from .own_step import collect_callback_errors, has_own_step, step_whole
from .whole import PymunkWhole


def space_remarks(space: Any, settings: Mapping[str, object]) -> Iterator[Remark]:
    """Yield all remarks about a Space as its file builds it, under the adapter's settings."""
    yield from _overridden(space, settings)
    if has_own_step(space):
        yield Remark(
            message=(
                "the Space has its own step, callbacks or threads; crosscheck uses its own step"
            ),
            address="",
        )
    damping: Any = settings.get("damping", space.damping)
    if damping != 1:
        value = float(damping)
        yield Remark(
            message=(
                f"Space.damping is {value:g}: every velocity loses {1 - value:.3g} per second"
            ),
            subject=("Space.damping",),
            fault=True,
            address=_address("damping", settings),
            value=value,
        )
    given: Any = settings.get("gravity", space.gravity)
    gravity = (float(given[0]), float(given[1]))
    if gravity[0] and gravity[1]:
        yield Remark(
            message=f"gravity is tilted: {gravity} is not along an axis",
            address=_address("gravity", settings),
            shows_in=POSITION_FORCE_TERMS,
        )
    yield from _joint_remarks(space.constraints)
    yield from _spring_remarks(space.constraints)
    shapes = [s for s in space.shapes if not s.sensor and s.filter.mask != 0]
    if len(shapes) > 1:
        yield Remark(
            kind="contact",
            message=f"{len(shapes)} shapes can collide: their filters allow it",
            address="",
        )


def _overridden(space: Any, settings: Mapping[str, object]) -> Iterator[Remark]:
    """Yield values of the script that the sidecar's settings override, except pymunk's defaults."""
    for name, stated, plain, shows_in in (
        ("gravity", tuple(map(float, space.gravity)), (0.0, 0.0), POSITION_FORCE_TERMS),
        ("damping", float(space.damping), 1.0, ("damping",)),
    ):
        given: Any = settings.get(name, stated)
        counts = tuple(map(float, given[:2])) if name == "gravity" else float(given)
        if stated not in (plain, counts):
            yield Remark(
                kind="setting",
                message=f"the sidecar's {name}, {counts}, overrides the file's, {stated}",
                address=f"Space().{name}",
                related_address=f"sidecar:settings.{name}",
                shows_in=shows_in,
            )


def _address(name: str, settings: Mapping[str, object]) -> str:
    return f"sidecar:settings.{name}" if name in settings else f"Space().{name}"


def _joint_remarks(constraints: Iterable[Any]) -> Iterator[Remark]:
    import pymunk

    plain = pymunk.PivotJoint(pymunk.Body(1, 1), pymunk.Body(1, 1), (0, 0)).error_bias
    for constraint in constraints:
        kind = type(constraint).__name__
        if isinstance(constraint, (pymunk.DampedSpring, pymunk.DampedRotarySpring)):
            continue  # forces have no error to correct
        if constraint.error_bias == plain:
            yield Remark(
                kind="constraint",
                message=f"error_bias of a {kind} is pymunk's default, 0.9**60: at ordinary steps"
                " the joint takes energy out of the motion",
                address=f"{kind}()",
                value=float(plain),
            )
        if constraint.max_force < float("inf") or constraint.max_bias < float("inf"):
            yield Remark(
                kind="constraint",
                message=f"a {kind} has a largest force or correction: it yields beyond",
                address=f"{kind}()",
            )


def _spring_remarks(constraints: Iterable[Any]) -> Iterator[Remark]:
    import pymunk

    for spring in constraints:
        if isinstance(spring, pymunk.DampedSpring) and spring.stiffness:
            start = spring.a.local_to_world(spring.anchor_a)
            end = spring.b.local_to_world(spring.anchor_b)
            here, rest, what = (end - start).length, spring.rest_length, "length"
        elif isinstance(spring, pymunk.DampedRotarySpring) and spring.stiffness:
            here, rest, what = spring.a.angle - spring.b.angle, spring.rest_angle, "angle"
        else:
            continue
        kind = type(spring).__name__
        if abs(here - rest) > 1e-9 * max(1.0, abs(here)):
            yield Remark(
                message=f"a {kind} is built at the {what} {here:g} and rests at {rest:g}",
                address=f"{kind}()",
                value=float(rest),
                shows_in=POSITION_FORCE_TERMS,
            )


def run_file(path: Path) -> Any:
    """Run the file and return it as a module.

    Raises:
        EngineError: naming file and line.
    """
    text = read_source(path)
    digest = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
    name = f"_crosscheck_space_{digest}"
    module = types.ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    with script_errors(path, ""):
        # Compile from the text: a bytecode cache would miss a file that was rewritten within a
        # second.
        exec(compile(text, str(path), "exec"), module.__dict__)
    if not callable(getattr(module, "build", None)):
        raise EngineError(f"{path}: it must define build() -> (Space, {{name: Body}})")
    return module


@contextmanager
def script_errors(path: Path, what: str) -> Iterator[None]:
    """Convert any exception of a script into an error with its line.

    An exit, or an interruption that the script raises itself, must not end other work in this
    process.
    """
    try:
        yield
    except EngineError as error:
        raise error if str(path) in str(error) else EngineError(str(error), file=path) from None
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and not _raised_by(error, path):
            raise
        raise script_error(error, path, what) from None


def script_error(error: BaseException, path: Path, what: str) -> EngineError:
    """Return an error of a script, at its line."""
    message = one_line(error)
    kind = type(error).__name__
    sentence = f"{what} fails: {message or kind}" if what else f"{kind}: {message}".rstrip(": ")
    return EngineError(sentence, file=path, line=_line(error, path))


def _line(error: BaseException, path: Path) -> int:
    if isinstance(error, SyntaxError) and error.lineno:
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return lines[-1] or 1 if lines else 1


def _raised_by(error: BaseException, path: Path) -> bool:
    """Return whether the script itself raised the error, as opposed to Ctrl-C."""
    frames = traceback.extract_tb(error.__traceback__)
    last = frames[-1] if frames else None
    return last is not None and last.filename == str(path) and "raise" in (last.line or "")


_KINDS = ("x", "y", "angle")


_SAMPLE = """import pymunk

def build():
    space = pymunk.Space()
    ground = space.static_body
    body = pymunk.Body(2.0, 0.1)
    space.add(body, pymunk.DampedSpring(ground, body, (-3, 0), (0, 0), 3, 50, 1.5))
    space.add(pymunk.DampedRotarySpring(ground, body, 0, 4, 0.05))
    return space, {"body": body}
"""


class PymunkEngine(Engine):
    """Adapter of pymunk (Blomqvist), a Python library on Munk2D, formerly Chipmunk (Lembcke)."""

    name = "pymunk"
    title = "pymunk"
    formats = (".py",)
    capabilities = (
        "joints: planar bodies and constraints",
        "springs: DampedSpring, DampedRotarySpring",
        "mimic: constraints of the Space",
        "next state: no",
        "accelerations: no",
        "linearization: from steps",
        "steps: semi-implicit Euler, positions first, order 1",
        "whole step: contacts, limits, motors, joints",
    )
    usual_mistakes = (
        DefaultLeftOn(
            name="Space.damping left in", setting="damping", value=0.9, cause="Space.damping"
        ),
        DefaultLeftOn(
            name="slop of 0.1 m",
            setting="collision_slop",
            value=0.1,
            cause="Space.collision_slop",
            whole=True,
        ),
    )

    def version(self) -> str | None:
        """Return the version of the installed package, or None."""
        return version_of("pymunk", "pymunk")

    def load(self, spec: ModelSpec) -> PymunkModel:
        """Run the file, and call its `build`."""
        unknown = set(spec.settings) - {"step", "gravity", "damping", "collision_slop"}
        if unknown:
            raise EngineError(f"{spec.path}.toml: pymunk has no setting {', '.join(unknown)}")
        if "step" not in spec.settings:
            raise EngineError(
                f"{spec.path}.toml: [settings] must set step, because a Space has none"
            )
        gravity = spec.settings.get("gravity", [0, 0, 0])
        if gravity[2]:  # type: ignore[index]  # three numbers, checked by the sidecar
            raise EngineError(
                f"{spec.path}.toml: [settings] gravity is {gravity!r}; a Space is "
                "planar, so the third component must be 0"
            )
        damping = spec.settings.get("damping", 1)
        if isinstance(damping, bool) or not isinstance(damping, (int, float)) or not damping > 0:
            raise EngineError(
                f"{spec.path}.toml: [settings] damping is {damping!r}; set the "
                "share of velocity that a body keeps per second, 1 for no damping"
            )
        slop = spec.settings.get("collision_slop", 0)
        if isinstance(slop, bool) or not isinstance(slop, (int, float)) or not slop >= 0:
            raise EngineError(
                f"{spec.path}.toml: [settings] collision_slop is {slop!r}; set the overlap that"
                " is not corrected, in m"
            )
        return PymunkModel(spec)

    def load_planar(self, spec: ModelSpec, model: LoadedModel | None = None) -> PymunkWhole:
        """Load a file with its contacts, limits and motors."""
        loaded = model if isinstance(model, PymunkModel) else self.load(spec)
        with script_errors(spec.path, "build()"):
            return PymunkWhole(loaded)

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return a step."""
        return {"step": 0.002}

    def samples(self) -> tuple[Sample, ...]:
        """Return a body on springs."""
        return (Sample(file="sample.py", text=_SAMPLE, settings={"step": 0.004}),)


class PymunkModel(LoadedModel):
    """The bodies that `build` returns; coordinates are `name.x`, `name.y` and `name.angle`."""

    integrator = "semi-implicit euler, positions first"

    def __init__(self, spec: ModelSpec) -> None:
        from pymunk._chipmunk_cffi import lib

        self._lib: Any = lib
        self._spec, self.path = spec, str(spec.path)
        self.step = float(spec.settings["step"])  # type: ignore[arg-type]  # checked by the sidecar
        # Overrides the file's gravity, as [gx, gy, 0]; None keeps it.
        self._gravity: Any = spec.settings.get("gravity")
        # Overrides Space.damping, the share of its velocity that a body keeps in a second.
        self._damping: Any = spec.settings.get("damping")
        # Overrides Space.collision_slop.
        self._slop: Any = spec.settings.get("collision_slop")
        self._module = run_file(spec.path)
        self._build()
        # pymunk's own step checks masses and moments; the C call does not.
        with self._script_errors("the first step"):
            self._space.step(self.step)
        if not self._reusable:
            self._build()

    @property
    def home(self) -> Array:
        """Positions of the bodies as built, (nz,)."""
        return np.array(self._home)

    @property
    def sampling_range(self) -> Array:
        """Sampling range of positions, (nz, 2): 1 m and one turn around a body's built pose."""
        half = np.tile([1.0, 1.0, np.pi], len(self._bodies))
        return np.stack([self.home - half, self.home + half], axis=1)

    @property
    def places(self) -> tuple[str, ...]:
        """The bodies that the file names, and their centres of gravity."""
        return tuple(f"{kind}:{name}" for kind in ("body", "centre") for name in self._bodies)

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return the poses that the coordinates define."""
        origins, turns = np.zeros((len(z), len(places), 3)), np.zeros((len(z), len(places), 3, 3))
        for f, place in enumerate(places):
            kind, _, name = place.partition(":")
            x, y, angle = z[:, 3 * (i := list(self._bodies).index(name)) : 3 * i + 3].T
            c, s = np.cos(angle), np.sin(angle)
            turns[:, f, 0, 0], turns[:, f, 0, 1] = c, -s
            turns[:, f, 1, 0], turns[:, f, 1, 1], turns[:, f, 2, 2] = s, c, 1.0
            shift = self._bodies[name].center_of_gravity if kind == "centre" else (0.0, 0.0)
            origins[:, f, 0], origins[:, f, 1] = x, y
            origins[:, f] += turns[:, f] @ np.array([*shift, 0.0])
        return origins, turns

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1: a step moves positions with the old velocity, then updates the
        velocity.
        """
        return 1, 1

    @property
    def corrective_settings(self) -> dict[str, dict[str, object]]:
        """Effects of the Space besides its bodies and constraints, with corrections."""
        return {} if self._space.damping == 1 else {"Space.damping": {"damping": 1.0}}

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield effects that the Space adds as the file builds it, without a motion."""
        with script_errors(self._spec.path, "build()"):
            space, _ = self._module.build()
        return space_remarks(space, self._spec.settings)

    def rebuild(self) -> tuple[Any, Mapping[str, Any]]:
        """Build the Space again; return it and its named bodies."""
        self._build()
        return self._space, self._bodies

    def _build(self) -> None:
        import pymunk

        with script_errors(self._spec.path, "build()"):
            result = self._module.build()
        if not isinstance(result, tuple) or [*map(_kind, result)] != [pymunk.Space, dict]:
            raise EngineError(f"{self.path}: build() must return (Space, {{name: Body}})")
        space, bodies = result
        if not bodies or not all(isinstance(body, pymunk.Body) for body in bodies.values()):
            raise EngineError(f"{self.path}: build() must name at least one Body")
        for name, body in bodies.items():
            if body.space is not space:
                raise EngineError(f"{self.path}: body {name!r} is not in the Space: space.add(...)")
        if self._gravity is not None:
            space.gravity = tuple(self._gravity[:2])
        if self._damping is not None:
            space.damping = float(self._damping)
        if self._slop is not None:
            space.collision_slop = float(self._slop)
        self.gravity = tuple(map(float, space.gravity))
        self._space, self._bodies = space, bodies
        # C handles: calls on them take a third of the time of pymunk's own methods.
        self._handles = [body._body for body in bodies.values()]
        self._centers = [tuple(body.center_of_gravity) for body in bodies.values()]
        self.coordinates = tuple(f"{name}.{kind}" for name in bodies for kind in _KINDS)
        self._home = self._places()
        self._own_step = has_own_step(space)
        self._reusable = not self._own_step and _reusable(space, list(bodies.values()))
        self._joints = [
            (c._constraint, c.max_force) for c in space.constraints if type(c) in _caching()
        ]

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step the Space; forces act for one step, since pymunk clears them after each."""
        places: list[list[float]] = []
        rates: list[list[float]] = []
        with self._script_errors("a step"):
            for b, (start, rate) in enumerate(zip(q.tolist(), v.tolist(), strict=True)):
                self._clear_impulses(h)
                self._set(start, rate)
                self._run(h, self._pushes(force, b, n), every, places, rates)
                # A NaN may stay in the joints permanently.
                self._reusable &= math.isfinite(sum(places[-1]) + sum(rates[-1]))
        shape = (len(q), n // every, q.shape[1])
        return np.array(places).reshape(shape), np.array(rates).reshape(shape)

    @contextmanager
    def _script_errors(self, what: str) -> Iterator[None]:
        """Convert any exception in this block, also in callbacks, into an error that names the
        file.
        """
        if not self._own_step:
            with script_errors(self._spec.path, what):
                yield
            return
        with collect_callback_errors() as raised, script_errors(self._spec.path, what):
            yield
        if raised:
            raise script_error(raised[0], self._spec.path, "a callback")

    def _clear_impulses(self, h: float) -> None:
        """Clear the impulses that joints keep from step to step, as in a newly built Space.

        A step with zero maximum force leaves a joint's impulse at zero; the bodies' states are
        overwritten. If the Space may remember more, build it again, at 50 times the cost of a step.
        """
        if not self._reusable:
            self._build()
        lib = self._lib
        for joint, _ in self._joints:
            lib.cpConstraintSetMaxForce(joint, 0.0)
        if self._joints:
            lib.cpSpaceStep(self._space._space, h)
        for joint, allowed in self._joints:
            lib.cpConstraintSetMaxForce(joint, allowed)

    def _set(self, q: list[float], v: list[float]) -> None:
        lib = self._lib
        for i, body in enumerate(self._handles):
            lib.cpBodySetAngle(body, q[3 * i + 2])  # first: it turns about the center of mass
            lib.cpBodySetPosition(body, (q[3 * i], q[3 * i + 1]))
            x, y = self._arm(i)
            spin = v[3 * i + 2]
            lib.cpBodySetVelocity(body, (v[3 * i] - spin * y, v[3 * i + 1] + spin * x))
            lib.cpBodySetAngularVelocity(body, spin)

    def _arm(self, i: int) -> tuple[float, float]:
        """Return a body's center of mass from its origin, along the world's axes."""
        x, y = self._centers[i]
        if not x and not y:
            return 0.0, 0.0
        angle = self._lib.cpBodyGetAngle(self._handles[i])
        c, s = math.cos(angle), math.sin(angle)
        return c * x - s * y, s * x + c * y

    def _pushes(self, force: Force, b: int, n: int) -> Iterator[Sequence[float] | None]:
        """Yield the forces of each step of a row, by the state before it; None without any."""
        if force is None:
            yield from repeat(None, n)
        elif isinstance(force, StateForce):
            for inputs in force.inputs[b].tolist():
                yield force.evaluate(self._places(), inputs)
        else:
            yield from force[b].tolist()

    def _run(
        self,
        h: float,
        pushes: Iterable[Sequence[float] | None],
        every: int,
        places: list[list[float]],
        rates: list[list[float]],
    ) -> None:
        """Take a step under each of the forces, and record states after every `every` steps."""
        step, space, handles = self._lib.cpSpaceStep, self._space._space, self._handles
        set_force, set_torque = self._lib.cpBodySetForce, self._lib.cpBodySetTorque
        first_forces = [(body, 3 * j) for j, body in enumerate(handles)]
        for i, push in enumerate(pushes, start=1):
            if self._own_step:
                step_whole(self._space, handles, h, push)
            else:
                if push is not None:
                    for body, k in first_forces:
                        # Zero forces need no call: each step leaves zero.
                        if push[k] or push[k + 1]:
                            set_force(body, (push[k], push[k + 1]))
                        if push[k + 2]:
                            set_torque(body, push[k + 2])
                step(space, h)
            if i % every == 0:
                places.append(self._places())
                rates.append(self._rates())

    def _places(self) -> list[float]:
        position, angle = self._lib.cpBodyGetPosition, self._lib.cpBodyGetAngle
        values: list[float] = []
        for body in self._handles:
            place = position(body)
            values += (place.x, place.y, angle(body))
        return values

    def _rates(self) -> list[float]:
        velocity, spin = self._lib.cpBodyGetVelocity, self._lib.cpBodyGetAngularVelocity
        values: list[float] = []
        for i, body in enumerate(self._handles):
            rate, turning = velocity(body), spin(body)
            x, y = self._arm(i)
            values += (rate.x + turning * y, rate.y - turning * x, turning)
        return values


def _kind(result: object) -> type:
    """Return Space, dict, or the type of another result of `build`."""
    import pymunk

    return next((kind for kind in (pymunk.Space, dict) if isinstance(result, kind)), type(result))


def _caching() -> tuple[type, ...]:
    """Return constraints whose only memory is the impulse of the last step, used as a warm
    start.
    """
    from pymunk import constraints as c

    return (
        c.PinJoint,
        c.PivotJoint,
        c.GrooveJoint,
        c.SlideJoint,
        c.GearJoint,
        c.RotaryLimitJoint,
        c.SimpleMotor,
    )


def _reusable(space: Any, bodies: list[Any]) -> bool:
    """Return whether cached impulses and the named bodies' states are all that a Space remembers.

    A Space with the user's own functions (`has_own_step`) may remember anything.
    """
    import pymunk

    springs = (pymunk.DampedSpring, pymunk.DampedRotarySpring)
    still = pymunk.Body.STATIC
    return (
        all(body in bodies for body in space.bodies if body.body_type != still)
        and all(type(c) in (*springs, *_caching()) for c in space.constraints)
        # Shapes that can touch keep contacts.
        and all(shape.sensor or shape.filter.mask == 0 for shape in space.shapes)
    )
