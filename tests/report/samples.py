"""Results made up for the report's tests: every outcome and every field, as a run writes them."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

SAMPLES = 240
RUNGS = (2, 3, 5, 7, 11, 17, 29, 41)
ENGINES = (("mujoco.xml", "mujoco"), ("robot.urdf", "mujoco"), ("robot.urdf", "pybullet"))
SCENARIOS = ("free", "driven", "large")


def formula(text: str) -> dict[str, str]:
    return {"text": text, "latex": text}


def pole(real: float, imaginary: float) -> dict[str, float]:
    size = abs(complex(real, imaginary))
    return {
        "real": real, "imaginary": imaginary, "frequency": size, "damping": -real / size,
        "multiplicity": 1,
    }  # fmt: skip


def system(name: str, coordinates: int) -> dict[str, Any]:
    names = [f"q{i}" for i in range(coordinates)]
    named = [{"name": n, "unit": "m", "description": f"displacement {n}"} for n in names]
    return {
        "name": name, "folder": f"/models/{name}", "title": f"The {name}", "source": "Example 9.1",
        "kind": "SIMO", "coordinates": named,
        "constants": [
            {
                "name": "k", "unit": "N/m", "description": "stiffness", "value": 38.25,
                "source": "chosen",
            }
        ],
        "inputs": [{"name": "f", "unit": "N", "description": "force"}],
        "outputs": [{**entry, **formula(entry["name"])} for entry in named],
        "energies": {"T": formula("m*q0_dot**2/2"), "V": formula("k*q0**2/2"), "D": formula("0")},
        "equations": [formula(f"Eq(m*{n}_ddot, f*max(0, 1) - k*{n})") for n in names],
        "linearizations": [
            {
                "equilibrium": "rest", "position": [0.0] * coordinates, "matrices": {},
                "poles": [pole(-0.1, 3.0)], "modes": [],
                "transfer_functions": [{"output": "q0", "input": "f", **formula("1/(k + m*s**2)")}],
            }
        ],
        "linearity": [],
        "errata": [
            {
                "number": "9.2", "printed": "k*q0 + k*q0", "verdict": "differs", "derived": "k*q0",
                "difference": "k*q0", "note": "twice",
            }
        ],
        "scenarios": [
            {
                "name": scenario, "description": f"a {scenario} motion", "duration": 12.0,
                "inputs": {"f": "sin(t)"}, "segments": 300, "method": "exactly", "bound": 1e-16,
            }
            for scenario in SCENARIOS
        ],
        "seconds": 1.0,
    }  # fmt: skip


def model(name: str, file: str, engine: str) -> dict[str, Any]:
    return {
        "system": name, "folder": f"/models/{name}", "model": file, "engine": engine,
        "text": f"<{file}/>",
        "linearization": [
            {
                "equilibrium": "rest", "A": [[0.0]], "B": [[0.0]], "A_error": 2.5e-14,
                "B_error": 3.5e-15, "poles": [pole(-0.1, -3.0), pole(-0.1, 3.0003)],
                "taylor_poles": [pole(-0.1, -3.0), pole(-0.1, 3.0)], "transfer_error": None,
                "shapes": 1.0, "frequencies": [1.0], "response": [[[1.0]]],
                "taylor_response": [[[1.0]]],
            }
        ],
    }  # fmt: skip


def case(name: str, file: str, engine: str, scenario: str, coordinates: int) -> dict[str, Any]:
    seed = [ord(c) for c in name + file + engine + scenario]
    return {
        "system": name, "folder": f"/models/{name}", "model": file, "engine": engine,
        "scenario": scenario, "outcome": "AGREES", "discrepancy": 7.1e-14, "uncertainty": 1.02e-12,
        "component": "q0", "time": 1.1, "order": 1.002, "claimed_order": 1, "integrator": "euler",
        "shipped_step": 0.002, "raw_error": 0.00911, "raw_order": 1.001, "reason": "",
        "steps": 48185, "rungs": list(RUNGS),
        "apart": {
            "amplitude": -0.029, "phase": -0.068, "frequency": 4.6e-4, "damping": 2.3e-4,
            "explained": 0.97,
        },
        "steps_for": [{"target": 0.01, "step": 0.0021}, {"target": 0.001, "step": None}],
        "checked_step": {"target": 0.01, "step": 0.0021, "measured": 0.00957},
        "energy_error": 0.0068, "constraint_drift": 0.0, "seconds": 0.8,
        "series": series(np.random.default_rng(seed), coordinates),
    }  # fmt: skip


def rounded(values: Any, digits: int) -> Any:
    if isinstance(values, np.ndarray):
        return [rounded(value, digits) for value in values.tolist()]
    return (
        [rounded(v, digits) for v in values]
        if isinstance(values, list)
        else float(f"{values:.{digits}g}")
    )


def series(random: np.random.Generator, coordinates: int) -> dict[str, Any]:
    t = np.linspace(0.0, 12.0, SAMPLES)
    size = 2 * coordinates
    names = [f"q{i}" for i in range(coordinates)]
    reference = np.sin(np.outer(np.arange(1, size + 1), t))
    error = 0.01 * random.normal(size=reference.shape)
    error[:, 0] = 0.0
    h = 0.04 / np.array(RUNGS)
    return {
        "t": rounded(t, 7),
        "components": names + [f"{n}_dot" for n in names],
        "reference": rounded(reference, 6),
        "engine": rounded(reference + error, 6),
        "error": rounded(error, 4),
        "segment_t": rounded(t, 6),
        "defect": rounded(1e-14 * random.normal(size=reference.shape), 3),
        "defect_uncertainty": rounded(1e-12 * random.uniform(1, 2, size=reference.shape), 3),
        "convergence": {
            "rungs": list(RUNGS), "h": rounded(h, 6), "raw": rounded(0.3 * h, 4),
            "draws": rounded(10.0 ** -np.arange(1.0, len(RUNGS)), 4),
        },
        "plain": {"h": [0.002, 0.001], "error": [0.0091, 0.0045]},
    }  # fmt: skip


def results(systems: int = 2) -> dict[str, Any]:
    """All cases agree; systems of one coordinate and of two in turn."""
    sizes = {f"system_{i}": 1 + i % 2 for i in range(systems)}
    runs = [(name, *pair) for name in sizes for pair in ENGINES]
    return {
        "schema": 1, "created": "2026-11-21T02:19:33+00:00", "resolution": 1e-9, "seconds": 37.4,
        "versions": {
            "physics-crosscheck": "0.1.0", "python": "3.11.7", "mujoco": "4.0.0", "pybullet": None,
        },
        "systems": [system(name, size) for name, size in sizes.items()],
        "models": [model(*run) for run in runs],
        "cases": [case(*run, s, sizes[run[0]]) for run in runs for s in SCENARIOS],
    }  # fmt: skip


def unjudged(case: dict[str, Any], outcome: str, reason: str, **more: str) -> dict[str, Any]:
    """A case that was not run, as `harness.run` records it."""
    place = {k: case[k] for k in ("system", "folder", "model", "engine", "scenario")}
    nothing = dict.fromkeys(("discrepancy", "uncertainty", "order", "shipped_step", "raw_error"))
    rest = {"component": "", "seconds": 0.0, "series": None, "outcome": outcome, "reason": reason}
    return place | nothing | rest | more


def mixed() -> dict[str, Any]:
    """One case of each outcome, one blown up, and a folder that could not be read."""
    found = copy.deepcopy(results())
    cases = found["cases"]
    cases[0] |= {"outcome": "DIFFERS", "discrepancy": 3.1e-6, "reason": "q0 ends 3.1e-06 off"}
    cases[1] |= {"outcome": "UNRESOLVED", "uncertainty": None, "order": None, "reason": "exponents"}
    cases[2] = unjudged(cases[2], "ABSENT", "pybullet is not installed")
    cases[3] = unjudged(
        cases[3], "FAILED", "the engine's process died", printed="Segmentation fault"
    )
    cases[4] |= {
        "outcome": "FAILED",
        "reason": "no longer finite",
        "raw_error": None,
        "apart": None,
    }
    for key in ("engine", "error"):
        for row in cases[4]["series"][key]:
            row[100:] = [None] * len(row[100:])
            row[80:100] = [10.0 ** (4 * i) for i in range(20)]
    unread = unjudged(cases[5], "FAILED", "/models/unread/system.py: line 3: no unit", printed="")
    unread |= {"system": "unread", "folder": "/models/unread", "engine": "-", "scenario": "-"}
    cases.append(unread)
    found["models"][1] |= {"linearization": [], "reason": "it diverges"}
    return found
