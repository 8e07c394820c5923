"""Run cases of a sweep in a worker: the verdict, and the error at the time step.

A sweep omits these parts of a run: other full runs, series, linearizations, audit and coverage.
"""

import tempfile
import time
from functools import lru_cache
from pathlib import Path

from physics_crosscheck.harness.documents.errors import original_paths
from physics_crosscheck.harness.jobs.failure import failure_of
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.assemble import MultibodySystem
from .planned import Block, CaseRecord, Planned, Source
from .system import Swept
from .trees import SweptTree


@lru_cache(maxsize=16)
def swept(folder: str, varied: frozenset[str], content: str) -> Source:
    """Prepare a folder or a robot file once per process.

    Args:
        folder: folder of the system, or the file.
        varied: names of the varied constants.
        content: hash of its content, so that a long-lived worker uses no outdated copy.

    Raises:
        DeclarationError, SidecarError, RobotError: naming what is wrong and where.
    """
    return _loaded(folder, content).varying(varied)


@lru_cache(maxsize=16)
def _loaded(folder: str, content: str) -> Source:
    del content  # changed content requires a new source
    path = Path(folder)
    if path.is_file() or isinstance(load_declaration(path), MultibodySystem):
        return SweptTree(path)
    return Swept(path)


def run_block(block: Block) -> tuple[SweepRow, ...]:
    """Run some cases; one that can't run is FAILED, with its reason."""
    source = swept(block.folder, block.varied, block.content)
    # Prepare shared data first, so that no row's time includes it.
    for example_case in {(case.row.model, case.row.engine): case for case in block.cases}:
        source.prepare(*example_case)
    return tuple(_row(source, block, case) for case in block.cases)


def _row(source: Source, block: Block, case: Planned) -> SweepRow:
    began = time.process_time()
    record = CaseRecord(case.row)
    with tempfile.TemporaryDirectory(prefix="drawn-") as place:
        try:
            source.run(case, block, Path(place), record)
        except Exception as error:
            failure = failure_of(error, _error_text(error))
            record.update(outcome=Outcome.FAILED, reason=failure.reason, kind=failure.kind)
    record.update(seconds=time.process_time() - began)
    named = Path(block.folder)
    folder = named.parent if named.is_file() else named
    record.update(reason=original_paths(record.row.reason, Path(place), folder))
    return record.row


def _error_text(error: Exception) -> str:
    ours = type(error).__module__.startswith("physics_crosscheck.")
    message = " ".join(str(error).split())
    return message if ours and message else f"{type(error).__name__}: {message}"
