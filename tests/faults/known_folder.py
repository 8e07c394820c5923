"""Folders with faults, and functions that run them in real workers."""

import math
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from physics_crosscheck.harness.jobs.workers import Limits
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.run import Options, Selection, run
from physics_crosscheck.records import Case, Results, read_results

ROOT = Path(__file__).parents[2]
KNOWN_ANSWER = ROOT / "tests" / "known_answer"

SYSTEM = '''
"""An oscillator for tests of the known-answer engine."""

from sympy import sin

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, t

x = Coordinate("x", "m", "displacement")
m = Constant("m", 1.3, "kg", "mass", "chosen")
c = Constant("c", 0.9, "N*s/m", "damping", "chosen")
k = Constant("k", 47.0, "N/m", "stiffness", "chosen")
f = Input("f", "N", "force", on={x: 1})
system = System(
    name="oscillator", title="Oscillator", source="a test", coordinates=(x,),
    constants=(m, c, k), inputs=(f,), outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * x.v**2 / 2, V=k * x.q**2 / 2, D=c * x.v**2 / 2,
    equilibria=(Equilibrium("rest", {x: 0}, False, "relaxed"),),
    scenarios=(
        Scenario("free", "released", q={x: 0.25}, v={x: -0.4}, inputs={f: 0}, duration=1.0),
        Scenario("driven", "driven", q={x: 0.1}, v={x: 0.2}, inputs={f: 1.5 * sin(5.9 * t)},
                 duration=1.0),
    ),
    published=(),
)
'''

KNOWN_MODEL = """
names = ["x"]
M = [[1.3]]
C = [[0.9]]
K = [[47.0]]
W = [0.0]
step = 0.005
method = "euler"
claims = 1
"""


def known_folder(place: Path, files: Mapping[str, str]) -> Path:
    """Write a folder with the oscillator and `.known` files: name -> text added to a valid one."""
    place.mkdir(parents=True, exist_ok=True)
    (place / "system.py").write_text(SYSTEM)
    for name, added in files.items():
        (place / f"{name}.known").write_text(KNOWN_MODEL + added)
        (place / f"{name}.known.toml").write_text('engines = ["known"]\n')
    return place


SCRIPT = """
import sys
from pathlib import Path
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.harness.jobs.limits import Limits
out, limit, *folders = sys.argv[1:]
options = Options(jobs=2, limits=Limits(seconds=float(limit)))
result = run([Path(f) for f in folders], options, lambda *_: None)
write_whole(Path(out), encoded(result.results))
"""


def environment(*first: Path | str) -> dict[str, str]:
    """Return variables with which a process finds the checkout and the known-answer engine."""
    paths = [*map(str, first), str(ROOT), str(KNOWN_ANSWER)]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "CI": "1"}


def run_folders(
    *folders: Path,
    out: Path,
    limit: float = 60.0,
    first_on_path: Iterable[Path] = (),
    verdicts: bool = False,
) -> Results:
    """Run every case of the folders with two workers; return the written results.

    `first_on_path` starts a separate process. `verdicts` skips audit, linearization and diagnosis.
    """
    if not first_on_path:
        selection = Selection(models=None) if verdicts else None
        options = Options(jobs=2, limits=Limits(seconds=limit), selection=selection)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("CI", "1")
            patch.syspath_prepend(str(KNOWN_ANSWER))
            write_whole(out, encoded(run([*folders], options, lambda *_: None).results))
        return read_results(out)
    wanted = [str(out), str(limit), *map(str, folders)]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *wanted],
        capture_output=True,
        text=True,
        timeout=1800,
        env=environment(*first_on_path),
    )
    assert done.returncode == 0, done.stderr
    return read_results(out)


def by_case(results: Results) -> dict[tuple[str, str, str], Case]:
    """Return cases by (model file, engine, scenario)."""
    return {(c.model, c.engine, c.scenario): c for c in results.cases}


def discrepancy(case: Case) -> float:
    assert case.verdict is not None
    assert case.verdict.discrepancy is not None
    return case.verdict.discrepancy


def uncertainty(case: Case) -> float:
    assert case.verdict is not None
    return math.inf if case.verdict.uncertainty is None else case.verdict.uncertainty


def one_scenario(system: str, place: Path, scenario: str) -> Path:
    """Create a built-in system's folder with one scenario and without model files."""
    place.mkdir(parents=True, exist_ok=True)
    text = (ROOT / "models" / system / "system.py").read_text()
    kept = f"[s for s in system.scenarios if s.name == {scenario!r}]"
    text += "\n\nfrom dataclasses import replace\n\n"
    text += f"system = replace(system, scenarios=tuple({kept}))\n"
    (place / "system.py").write_text(text)
    return place
