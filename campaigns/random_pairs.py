"""Two literals wrong at once, one by 1e-4 and one by 1e-2: are both named?

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
from physics_crosscheck.harness.commands.mutation.survey import survey
from physics_crosscheck.harness.diagnosis.task import ranked
from physics_crosscheck.harness.diagnosis.trial import scratch
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.bindings import bindings, with_literals
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.cause import CauseId

SMALL, LARGE = 1e-4, 1e-2
VISIBLE = 1e-8
"""A literal is drawn if a fault of this share would be seen: others, no motion can tell."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What became of one pair; `seconds` is processor time."""

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
    return prepare_system(folder)


def pair(folder: Path, sidecar: Sidecar, engine: str, rng: np.random.Generator) -> Trial | None:
    """Draw two literals that motions depend on; None where the engine refuses the model."""
    physics = prepared(folder)
    found = survey(model_task(physics, engine, sidecar))
    seen = [
        b
        for b, first in zip(bindings(physics.system, sidecar), found.first_caught, strict=True)
        if first < VISIBLE
    ]
    if len(seen) < 2:
        return None
    small, large = (seen[i] for i in rng.permutation(len(seen))[:2])
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
    return Trial(
        what=f"{folder.name}/{sidecar.model.name} [{engine}]",
        faults=(small.address, large.address),
        named=len(first.causes) == 2 and faults <= {*first.causes, *first.tied_with},
        explained=ranking.explained,
        causes=first.causes,
        tied=first.tied_with,
        remaining=first.remaining,
        seconds=seconds,
    )


def campaign(count: int, seed: int) -> list[Trial]:
    """So many pairs, over all systems and pairings in turn."""
    rng = np.random.default_rng(seed)
    every = pairings()
    trials: list[Trial] = []
    index = 0
    while len(trials) < count:
        trial = pair(*every[index % len(every)], rng)
        index += 1
        if trial is not None:
            trials.append(trial)
    return trials


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    trials = campaign(options.count, options.seed)
    for t in trials:
        if not t.named:
            print(t.what, *t.faults, "->", *t.causes, "tied", *t.tied, f"left {t.remaining:.1e}")
    named = sum(t.named and t.explained for t in trials)
    median = float(np.median([t.seconds for t in trials]))
    print(f"{named} of {len(trials)} named, median {median:.2f} s of processor time a diagnosis")


if __name__ == "__main__":
    main()
