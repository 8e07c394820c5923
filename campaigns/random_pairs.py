"""Pairs of wrong literals, by 1e-4 and 1e-2: does the diagnosis name both?

`python -m campaigns.random_pairs --count 100 --seed 1`
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from campaigns.random_draws import pairings
from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.mutation.survey import system_faults
from physics_crosscheck.harness.diagnosis.task import ranked
from physics_crosscheck.harness.diagnosis.trial import scratch
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.cause import CauseId

SMALL, LARGE = 1e-4, 1e-2
VISIBLE = 1e-8
"""Relative change that must show in a motion; the campaign skips other literals."""


@dataclass(frozen=True, kw_only=True)
class PairTrial:
    """The diagnosis of a pair; `seconds` is processor time."""

    what: str
    faults: tuple[str, str]
    named: bool
    explained: bool
    causes: tuple[CauseId, ...]
    tied: tuple[CauseId, ...]
    remaining: float
    seconds: float


@cache
def prepared(folder: Path) -> PreparedSystem:
    """Return the solved system of a folder."""
    return prepare_system(folder)


def pair(folder: Path, sidecar: Sidecar, engine: str, rng: np.random.Generator) -> PairTrial | None:
    """Diagnose two wrong literals; return None without two, or if the engine refuses the model."""
    physics = prepared(folder)
    planted = system_faults(model_task(physics, engine, sidecar))
    seen = {one.mistake.location: one.first_seen for one in planted if one.values is not None}
    visible = [
        b for b in bindings(physics.system, sidecar) if (seen.get(b.address) or np.inf) < VISIBLE
    ]
    if len(visible) < 2:
        return None
    small, large = (visible[i] for i in rng.permutation(len(visible))[:2])
    wrong = {
        b.address: b.value * (1 + size * rng.choice((-1, 1)))
        for b, size in ((small, SMALL), (large, LARGE))
    }
    with scratch() as into:
        copy = with_literals(sidecar, wrong, into)
        began = time.process_time()
        try:
            ranking = ranked(model_task(physics, engine, copy))
        except EngineError:
            return None
        seconds = time.process_time() - began
    first = ranking.fits[0]
    faults = {CauseId(kind="literal", subject=(b.address,)) for b in (small, large)}
    return PairTrial(
        what=f"{folder.name}/{sidecar.model.name} [{engine}]",
        faults=(small.address, large.address),
        named=len(first.causes) == 2 and faults <= {*first.causes, *first.tied_with},
        explained=ranking.explained,
        causes=first.causes,
        tied=first.tied_with,
        remaining=first.remaining,
        seconds=seconds,
    )


def campaign(count: int, seed: int) -> list[PairTrial]:
    """Diagnose `count` pairs, over all systems and pairings in turn."""
    rng = np.random.default_rng(seed)
    every = pairings()
    trials: list[PairTrial] = []
    index = 0
    while len(trials) < count:
        trial = pair(*every[index % len(every)], rng)
        index += 1
        if trial is not None:
            trials.append(trial)
    return trials


def main() -> None:
    """Print the pairs that are not named, and the share of those that are."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=100, help="pairs [100]")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    trials = campaign(options.count, options.seed)
    for t in trials:
        if not t.named:
            print(
                t.what, *t.faults, "->", *t.causes, "tied", *t.tied, f"residual {t.remaining:.1e}"
            )
    named = sum(t.named and t.explained for t in trials)
    median = float(np.median([t.seconds for t in trials]))
    print(f"{named} of {len(trials)} named, median processor time of a diagnosis {median:.2f} s")


if __name__ == "__main__":
    main()
