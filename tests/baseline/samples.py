"""Sample baseline of a system with one case, and sample measurements of it."""

from typing import Any

import msgspec

from physics_crosscheck.harness.baseline.classify import summarized
from physics_crosscheck.harness.baseline.file import SystemBaseline, snapshot_key
from physics_crosscheck.harness.records.baseline import (
    AcceptedCase,
    AcceptedDeclaration,
    Identified,
    Measurement,
    OnAccepted,
    Snapshot,
)
from physics_crosscheck.records import Case, Outcome
from tests.records import made

SYSTEM = "spring"
NUMERICS = 7
FILES = {
    "m.xml": "0123456789abcdef",
    "m.xml.toml": "0011223344556677",
    "system.py": "8899aabbccddeeff",
}
ENDS = ((0.25, -0.5), (0.125, 1.0), (-0.2, 0.75))
UNCERTAIN = ((1e-13, 1e-12),) * 3

SNAPSHOT = Snapshot(
    scenario="free",
    components=("x", "x_dot"),
    duration=4.0,
    inputs=("f = 0",),
    fastest=6.0,
    varying=False,
    t=(0.0, 1.0, 2.0),
    length=(0.1, 0.1, 0.1),
    start=((0.3, 0.0), (0.2, 0.5), (-0.1, 1.0)),
    input_nodes=(((0.0,),),) * 3,
    end=ENDS,
    scale=(0.25, 1.5),
)

ENTRY = summarized(
    AcceptedCase(
        system=SYSTEM, model="m.xml", scenario="free", engine="e", summary="",
        reason="first baseline", outcome=Outcome.AGREES, outcome_reason="", discrepancy=5e-14,
        uncertainty=1e-12, component="x_dot",
        constants={"k": Identified(value=47.0, standard_error=1e-9)}, global_error=0.005,
        global_order=1.0, time_step=0.002, integrator="euler", order=1.0, claimed_order=1,
        engine_version="e 1.0", resolution=1e-9, numerics=NUMERICS, files=FILES,
        snapshot=snapshot_key(SNAPSHOT), end=ENDS, end_uncertainty=UNCERTAIN,
    )
)  # fmt: skip

DECLARED = AcceptedDeclaration(
    system=SYSTEM,
    folder="../../models/spring",
    declared="00112233aabbccdd",
    scenarios=("free",),
    constants={"k": 47.0, "m": 1.3},
)


def entry(**fields: Any) -> AcceptedCase:
    return msgspec.structs.replace(ENTRY, **fields)


def baseline(*entries: AcceptedCase) -> SystemBaseline:
    """Build a baseline of some entries, by default of the sample entry."""
    chosen = entries or (ENTRY,)
    return SystemBaseline(
        declared=DECLARED,
        snapshots={snapshot_key(SNAPSHOT): SNAPSHOT},
        cases={each.id: each for each in chosen},
    )


def measurement(move: float = 0.0, equations: float = 0.0) -> Measurement:
    """Build a measurement with model and equations moved in x, relative to its scale."""
    return Measurement(
        snapshot=SNAPSHOT,
        end=ENDS,
        uncertainty=UNCERTAIN,
        constants=ENTRY.constants,
        on_accepted=OnAccepted(
            end=_moved(move), uncertainty=UNCERTAIN, equations=_moved(equations)
        ),
    )


def _moved(share: float) -> tuple[tuple[float, ...], ...]:
    return tuple((x + share * SNAPSHOT.scale[0], v) for x, v in ENDS)


def case(outcome: Outcome = Outcome.AGREES, **fields: Any) -> Case:
    discrepancy = fields.pop("discrepancy", ENTRY.discrepancy)
    verdict = made.verdict(
        discrepancy=discrepancy, uncertainty=ENTRY.uncertainty, component="x_dot", order=1.0,
        largest_discrepancy=ENTRY.discrepancy, largest_uncertainty=ENTRY.uncertainty,
    )  # fmt: skip
    error = fields.pop("global_error", ENTRY.global_error)
    full_run = made.full_run(integrator="euler", global_error=error)
    names = {"system": SYSTEM, "model": "m.xml", "engine": "e", "folder": "models/spring"}
    return made.case(outcome, **{"verdict": verdict, "full_run": full_run, **names, **fields})
