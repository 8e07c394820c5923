"""Steps and callbacks of a script are part of its model; their errors are reported."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import (
    Array,
    EngineError,
    LoadedModel,
    ModelSpec,
    StateForce,
    conform,
)
from physics_crosscheck.harness.engines.registry import engines

pytest.importorskip("pymunk")

H = 0.01
SCRIPT = """import pymunk

{before}

def build():
    space = {space}()
    body = pymunk.Body(2.0, 0.1)
    space.add(body)
    {inside}
    return space, {{"body": body}}
"""

SUBCLASS = """class Half(pymunk.Space):
    def step(self, dt):
        for _ in range(2):
            super().step(dt / 2)
        for body in self.bodies:
            body.velocity *= 0.5
"""

AFTER = """def slow(body, gravity, damping, dt):
    pymunk.Body.update_velocity(body, gravity, damping, dt)
    body.space.add_post_step_callback(halve, body, body)

def halve(space, key, body):
    body.velocity *= 0.5
"""


def load(
    folder: Path, *, before: str = "", space: str = "pymunk.Space", inside: str = ""
) -> LoadedModel:
    path = folder / "space.py"
    text = SCRIPT.format(before=before, space=space, inside=inside or "pass")
    path.write_text(text)
    return engines()["pymunk"].load(ModelSpec(path, settings={"step": H}))


def speeds(model: LoadedModel, n: int = 3, force: Array | StateForce | None = None) -> list[float]:
    still = np.zeros((1, 3))
    v = np.array([[8.0, 0.0, 0.0]])
    return [float(w) for w in model.rollout(still, v, H, n, force, 1)[1][0, :, 0]]


CUSTOM_STEPS = [
    {"before": SUBCLASS, "space": "Half"},
    {"before": AFTER, "inside": "body.velocity_func = slow"},
    {"before": SUBCLASS, "inside": "space.step = lambda dt: Half.step(space, dt)", "space": "Half"},
]


@pytest.mark.parametrize("options", CUSTOM_STEPS, ids=["subclass", "post-step", "attribute"])
def test_custom_step_runs(options: dict[str, str], tmp_path: Path) -> None:
    model = load(tmp_path, **options)
    assert speeds(model) == [4.0, 2.0, 1.0]
    assert speeds(model) == [4.0, 2.0, 1.0]
    z = np.zeros((1, 3))
    assert any("own step" in remark.message for remark in model.remarks(z, z))


def test_post_step_callback_of_build_runs_once(tmp_path: Path) -> None:
    once = 'space.add_post_step_callback(halve, "key", body)'
    model = load(tmp_path, before=AFTER, inside=once)
    for _ in range(2):
        assert speeds(model) == [4.0, 4.0, 4.0]


def test_inputs_act_in_every_substep(tmp_path: Path) -> None:
    model = load(tmp_path, before=SUBCLASS.replace("0.5", "1.0"), space="Half")
    push = np.zeros((1, 3, 3))
    push[:, :, 0] = 10.0
    expected = [8.0 + 10.0 / 2.0 * H * i for i in (1, 2, 3)]
    assert speeds(model, force=push) == pytest.approx(expected)
    by_state = StateForce(np.zeros((1, 3, 1)), lambda z, u: [10.0, 0.0, 0.0])
    assert speeds(model, force=by_state) == pytest.approx(expected)


def test_step_that_ignores_inputs_is_rejected(tmp_path: Path) -> None:
    model = load(tmp_path, inside="space.step = lambda dt: None")
    with pytest.raises(EngineError, match=r"space.py: .*super\(\).step"):
        speeds(model, force=np.ones((1, 3, 3)))


def test_error_in_a_callback_is_reported_with_its_line(tmp_path: Path) -> None:
    before = "def wrong(body, gravity, damping, dt):\n    raise ValueError('of no\\nuse')\n"
    with pytest.raises(EngineError, match=r"space.py:4: a callback fails: of no use"):
        load(tmp_path, before=before, inside="body.velocity_func = wrong")


@pytest.mark.parametrize(
    "error", ["SystemExit(0)", "GeneratorExit", "KeyboardInterrupt", "BaseException('odd')"]
)
def test_exceptions_that_end_a_process_only_fail_the_build(error: str, tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"space.py:9: build\(\) fails"):
        load(tmp_path, inside=f"raise {error}")
    with pytest.raises(EngineError, match=r"space.py:3: "):
        load(tmp_path, before=f"raise {error}")


def test_custom_step_conforms(tmp_path: Path) -> None:
    path = tmp_path / "space.py"
    text = SCRIPT.format(before=SUBCLASS.replace("0.5", "1.0"), space="Half", inside="pass")
    path.write_text(text)
    checks = conform(engines()["pymunk"], ModelSpec(path, settings={"step": H}))
    assert [str(check) for check in checks if not check.passed] == []


def test_gravity_that_a_sidecar_overrides_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "space.py"
    inside = "space.gravity = 0, -1.62"
    path.write_text(SCRIPT.format(before="", space="pymunk.Space", inside=inside))
    z = np.zeros((1, 3))
    for gravity, noted in (([0, -9.81, 0], True), ([0, -1.62, 0], False)):
        settings = {"step": H, "gravity": gravity}
        model = engines()["pymunk"].load(ModelSpec(path, settings=settings))
        notes = [r.message for r in model.remarks(z, z) if "overrides the file's" in r.message]
        assert bool(notes) is noted
        assert not noted or ("-1.62" in notes[0] and "-9.81" in notes[0])
