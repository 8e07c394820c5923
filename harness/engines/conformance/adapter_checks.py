"""Checks of an adapter: descriptions, rollouts, forces held over a step, and small steps."""

import re
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..protocol import Engine, EngineError, ModelSpec, StateForce
from ..remark import Remark
from .subject import (
    BATCH,
    EVERY,
    STEPS,
    ConformanceError,
    ConformanceSubject,
    Loaded,
    Motion,
    alike,
    ask,
)

ORDER_STEPS = (16, 32, 64, 128)
"""Step counts of a short motion from which its order is observed."""

ORDER_SPAN = 12.0
"""Length of that motion, in the file's own time steps."""


def a_force_acts_in_its_own_step(subject: ConformanceSubject) -> None:
    """Require that a force acts in its own step only, and at once in the velocity."""
    loaded = subject.load()
    free = loaded.free(STEPS, 1)
    driven = False
    for coordinate in range(loaded.size):
        force = np.zeros((BATCH, STEPS, loaded.size))
        force[:, 5, coordinate] = 0.01
        z, w = loaded.run(loaded.states(), STEPS, force, 1)
        before = (z[:, :5], w[:, :5]), (free[0][:, :5], free[1][:, :5])
        ask(alike(*before), "a force acts before the step that it is given for")
        moved = (w - free[1])[:, 5:, coordinate]
        name = loaded.model.coordinates[coordinate]
        if not np.any(moved):
            continue  # a body too heavy to turn
        driven = True
        ask(bool(np.all(moved[:, 0] > 0)), f"a force on {name} doesn't act in its own step")
        kept = np.abs(moved[:, 1]) < 1.5 * np.abs(moved[:, 0])
        ask(bool(np.all(kept)), f"a force on {name} acts again in the step after its own")
    ask(driven, "no force moves it")


def impulses_are_in_proportion(subject: ConformanceSubject) -> None:
    """Require that twice the force over a step changes the velocity by twice as much."""
    loaded = subject.load()
    force = loaded.pushes(1)
    still, once, twice = (
        loaded.run(loaded.states(), 1, share * force, 1)[1] for share in (0.0, 1.0, 2.0)
    )
    change, error = once - still, np.abs(twice - still - 2 * (once - still))
    rounding = 1e3 * loaded.model.epsilon * (np.abs(still).max() + np.abs(change).max())
    allowed = 1e-3 * np.abs(change).max() + rounding
    ask(bool(np.all(error <= allowed)), "twice the force doesn't change velocities twice as much")


def a_force_by_state_is_the_same_force(subject: ConformanceSubject) -> None:
    """Require that a `StateForce` that copies its inputs gives the same motion as an array."""
    loaded = subject.load()
    given = StateForce(loaded.pushes(STEPS), lambda _, u: tuple(u))
    motion = loaded.run(loaded.states(), STEPS, given, EVERY)
    error = max(
        float(np.max(np.abs(a - b)))
        for a, b in zip(motion, loaded.pushed(every=EVERY), strict=True)
    )
    allowed = 1e3 * loaded.model.epsilon * max(1.0, *(float(np.abs(a).max()) for a in motion))
    ask(error <= allowed, f"the same forces, given as a map, change the motion by {error:.1e}")


def a_force_by_state_sees_the_start_of_its_step(subject: ConformanceSubject) -> None:
    """Require one call of a `StateForce` map per step, with the positions at its start."""
    loaded = subject.load()
    q, v = (values[:1] for values in loaded.states())
    seen: list[list[float]] = []

    def record(z: Sequence[float], _: Sequence[float]) -> list[float]:
        seen.append([float(x) for x in z])
        return [0.0] * loaded.size

    given = StateForce(np.zeros((1, STEPS, 1)), record)
    z, _ = loaded.run((q, v), STEPS, given, 1)
    ask(len(seen) == STEPS, f"its map was called {len(seen)} times in {STEPS} steps")
    passed = np.concatenate([q, z[0, :-1]])
    error = float(np.max(np.abs(np.array(seen) - passed)))
    allowed = 10 * loaded.model.epsilon * max(1.0, float(np.abs(passed).max()))
    ask(
        error <= allowed,
        f"its map gets states that differ by {error:.1e} from those at the start of a step",
    )


def orders_are_as_claimed(subject: ConformanceSubject) -> None:
    """Require the order that `exponents` claims, without force and with a varying input."""
    loaded = subject.load()
    for varying in (False, True):
        claimed = loaded.model.exponents(varying)[0]
        observed = _order(loaded, varying)
        if observed is not None:
            kind = "under an input that varies" if varying else "of a free motion"
            ask(
                abs(observed - claimed) < 0.35, f"the order {kind} is {observed:.2f}, not {claimed}"
            )


def accelerations_are_those_of_small_steps(subject: ConformanceSubject) -> None:
    """Require that `accelerations` equals the change of velocity over a small step, under a
    force.
    """
    loaded = subject.load()
    model, v = loaded.model, loaded.states()[1]
    # At home the rates of rotation coordinates are angular velocities.
    q, force = np.tile(model.home, (BATCH, 1)), loaded.pushes(1)
    stated = model.accelerations(q, v, force[:, 0])
    if stated is None:
        return
    ask(stated.shape == v.shape, f"accelerations have shape {stated.shape}; expected {v.shape}")
    h = loaded.h / 8
    coarse, fine = ((loaded.run((q, v), 1, force, 1, one)[1][:, 0] - v) / one for one in (h, h / 2))
    finite = np.isfinite(stated).all(axis=1)
    error = np.abs(stated - (2 * fine - coarse))[finite].max(initial=0.0)
    rounding = 1e3 * model.epsilon * (np.abs(v).max() / h + np.abs(coarse).max())
    allowed = np.abs(fine - coarse).max() + rounding
    ask(
        error <= allowed,
        f"its accelerations differ by {error:.1e} from the change of its velocities",
    )


def _order(loaded: Loaded, varying: bool) -> float | None:
    """Return the order observed from the last three step counts; None if only rounding is
    visible.
    """
    span = ORDER_SPAN * loaded.h
    ends = []
    for n in ORDER_STEPS:
        t = np.arange(n) / n
        force = 2.0 * np.cos(3 * t)[None, :, None] * np.ones((BATCH, 1, loaded.size))
        given = force if varying else None
        z, w = loaded.run(loaded.states(), n, given, n, span / n)
        ends.append(np.concatenate([z, w], axis=2)[:, 0])
    steps = np.abs(np.diff(ends, axis=0))
    scale = np.abs(ends[-1]).max()
    # The component whose error is largest above rounding.
    rounding = 30 * loaded.model.epsilon * scale * np.sqrt(ORDER_STEPS[-1]) / span
    seen = steps[1:].min(axis=0)
    best = np.unravel_index(np.argmax(seen), seen.shape)
    if seen[best] < 30 * rounding:
        return None
    return float(np.log2(steps[1][best] / steps[2][best]))


def engine_is_described(subject: ConformanceSubject) -> None:
    """Require a name, title, formats, capabilities and version that describe the adapter."""
    engine = subject.engine
    named = all(isinstance(word, str) and word for word in (engine.name, engine.title))
    ask(named, "name and title must be words")
    ask(re.fullmatch(r"[\w-]+", engine.name) is not None, f"the name {engine.name!r} is not a word")
    good = all(re.fullmatch(r"\.\w+", suffix) for suffix in engine.formats)
    ask(bool(engine.formats) and good, 'formats must list file suffixes, such as (".urdf",)')
    ask(all(isinstance(word, str) for word in engine.capabilities), "capabilities are phrases")
    version = engine.version()
    ask(version is None or isinstance(version, str), "version() must be text, or None")
    for extra in (*engine.preferred, *engine.compiles, *engine.takes_springs):
        ask(extra in engine.formats, f"{extra} is not among its formats {engine.formats}")


def model_is_described(subject: ConformanceSubject) -> None:
    """Require unique coordinate names, a step, integrator, exponents and epsilon."""
    model = subject.load().model
    names = model.coordinates
    good = isinstance(names, tuple) and all(isinstance(name, str) and name for name in names)
    ask(good and bool(names), "coordinates must be a tuple of names, at least one")
    ask(len(set(names)) == len(names), f"coordinate names must be unique: {names}")
    ask(0 < model.step < np.inf, f"the step is {model.step!r}; expected seconds")
    named = isinstance(model.integrator, str) and bool(model.integrator)
    ask(named, f"the integrator's name is {model.integrator!r}")
    for varying in (False, True):
        order, increment = model.exponents(varying)
        whole = isinstance(order, int) and isinstance(increment, int)
        ask(whole and order > 0 and increment > 0, "exponents() must give two whole numbers")
    ask(0 < model.epsilon < 1e-2, f"epsilon is {model.epsilon!r}; expected the relative rounding")


def hooks_have_their_shapes(subject: ConformanceSubject) -> None:
    """Require that each property of a model, and its remarks, follow the protocol."""
    model = subject.load().model
    size = len(model.coordinates)
    good = model.home.shape == (size,) and bool(np.isfinite(model.home).all())
    ask(good, f"home must be finite, of shape ({size},)")
    sampling_range = model.sampling_range
    good = sampling_range.shape == (size, 2) and bool(
        np.all(sampling_range[:, 0] < sampling_range[:, 1])
    )
    ask(
        good and bool(np.isfinite(sampling_range).all()),
        f"sampling_range must be lower < upper, ({size}, 2)",
    )
    limits = model.limits
    good = limits.shape == (size, 2) and bool(np.all(limits[:, 0] <= limits[:, 1]))
    ask(good, f"limits must be lower <= upper, ({size}, 2)")
    gravity = model.gravity
    good = isinstance(gravity, tuple) and len(gravity) in (0, 2, 3)
    ask(good and bool(np.isfinite(gravity).all()), "gravity must be a tuple of 0, 2 or 3 numbers")
    for hook, given in (
        ("corrective_settings", model.corrective_settings),
        ("integrators", model.integrators),
    ):
        for key, settings in given.items():
            ask(isinstance(key, str) and bool(dict(settings)), f"{hook} must map names to settings")
    warnings = model.warnings
    good = isinstance(warnings, tuple) and all(isinstance(word, str) for word in warnings)
    ask(good, "warnings must be a tuple of sentences")
    z = model.home[None]
    for remark in model.remarks(z, 0 * z):
        ask(isinstance(remark, Remark), f"remarks() must give Remarks, not {remark!r}")


def the_step_stays_the_shipped_one(subject: ConformanceSubject) -> None:
    """Require that `step` stays the file's own, whatever step a rollout uses."""
    loaded = subject.load()
    loaded.free(h=loaded.h / 3)
    step = loaded.model.step
    ask(step == loaded.h, f"a rollout changed step from {loaded.h:g} s to {step:g} s")


def errors_name_the_file(subject: ConformanceSubject) -> None:
    """Require an EngineError that names the file, for a missing or invalid file."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        path = Path(folder) / f"broken{subject.spec.path.suffix}"
        for text in (None, "<no model"):
            if text is not None:
                path.write_text(text, encoding="utf-8")
            what = "missing file" if text is None else "file that makes no model"
            _refused(subject.engine, replace(subject.spec, path=path), path.name, what)


def an_unknown_setting_is_refused(subject: ConformanceSubject) -> None:
    """Require an EngineError that names the setting, for an unknown setting."""
    settings = {**subject.spec.settings, "no_such_setting": 1}
    spec = replace(subject.spec, settings=settings)
    _refused(subject.engine, spec, "no_such_setting", "setting that it doesn't know")


def _refused(engine: Engine, spec: ModelSpec, name: str, what: str) -> None:
    try:
        engine.load(spec)
    except EngineError as error:
        ask(name in str(error), f"the error for a {what} doesn't name {name}: {error}")
    except Exception as error:
        raise ConformanceError(
            f"a {what} ends in {type(error).__name__}, not in an EngineError"
        ) from None
    else:
        raise ConformanceError(f"a {what} raises no error")


def rollouts_have_their_shape(subject: ConformanceSubject) -> None:
    """Require positions and velocities of shape (B, n // every, nz), in double precision."""
    loaded = subject.load()
    for n, every in ((STEPS, EVERY), (STEPS, STEPS), (STEPS, 1), (1, 1)):
        for values in loaded.free(n, every):
            wanted = BATCH, n // every, loaded.size
            ask(values.shape == wanted, f"a rollout has shape {values.shape}; expected {wanted}")
            ask(values.dtype == np.float64, f"its numbers are {values.dtype}, not float64")


def every_gives_the_ends_of_shorter_rollouts(subject: ConformanceSubject) -> None:
    """Require that samples by `every` are bitwise the ends of shorter rollouts."""
    loaded = subject.load()
    sampled = loaded.free(STEPS, EVERY)
    for row, n in enumerate(range(EVERY, STEPS + 1, EVERY)):
        part = sampled[0][:, row : row + 1], sampled[1][:, row : row + 1]
        ask(alike(loaded.free(n), part), f"the sample after {n} steps differs from {n} steps")


def arguments_are_left_alone(subject: ConformanceSubject) -> None:
    """Require that a rollout does not change the arrays that it receives."""
    loaded = subject.load()
    (q, v), force = loaded.states(), loaded.pushes(STEPS)
    kept = q.copy(), v.copy(), force.copy()
    loaded.model.rollout(q, v, loaded.h, STEPS, force, STEPS)
    for name, old, new in zip(("q", "v", "force"), kept, (q, v, force), strict=True):
        ask(np.array_equal(old, new), f"a rollout has changed the {name} that it was given")


def results_are_the_callers(subject: ConformanceSubject) -> None:
    """Require that a later rollout does not change an earlier result."""
    loaded = subject.load()
    first = loaded.model.rollout(*loaded.states(), loaded.h, STEPS, None, STEPS)
    kept = first[0].copy(), first[1].copy()
    loaded.free(h=loaded.h / 3)
    ask(alike(first, kept), "a later rollout has changed what an earlier one returned")


def a_rollout_repeats_bitwise(subject: ConformanceSubject) -> None:
    """Require that the same call gives the same bits, at once and after other calls."""
    loaded = subject.load()
    first = loaded.pushed()
    ask(alike(loaded.pushed(), first), "the same call gives a different motion the second time")


def an_earlier_step_leaves_no_trace(subject: ConformanceSubject) -> None:
    """Require that a rollout with another step does not change the next one."""
    loaded = subject.load()
    first = loaded.free()
    loaded.free(n=2, h=7 * loaded.h)
    ask(alike(loaded.free(), first), "a rollout with another step has changed the next one")


def an_earlier_force_leaves_no_trace(subject: ConformanceSubject) -> None:
    """Require that a free rollout after a pushed one is free."""
    loaded = subject.load()
    first = loaded.free()
    loaded.pushed()
    ask(alike(loaded.free(), first), "a force of an earlier rollout acts in a free one")


def a_batch_is_its_rows_one_by_one(subject: ConformanceSubject) -> None:
    """Require that a state's motion does not depend on the rest of the batch or its order."""
    loaded = subject.load()
    (q, v), force = loaded.states(), loaded.pushes(STEPS)

    def run(rows: list[int]) -> Motion:
        return loaded.run((q[rows], v[rows]), STEPS, force[rows], EVERY)

    whole = run([0, 1, 2])
    for rows in ([2, 0, 1], [0], [1], [2]):
        part = whole[0][rows], whole[1][rows]
        ask(alike(run(rows), part), f"rows {rows} of a batch move differently alone")


def what_is_not_finite_is_returned_so(subject: ConformanceSubject) -> None:
    """Require that a NaN state gives NaN, without a reset or an error."""
    loaded = subject.load()
    q, v = loaded.states()
    q[1] = np.nan
    z, w = loaded.run((q, v), STEPS, None, STEPS)
    finite = np.isfinite(z[1]).all() and np.isfinite(w[1]).all()
    ask(not finite, "a motion from a NaN state returns finite numbers")


def what_is_not_finite_spoils_nothing(subject: ConformanceSubject) -> None:
    """Require that a NaN motion changes neither others of its batch nor later ones."""
    loaded = subject.load()
    first = loaded.free()
    q, v = loaded.states()
    q[1] = np.nan
    z, w = loaded.run((q, v), STEPS, None, STEPS)
    rows = [0, 2]
    unchanged = alike((z[rows], w[rows]), (first[0][rows], first[1][rows]))
    ask(unchanged, "a NaN motion has changed other motions of the batch")
    ask(alike(loaded.free(), first), "a NaN motion has changed later ones")
