"""The conformance suite: every adapter passes it, and each mistake fails its check."""

import tempfile
import tomllib
from argparse import Namespace
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import physics_crosscheck.harness.interfaces.cli.engines as command
from physics_crosscheck.engine import (
    Array,
    Check,
    Engine,
    Force,
    ModelSpec,
    Remark,
    StateForce,
    conform,
    conform_samples,
)
from physics_crosscheck.harness.engines.conformance import CHECKS
from physics_crosscheck.harness.engines.known_answer import KnownEngine, KnownModel
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.extras import need
from tests.engines.protocol_models import PAIRINGS, Pairing

ADAPTERS = tuple(engines())


def failures(checks: Iterable[Check]) -> list[str]:
    return [str(check) for check in checks if not check.passed]


def adapter(name: str) -> Engine:
    """Return the adapter of an installed engine, or skip with what is missing."""
    need(name)
    return engines()[name]


@pytest.mark.parametrize("name", ADAPTERS)
def test_every_adapter_conforms_on_its_samples(name: str) -> None:
    engine = adapter(name)
    results = conform_samples(engine)
    assert {Path(file).suffix for file in results} == set(engine.formats) - {".usdc", ".usdz"}
    for checks in results.values():
        assert len(checks) == len(CHECKS)
        assert failures(checks) == []


@pytest.mark.parametrize("pairing", PAIRINGS, ids=str)
def test_every_pairing_conforms(pairing: Pairing, tmp_path: Path) -> None:
    assert failures(conform(adapter(pairing.engine), pairing.spec("pair", tmp_path))) == []


def test_checks_have_unique_names_and_sentences() -> None:
    (checks, *_) = conform_samples(KnownEngine()).values()
    assert len({check.name for check in checks}) == len(checks)
    for check in checks:
        assert str(check).startswith("passed  ")
        assert check.sentence.endswith(".")


class Wrong(KnownModel):
    """A model whose rollouts subclasses can change before and after."""

    def __init__(self, file: Any) -> None:
        super().__init__(file)
        self.last: tuple[Array, float, Force, int] | None = None

    def before(self, q: Array, force: Force) -> Force:
        return force

    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        return z, w

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, self.before(q, force), every)
        result: tuple[Array, Array] = self.after(z, w, q, h, force, every)
        self.last = q.copy(), h, force, n
        return result


class TwoAlike(Wrong):
    def __init__(self, file: Any) -> None:
        super().__init__(file)
        self.coordinates = ("x", "x")


class OneGravity(Wrong):
    gravity = (9.81,)


class WordsForRemarks(Wrong):
    def remarks(self, z: Array, w: Array) -> Iterable[Remark]:
        yield "a word"  # type: ignore[misc]  # the mistake


class ForgetsItsStep(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        self.step = h
        return z, w


class FlatSingles(Wrong):
    """Returns one sample of one step without its axis."""

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        z, w = super().rollout(q, v, h, n, force, every)
        return (z[:, 0], w[:, 0]) if n == 1 else (z, w)


class SamplesElsewhere(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        return (z + 1e-9, w) if every == 4 else (z, w)


class WritesIntoForces(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        if isinstance(force, np.ndarray):
            force[:] = 0.0
        return z, w


class OneBuffer(Wrong):
    buffers: dict[tuple[int, ...], Array]

    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        self.buffers = getattr(self, "buffers", {})
        buffer = self.buffers.setdefault(z.shape, z)
        buffer[:] = z
        return buffer, w


class NoticesARepeat(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        if self.last is not None and isinstance(force, np.ndarray):
            q_then, h_then, force_then, _ = self.last
            again = isinstance(force_then, np.ndarray) and np.array_equal(force_then, force)
            if again and h_then == h and np.array_equal(q_then, q):
                return z + 1e-12, w
        return z, w


class RemembersASlowStep(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        slow = self.last is not None and self.last[1] > 5 * h
        return (z + 1e-12 if slow else z), w


class RemembersAForce(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        pushed = self.last is not None and isinstance(self.last[2], np.ndarray)
        return (z + 1e-12 if pushed and force is None else z), w


class CountsRows(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        return z + 1e-12 * np.arange(len(z))[:, None, None], w


class PushesLate(Wrong):
    def before(self, q: Array, force: Force) -> Force:
        if isinstance(force, StateForce):
            return StateForce(np.roll(force.inputs, 1, axis=1), force.evaluate)
        return None if force is None else np.roll(force, 1, axis=1)


class PushesOnAndOn(Wrong):
    def before(self, q: Array, force: Force) -> Force:
        if isinstance(force, StateForce):
            return StateForce(np.cumsum(force.inputs, axis=1), force.evaluate)
        return None if force is None else np.cumsum(force, axis=1)

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return 1, 1


class PushesOutOfProportion(Wrong):
    def before(self, q: Array, force: Force) -> Force:
        if isinstance(force, StateForce):
            return StateForce(force.inputs * (1 + 50 * np.abs(force.inputs)), force.evaluate)
        return None if force is None else force * (1 + 50 * np.abs(force))


class PushesHarderByState(Wrong):
    def before(self, q: Array, force: Force) -> Force:
        if isinstance(force, StateForce):
            return StateForce(1.001 * force.inputs, force.evaluate)
        return force


class SeesAnotherState(Wrong):
    def before(self, q: Array, force: Force) -> Force:
        if isinstance(force, StateForce):
            given = force
            return StateForce(given.inputs, lambda z, u: given.evaluate([x + 1e-6 for x in z], u))
        return force


class ResetsItself(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        return np.nan_to_num(z), np.nan_to_num(w)


class StaysSpoilt(Wrong):
    def after(self, z: Array, w: Array, q: Array, h: float, force: Force, every: int) -> Any:
        spoilt = self.last is not None and not np.isfinite(self.last[0]).all()
        return (z + 1e-12 if spoilt else z), w


class ForgetsForces(Wrong):
    def accelerations(self, z: Array, w: Array, force: Array) -> Array:
        return self._acceleration(z, w, 0 * force)


class ClaimsTwo(Wrong):
    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return 2, 1


class WrongEngine(KnownEngine):
    """The adapter of a wrong model."""

    def __init__(self, model: type[Wrong] = Wrong) -> None:
        self.model = model

    def load(self, spec: ModelSpec) -> KnownModel:
        super().load(spec)  # reports errors of the file correctly
        return self.model(tomllib.loads(spec.path.read_text()))


class TwoWords(WrongEngine):
    name = "two words"


class ForeignErrors(WrongEngine):
    """Passes on errors of reading without naming the file."""

    def load(self, spec: ModelSpec) -> KnownModel:
        spec.path.read_text().index("names")
        return super().load(spec)


class TakesAnySetting(WrongEngine):
    def load(self, spec: ModelSpec) -> KnownModel:
        return super().load(ModelSpec(spec.path, spec.springs))


WRONG = {
    "engine is described": TwoWords(),
    "model is described": WrongEngine(TwoAlike),
    "hooks have their shapes": WrongEngine(OneGravity),
    "the step stays the shipped one": WrongEngine(ForgetsItsStep),
    "rollouts have their shape": WrongEngine(FlatSingles),
    "every gives the ends of shorter rollouts": WrongEngine(SamplesElsewhere),
    "arguments are left alone": WrongEngine(WritesIntoForces),
    "results are the callers": WrongEngine(OneBuffer),
    "a rollout repeats bitwise": WrongEngine(NoticesARepeat),
    "an earlier step leaves no trace": WrongEngine(RemembersASlowStep),
    "an earlier force leaves no trace": WrongEngine(RemembersAForce),
    "a batch is its rows one by one": WrongEngine(CountsRows),
    "a force acts in its own step": WrongEngine(PushesLate),
    "impulses are in proportion": WrongEngine(PushesOutOfProportion),
    "a force by state is the same force": WrongEngine(PushesHarderByState),
    "a force by state sees the start of its step": WrongEngine(SeesAnotherState),
    "what is not finite is returned so": WrongEngine(ResetsItself),
    "what is not finite spoils nothing": WrongEngine(StaysSpoilt),
    "orders are as claimed": WrongEngine(ClaimsTwo),
    "accelerations are those of small steps": WrongEngine(ForgetsForces),
    "errors name the file": ForeignErrors(),
    "an unknown setting is refused": TakesAnySetting(),
}


def checked(engine: WrongEngine) -> tuple[Check, ...]:
    (sample,) = (one for one in engine.samples() if one.file == "euler.known")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / sample.file
        path.write_text(sample.text)
        return conform(engine, ModelSpec(path, sample.springs, sample.settings))


def failed(engine: WrongEngine) -> list[str]:
    return [check.name for check in checked(engine) if not check.passed]


def test_engine_without_mistakes_passes() -> None:
    assert failed(WrongEngine()) == []


def test_every_check_has_a_wrong_engine() -> None:
    assert list(WRONG) == [check.__name__.replace("_", " ") for check in CHECKS]


@pytest.mark.parametrize("name", WRONG)
def test_mistake_fails_only_its_check(name: str) -> None:
    assert failed(WRONG[name]) == [name]


@pytest.mark.parametrize(
    ("model", "name"),
    [(WordsForRemarks, "hooks have their shapes"), (PushesOnAndOn, "a force acts in its own step")],
)
def test_other_mistakes_fail_too(model: type[Wrong], name: str) -> None:
    assert name in failed(WrongEngine(model))


def test_engine_that_raises_is_reported() -> None:
    class Raises(Wrong):
        def before(self, q: Array, force: Force) -> Force:
            raise ZeroDivisionError("an engine's own")

    checks = checked(WrongEngine(Raises))
    messages = [check.sentence for check in checks if not check.passed]
    assert "it ended in ZeroDivisionError: an engine's own" in messages


def test_command_lists_each_check_of_an_engine(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(Namespace(conformance="known")) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "euler.known"
    assert lines[1].startswith("  passed  engine is described: ")
    assert len(lines) == 3 * (1 + len(CHECKS))


def test_command_exits_with_1_if_a_check_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "engines", lambda: {"wrong": WrongEngine(ClaimsTwo)})
    assert command.main(Namespace(conformance="wrong")) == 1


def test_command_lists_installed_engines(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(Namespace(conformance="nothing")) == 2
    assert "engine 'nothing' is not installed. Installed: " in capsys.readouterr().err
