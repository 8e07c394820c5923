"""Results made up for the report's tests: every outcome and every field, as a run writes them."""

from __future__ import annotations

import copy
import html
from typing import Any

import numpy as np

SAMPLES = 240
RUNGS = (2, 3, 5, 7, 11, 17, 29, 41)
ENGINES = (("mujoco.xml", "mujoco"), ("robot.urdf", "mujoco"), ("robot.urdf", "pybullet"))
SCENARIOS = ("free", "driven", "large")


def formula(text: str) -> dict[str, str]:
    return {"text": text, "latex": text, "mathml": f"<mrow><mi>{html.escape(text)}</mi></mrow>"}


def sketch(coordinates: int) -> dict[str, Any]:
    """Blocks on springs, the first of them turned."""
    shapes: list[dict[str, Any]] = [
        {"kind": "wall", "label": "", "start": [-1.0, 0.5], "end": [-1.0, -0.5]},
        {"kind": "measure", "label": "q0", "start": [0.0, 0.4], "end": [["q", 0], 0.4]},
        {
            "kind": "angle",
            "label": "theta",
            "at": [0.0, 0.0],
            "radius": 0.3,
            "start": 0.0,
            "end": ["*", 2.0, ["q", 0]],
        },
    ]
    for i in range(coordinates):
        here = ["+", ["q", i], float(i)]
        shapes += [
            {"kind": "spring", "label": "k", "start": [i - 1.0, 0.0], "end": [here, 0.0]},
            {
                "kind": "block",
                "label": f"m_{i}",
                "at": [here, ["sin", ["*", 0.5, ["q", i]]]],
                "width": 0.3,
                "height": 0.2,
                "angle": ["^", ["q", i], 2.0],
            },
        ]
    return {"pose": [0.5] * coordinates, "shapes": shapes}


def pole(real: float, imaginary: float) -> dict[str, float]:
    size = abs(complex(real, imaginary))
    return {
        "real": real,
        "imaginary": imaginary,
        "frequency": size,
        "damping": -real / size,
        "multiplicity": 1,
    }


def system(name: str, coordinates: int) -> dict[str, Any]:
    names = [f"q{i}" for i in range(coordinates)]
    named = [{"name": n, "unit": "m", "description": f"displacement {n}"} for n in names]
    return {
        "name": name,
        "folder": f"/models/{name}",
        "title": f"The {name}",
        "source": "Example 9.1",
        "kind": "SIMO",
        "coordinates": named,
        "constants": [
            {
                "name": "k",
                "unit": "N/m",
                "description": "stiffness",
                "value": 38.25,
                "source": "chosen",
            }
        ],
        "inputs": [{"name": "f", "unit": "N", "description": "force"}],
        "outputs": [{**entry, **formula(entry["name"])} for entry in named],
        "energies": {"T": formula("m*q0_dot**2/2"), "V": formula("k*q0**2/2"), "D": formula("0")},
        "equations": [formula(f"Eq(m*{n}_ddot, f*max(0, 1) - k*{n})") for n in names],
        "linearizations": [
            {
                "equilibrium": "rest",
                "position": [0.0] * coordinates,
                "matrices": {},
                "mathml": "<mrow><mi>M</mi></mrow>",
                "poles": [pole(-0.1, 3.0)],
                "modes": [
                    {"frequency": 3.0, "growth": 0.0, "shape": [1.0] * coordinates, "rigid": False}
                ],
                "transfer_functions": [{"output": "q0", "input": "f", **formula("1/(k + m*s**2)")}],
            }
        ],
        "linearity": [
            {
                "equilibrium": "rest",
                "mode": 0,
                "period": 2.0,
                "amplitudes": [0.01, 0.1, 1.0],
                "errors": [1e-5, 1e-3, 0.1],
            }
        ],
        "errata": [
            {
                "number": "9.2",
                "printed": "k*q0 + k*q0",
                "verdict": "differs",
                "derived": "k*q0",
                "difference": "k*q0",
                "note": "twice",
            }
        ],
        "scenarios": [
            {
                "name": scenario,
                "description": f"a {scenario} motion",
                "duration": 12.0,
                "inputs": {"f": "sin(t)"},
                "segments": 300,
                "method": "exactly",
                "bound": 1e-16,
            }
            for scenario in SCENARIOS
        ],
        "sketch": sketch(coordinates),
        "seconds": 1.0,
    }


def model(name: str, file: str, engine: str, coordinates: int) -> dict[str, Any]:
    return {
        "system": name,
        "folder": f"/models/{name}",
        "model": file,
        "engine": engine,
        "text": f"<{file}/>\n" + "\n".join(f"  <line n='{i}'/>" for i in range(2, 41)),
        "audit": [],
        "linearization": [
            {
                "equilibrium": "rest",
                "A": [[0.0]],
                "B": [[0.0]],
                "A_error": 2.5e-14,
                "B_error": 3.5e-15,
                "poles": [pole(-0.1, -3.0), pole(-0.1, 3.0003)],
                "taylor_poles": [pole(-0.1, -3.0), pole(-0.1, 3.0)],
                "transfer_error": None,
                "shapes": 1.0,
                "frequencies": [1.0, 2.0],
                "response": [[[1.0]] * coordinates, [[2.0]] * coordinates],
                "taylor_response": [[[1.0]] * coordinates, [[2.0]] * coordinates],
            }
        ],
    }


def case(name: str, file: str, engine: str, scenario: str, coordinates: int) -> dict[str, Any]:
    seed = [ord(c) for c in name + file + engine + scenario]
    return {
        "system": name,
        "folder": f"/models/{name}",
        "model": file,
        "engine": engine,
        "scenario": scenario,
        "outcome": "AGREES",
        "discrepancy": 7.1e-14,
        "uncertainty": 1.02e-12,
        "component": "q0",
        "time": 1.1,
        "order": 1.002,
        "claimed_order": 1,
        "integrator": "euler",
        "shipped_step": 0.002,
        "raw_error": 0.00911,
        "raw_order": 1.001,
        "reason": "",
        "steps": 48185,
        "rungs": list(RUNGS),
        "apart": {
            "amplitude": -0.029,
            "phase": -0.068,
            "frequency": 4.6e-4,
            "damping": 2.3e-4,
            "explained": 0.97,
        },
        "steps_for": [{"target": 0.01, "step": 0.0021}, {"target": 0.001, "step": None}],
        "checked_step": {"target": 0.01, "step": 0.0021, "measured": 0.00957},
        "energy_error": 0.0068,
        "constraint_drift": 0.0,
        "seconds": 0.8,
        "series": series(np.random.default_rng(seed), coordinates),
    }


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
            "rungs": list(RUNGS),
            "h": rounded(h, 6),
            "raw": rounded(0.3 * h, 4),
            "draws": rounded(10.0 ** -np.arange(1.0, len(RUNGS)), 4),
        },
        "plain": {
            "h": [0.002, 0.001],
            "error": [0.0091, 0.0045],
            "seconds": [0.11, 0.23],
        },
        "energy": {
            "held": rounded(np.sin(t), 5),
            "supplied": rounded(np.sin(t) + 0.01, 5),
            "dissipated": rounded(0.01 * t, 5),
        },
    }


def results(systems: int = 2) -> dict[str, Any]:
    """All cases agree; systems of one coordinate and of two in turn."""
    sizes = {f"system_{i}": 1 + i % 2 for i in range(systems)}
    runs = [(name, *pair) for name in sizes for pair in ENGINES]
    return {
        "schema": 1,
        "created": "2026-11-21T02:19:33+00:00",
        "resolution": 1e-9,
        "seconds": 37.4,
        "versions": {
            "physics-crosscheck": "0.1.0",
            "python": "3.11.7",
            "mujoco": "4.0.0",
            "pybullet": None,
        },
        "systems": [system(name, size) for name, size in sizes.items()],
        "models": [model(*run, sizes[run[0]]) for run in runs],
        "cases": [case(*run, s, sizes[run[0]]) for run in runs for s in SCENARIOS],
    }


def unjudged(case: dict[str, Any], outcome: str, reason: str, **more: str) -> dict[str, Any]:
    """A case that was not run, as `harness.run` records it."""
    place = {k: case[k] for k in ("system", "folder", "model", "engine", "scenario")}
    nothing = dict.fromkeys(("discrepancy", "uncertainty", "order", "shipped_step", "raw_error"))
    rest = {"component": "", "seconds": 0.0, "series": None, "outcome": outcome, "reason": reason}
    return place | nothing | rest | more


def diagnosis(case: dict[str, Any]) -> dict[str, Any]:
    """A literal with its line, a constant that is tied with it, and what they leave."""
    series = case["series"]
    segment_t = np.linspace(0.2, 11.8, 24)
    size = len(series["components"])

    def finding(cause: str, kind: str, remaining: float, tied: str, where: str) -> dict[str, Any]:
        return {
            "cause": cause,
            "kind": kind,
            "nominal": [38.25],
            "estimate": [39.5],
            "standard_error": [1e-9],
            "remaining": remaining,
            "tied_with": [tied],
            "where": [where],
        }

    return {
        "explained": True,
        "floor": 1e-9,
        "seconds": 2.0,
        "findings": [
            finding("joint[x]@stiffness", "literal", 1e-10, "k", f"{case['model']}:21"),
            finding("k", "constant", 1.1e-10, "joint[x]@stiffness", ""),
            finding("mass", "constant", 0.4, "", ""),
        ],
        "redrawn": {
            "cause": "k",
            "estimate": [39.5],
            "what": "equations",
            "scenarios": [
                {
                    "scenario": case["scenario"],
                    "t": series["t"],
                    "redrawn": series["engine"],
                    "segment_t": rounded(segment_t, 6),
                    "before": [[3.1e-6] * 24] * size,
                    "after": [[2e-14] * 24] * size,
                }
            ],
        },
    }


def mixed() -> dict[str, Any]:
    """One case of each outcome, one blown up, and a folder that could not be read."""
    found = copy.deepcopy(results())
    cases = found["cases"]
    cases[0] |= {"outcome": "DIFFERS", "discrepancy": 3.1e-6, "reason": "q0 ends 3.1e-06 off"}
    found["models"][0]["diagnosis"] = diagnosis(cases[0])
    found["models"][0]["audit"] = [
        {
            "kind": "literal",
            "message": "joint[x]@stiffness is 39.5 where k = 38.25",
            "where": "/models/system_0/mujoco.xml:21",
            "expected": 38.25,
            "found": 39.5,
            "severity": "finding",
        }
    ]
    found["baseline"] = {
        "name": "baseline.json",
        "changes": [
            {k: cases[0][k] for k in ("system", "model", "engine", "scenario")}
            | {"kind": "regression", "message": "it agreed to 11.9 digits"}
        ],
    }
    cases[5]["accepted"] = "the vendor knows"
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
    # A system without a sketch, as an older run recorded it.
    del found["systems"][1]["sketch"]
    return found
