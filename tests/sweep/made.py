"""A folder to sweep: one small system, one scenario, models with bound literals."""

import shutil
from pathlib import Path

from physics_crosscheck.harness.extras.sweep.factors import Design, SweepOptions, factors
from physics_crosscheck.harness.extras.sweep.main import planned
from physics_crosscheck.harness.extras.sweep.plan import CasePlan
from physics_crosscheck.harness.jobs.workers import Workers
from tests.faults.known_folder import ROOT, one_scenario
from tests.standing import keep_default_engines

SYSTEM = "mass_spring_damper"


def swept_folder(place: Path, *models: str) -> Path:
    """Create the mass on a spring, released for 1 s, with some of its built-in models."""
    folder = one_scenario(SYSTEM, place, "free")
    text = (folder / "system.py").read_text()
    (folder / "system.py").write_text(text.replace("duration=14.5", "duration=1.0"))
    for model in models:
        for name in (model, f"{model}.toml"):
            shutil.copy(ROOT / "models" / SYSTEM / name, folder / name)
    keep_default_engines(folder)
    return folder


def options(
    *vary: str, count: int = 3, seed: int = 5, steps: tuple[float, ...] = ()
) -> SweepOptions:
    return SweepOptions(
        factors=factors(vary),
        design=Design.LATIN,
        count=count,
        seed=seed,
        steps=steps,
        jobs=2,
        command=("crosscheck", "sweep", "somewhere"),
    )


def plan_of(folder: Path, options: SweepOptions, workers: Workers) -> CasePlan:
    return planned(options, [folder], workers)
