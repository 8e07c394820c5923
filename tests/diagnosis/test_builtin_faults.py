"""Faults in the built-in models: the command names them from motions alone."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.records import read_results
from tests.commands import crosscheck
from tests.standing import keep_default_engines, shorten_scenarios


@pytest.fixture
def folder(tmp_path: Path) -> Callable[[str], Path]:
    def copy(name: str) -> Path:
        shutil.copytree(builtin() / name, tmp_path / name)
        keep_default_engines(tmp_path / name)
        shorten_scenarios(tmp_path / name)
        return tmp_path / name

    return copy


@pytest.mark.slow
@pytest.mark.parametrize(("name", "file", "engine", "old", "new", "cause", "expected"), [
    ("anchored_pair", "robot.urdf.toml", "mujoco", "damping = 1.1", "damping = 1.16",
     "sidecar:spring[0].damping", 1.1),
])  # fmt: skip
def test_wrong_literal_is_named_with_file_line_and_value(
    folder: Callable[[str], Path],
    tmp_path: Path,
    name: str,
    file: str,
    engine: str,
    old: str,
    new: str,
    cause: str,
    expected: float,
) -> None:
    path = folder(name) / file
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    line = text[: text.index(old)].count("\n") + 1
    words = "run", path.parent, "--engine", engine, "-k", "free", "--out", "out"
    done = crosscheck(*words, cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    model = file.removesuffix(".toml")
    results = read_results(tmp_path / "out" / "results.json")
    diagnosis = next(m.diagnosis for m in results.models if m.model == model)
    assert diagnosis is not None
    first = diagnosis.explanations[0]
    assert diagnosis.explained
    assert cause in [str(one) for one in (*first.causes, *first.tied_with)]
    (named,) = next(
        e.causes for e in diagnosis.explanations if [str(c) for c in e.causes] == [cause]
    )
    assert [(one.file, one.line) for one in named.locations] == [(file, line)]
    assert named.estimate == pytest.approx(expected, abs=0.01 * abs(float_of(new) - expected))
    top = " ".join(" ".join(done.stdout.splitlines()[:8]).split())
    assert f"FAIL {name}/{model} [{engine}]" in top
    assert "cause: " in top
    assert f"{file}:{line} from" in top
    # The audit reads the same literal; it is reported once.
    assert "the audit finds" not in done.stdout


def float_of(text: str) -> float:
    """Return the last number of a replacement."""
    return float(re.findall(r"-?\d+\.\d+", text)[-1])


@pytest.mark.slow
def test_run_exits_1_for_a_wrong_literal_without_effect_on_motion(
    folder: Callable[[str], Path], tmp_path: Path
) -> None:
    path = folder("mass_spring_damper") / "mujoco.xml"
    text = path.read_text()
    path.write_text(re.sub(r'diaginertia="[\d. ]+"', 'diaginertia="0.03 0.03 0.03"', text))
    run = crosscheck("run", path.parent, "--engine", "mujoco", "-k", "free", cwd=tmp_path)
    assert run.returncode == 1
    assert " 2 ok" in run.stdout.splitlines()[1]
    assert "mujoco.xml:" in run.stdout
