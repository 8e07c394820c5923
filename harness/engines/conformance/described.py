"""Checks of the descriptions of an adapter and its models, and of the input that they reject."""

import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.engines.conformance.subject import (
    ConformanceError,
    ConformanceSubject,
    ask,
)
from physics_crosscheck.harness.engines.protocol import Engine, EngineError, ModelSpec
from physics_crosscheck.harness.engines.remark import Remark


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
