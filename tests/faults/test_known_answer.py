"""Expected outcome of each known fault of an engine, in real workers."""

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Case, Results
from tests.faults.known_folder import (
    KNOWN_MODEL,
    ROOT,
    SYSTEM,
    by_case,
    discrepancy,
    environment,
    known_folder,
    run_folders,
    uncertainty,
)

pytestmark = pytest.mark.xdist_group("known answer")

LIMIT = 2.0
"""Limit in processor seconds for cases, audit and linearization that hang."""
FORCE = 47.0 * 0.25
"""Initial spring force, in newtons."""

FAULTS = {
    "good": "",
    "off": "[fault]\noff = 1e-6\n",
    "drags": "[fault]\ndrags_after_steps = 100\n",
    "limit": "[fault]\nlimit = 0.15\n",
    "nan": "[fault]\nnan_after_seconds = 0.0\n",
    "late_nan": "[fault]\nnan_after_seconds = 0.5\n",
    "raises": "[fault]\nraises = '<b>no & such</b>'\n",
    "remembers": "[fault]\nremembers = 1e-6\n",
    "dies": "[fault]\nsegfault = true\n",
    "exits": "[fault]\nexits = 3\n",
    "odd": "[fault]\nodd = true\n",
    "broken": "names =\n",
} | {f"friction_{e}": f"[fault]\nfriction = {FORCE * 10.0**-e!r}\n" for e in (1, 2, 3, 4)}
# These replace lines of the valid file instead of adding lines.
REPLACED = {
    "order_2_says_1": ('"euler"', '"heun"'),
    "order_1_says_2": ("claims = 1", "claims = 2"),
    "absent": ("", ""),
    "bad_sidecar": ("", ""),
    "also_good": ("", ""),
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Run every fault in one folder, and a broken folder."""
    place = tmp_path_factory.mktemp("known")
    folder = known_folder(place / "oscillator", FAULTS)
    for name, (old, new) in REPLACED.items():
        (folder / f"{name}.known").write_text(KNOWN_MODEL.replace(old, new))
        (folder / f"{name}.known.toml").write_text('engines = ["known"]\n')
    (folder / "absent.known.toml").write_text('engines = ["missing"]\n')
    (folder / "bad_sidecar.known.toml").write_text('engines = ["known"\n')
    broken = known_folder(place / "broken", {"good": ""})
    (broken / "system.py").write_text(SYSTEM + "\nsystem = undefined\n")
    (broken / "good.known").write_text(KNOWN_MODEL)
    (folder / "system.py").write_text(without(SYSTEM, "driven"))
    varying = known_folder(place / "varying", {"good": "", "order_2_says_1": ""})
    (varying / "order_2_says_1.known").write_text(KNOWN_MODEL.replace(*REPLACED["order_2_says_1"]))
    (varying / "system.py").write_text(without(SYSTEM, "free"))
    return run_folders(folder, varying, broken, out=place / "results.json")


def without(system: str, scenario: str) -> str:
    """Remove a scenario: each fault runs in one, and faults that depend on inputs in both."""
    return re.sub(rf' *Scenario\("{scenario}".*?duration=1.0\),\n', "", system, flags=re.DOTALL)


def cases(ran: Results, name: str) -> list[Case]:
    """Return the cases of a model file, free before driven."""
    results = by_case(ran)
    keys = [(f"{name}.known", "known", scenario) for scenario in ("free", "driven")]
    return [results[key] for key in keys if key in results]


def test_correct_model_agrees_well_within_the_resolution(ran: Results) -> None:
    for case in cases(ran, "good"):
        assert discrepancy(case) < uncertainty(case) < 1e-11


EXPECTED: dict[str, tuple[str, str]] = {
    "off": ("DIFFERS", "off"),
    "limit": ("DIFFERS", ""),
    "order_1_says_2": ("UNRESOLVED", "so the extrapolation is not trusted"),
    "nan": ("FAILED", "not finite"),
    "late_nan": ("FAILED", r"no longer finite at t = 0\.5"),
    "dies": ("FAILED", "SIGSEGV"),
    "raises": ("FAILED", "<b>no & such</b>"),
    "exits": ("FAILED", r"oscillator/exits\.known: SystemExit: 3$"),
    "odd": ("FAILED", r"oscillator/odd\.known: OddError: two arguments$"),
    "broken": ("FAILED", r"broken\.known.*line"),
    "good": ("AGREES", "^$"),  # in spite of the crashes of the others
    "also_good": ("AGREES", "^$"),
}
"""Outcome of each fault, and its reason as a pattern."""


@pytest.mark.parametrize("name", EXPECTED)
def test_fault_has_its_outcome_and_reason(ran: Results, name: str) -> None:
    outcome, reason = EXPECTED[name]
    assert cases(ran, name)
    for case in cases(ran, name):
        assert case.outcome == outcome
        assert re.search(reason, case.reason)


def test_stiffness_error_of_1e_6_differs_by_1e_6(ran: Results) -> None:
    for case in cases(ran, "off"):
        assert 0.3e-6 < discrepancy(case) < 3e-6
        assert uncertainty(case) < 1e-10


def test_order_2_method_that_claims_1_is_unresolved(ran: Results) -> None:
    free, driven = cases(ran, "order_2_says_1")
    assert free.outcome == "UNRESOLVED"
    assert "so the extrapolation is not trusted" in free.reason
    assert "order is 2.00" in free.reason
    # Holding a varying input over each step reduces the order to 1, so the claim is true.
    assert driven.outcome == "AGREES"


def test_order_1_method_that_claims_2_has_its_order_reported(ran: Results) -> None:
    for case in cases(ran, "order_1_says_2"):
        assert case.verdict is not None
        assert case.verdict.order == pytest.approx(1, abs=0.1)


def test_memory_between_steps_is_detected_in_full_runs(ran: Results) -> None:
    for case in cases(ran, "drags"):
        assert case.outcome == "UNRESOLVED"
        assert "carries a state from step to step" in case.reason
        assert discrepancy(case) < 1e-11, "the segments are too short for this memory"
        assert case.full_run is not None
        assert case.full_run.global_error is not None
        assert case.full_run.global_error > 1e-3


def test_memory_between_calls_never_agrees(ran: Results) -> None:
    for case in cases(ran, "remembers"):
        assert case.outcome in {"DIFFERS", "UNRESOLVED"}
        assert uncertainty(case) > 1e-9


@pytest.mark.parametrize("exponent", [1, 2, 3, 4])
def test_coulomb_friction_differs_in_proportion_to_its_force(ran: Results, exponent: int) -> None:
    for case in cases(ran, f"friction_{exponent}"):
        assert case.outcome == "DIFFERS"
        assert 0.2 < discrepancy(case) * 10**exponent < 5


@pytest.mark.slow
def test_hang_fails_at_the_time_limit(tmp_path: Path) -> None:
    folder = known_folder(tmp_path / "oscillator", {"hangs": "[fault]\nhang = 1000\n"})
    results = run_folders(folder, out=tmp_path / "results.json", limit=LIMIT)
    for case in cases(results, "hangs"):
        assert case.outcome == "FAILED"
        assert f"used up its limit of {LIMIT:g} processor seconds" in case.reason
    (model,) = results.models
    assert [check for check, _ in model.failures] == ["audit", "linearization"]
    assert not model.passes


def test_invalid_sidecar_is_reported_by_name_and_line(ran: Results) -> None:
    (case,) = (c for c in ran.cases if c.model == "bad_sidecar.known")
    assert case.outcome == "FAILED"
    assert "bad_sidecar.known.toml" in case.reason
    assert "line 1" in case.reason or "end of document" in case.reason


def test_invalid_system_fails_only_its_own_folder(ran: Results) -> None:
    (case,) = (c for c in ran.cases if c.folder.endswith("broken"))
    assert case.outcome == "FAILED"
    line = len(SYSTEM.splitlines()) + 2
    assert f"system.py:{line}: NameError" in case.reason


def test_unknown_engine_fails_and_lists_known_engines(ran: Results) -> None:
    absent = [c for c in ran.cases if c.model == "absent.known"]
    assert absent
    for case in absent:
        assert case.outcome == "FAILED"
        assert "'missing'" in case.reason
        assert "known, mjx, mujoco" in case.reason


def test_numbers_of_the_results_are_finite_or_null(ran: Results) -> None:
    def walk(value: Any) -> None:
        if isinstance(value, dict):
            for item in value.values():
                walk(item)
        elif isinstance(value, list):
            for item in value:
                walk(item)
        elif isinstance(value, float):
            assert math.isfinite(value)

    walk(json.loads(encoded(ran)))


@pytest.mark.slow
def test_engine_that_is_not_installed_is_absent(tmp_path: Path) -> None:
    folder = known_folder(tmp_path / "oscillator", {"good": ""})
    (folder / "space.py").write_text("")
    (folder / "space.py.toml").write_text('engines = ["pymunk"]\n[settings]\nstep = 0.01\n')
    hide = tmp_path / "sitecustomize.py"
    hide.write_text(
        "import importlib.util as u\n_f = u.find_spec\n"
        "u.find_spec = lambda n, p=None: None if n == 'pymunk' else _f(n, p)\n"
    )
    results = run_folders(folder, out=tmp_path / "results.json", first_on_path=[tmp_path])
    by_key = by_case(results)
    for scenario in ("free", "driven"):
        case = by_key["space.py", "pymunk", scenario]
        assert case.outcome == "ABSENT"
        assert case.reason.startswith("pymunk is not installed; pip install ")
        assert by_key["good.known", "known", scenario].outcome == "AGREES"
    assert results.versions["pymunk"] is None


def test_third_party_engine_is_discovered_by_entry_point() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "physics_crosscheck", "engines"],
        capture_output=True,
        text=True,
        env=environment(),
        cwd=ROOT,
        timeout=600,
        check=True,
    )
    assert "known      1.0" in done.stdout
    assert "reads .known" in done.stdout
