"""The way of the data, once through: folders -> reference -> engines -> verdicts -> results.

system.py --prepare--> reference motions --+
                                           +--run_case--> verdicts --> results
model files and sidecars --plan--> tasks --+
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from harness.audit.run import run_audit
from harness.audit.task import audit_task
from harness.baseline.known import accepted, mark_known, since
from harness.baseline.measure import measure, measure_task
from harness.baseline.snapshot import Snapshot
from harness.cases.case import LinearizationTask, case_task, run_case, run_linearizations
from harness.cases.prepare import Prepared, prepare
from harness.diagnosis.task import DiagnosisTask, diagnose_model, diagnosis_task
from harness.engines.protocol import Engine
from harness.engines.registry import engines, readers
from harness.files.sidecar import Sidecar, SidecarError, read_sidecar
from harness.records.outcome import Outcome
from harness.records.results import results
from harness.schedule.workers import LIMIT, Failure, Workers
from harness.text.table import case_id

Record = dict[str, Any]
Progress = Callable[[int, int, Record | None], None]
"""Called with (cases done, cases known, the case just done or None)."""


@dataclass(frozen=True)
class Selection:
    """What a gate wants of a run: some models, verdicts alone, and what each case's model does.

    Attributes:
        models: (folder, model file, engine) of those to run.
        tracks: accepted tracks, by case id.
        diagnose: whether models that differ are diagnosed.
    """

    models: frozenset[tuple[str, str, str]]
    tracks: Mapping[str, Snapshot] = field(default_factory=dict)
    diagnose: bool = False


@dataclass(frozen=True)
class Options:
    """What `crosscheck run` may be told; `baseline` is where known differences are looked up."""

    engines: tuple[str, ...] = ()
    resolution: float = 1e-9
    jobs: int = 0
    limit: float = LIMIT
    baseline: Path | None = None
    selection: Selection | None = None


@dataclass(frozen=True)
class _Inquiry:
    """What a diagnosis would need, should one of a model's scenarios differ."""

    task: DiagnosisTask
    record: Record
    scenarios: int


def run(folders: Sequence[Path], options: Options, progress: Progress) -> Record:
    """Run every model of every folder in every scenario; returns the results.

    A folder, model or case that can't be run is FAILED, with its reason; the others go on.
    """
    began = time.perf_counter()
    known = engines()
    cases: list[Record] = []
    models: list[Record] = []
    systems: list[Record] = []
    total = 0
    inquiries: dict[tuple[str, str, str], _Inquiry] = {}
    before = None
    if options.selection is None:
        before = accepted(options.baseline, folders, options.resolution, options.engines)
    tracks = {} if before is None else before.tracks
    preparing = partial(prepare, described=options.selection is None)
    with Workers(options.jobs or os.cpu_count() or 1, options.limit) as workers:
        waiting: dict[Future[Any], Record | Path] = {
            workers.submit(preparing, folder): folder for folder in folders
        }
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                about, value = waiting.pop(future), workers.outcome(future)
                finished: list[Record] = []
                if isinstance(about, Path):
                    if isinstance(value, Failure):
                        finished = [_unprepared(about, value)]
                    else:
                        systems.append({**value.record, "folder": str(value.folder)})
                        finished, started = _plan(
                            value, known, options, workers, models, inquiries, tracks
                        )
                        waiting |= started
                        total += len(_cases(started))
                    total += len(finished)
                elif isinstance(value, Failure):
                    if "scenario" in about:
                        about.update(failed(value))
                        finished = [about]
                    elif "diagnosing" in about:
                        about["diagnosing"]["diagnosis"] = {"reason": value.reason}
                    elif "auditing" in about:
                        about["auditing"]["audit"] = []
                    elif "measuring" in about:
                        about["measuring"]["measured"] = {"failed": value.reason}
                    else:
                        about |= {"linearization": [], "reason": value.reason}
                elif "scenario" in about:
                    about.update(value)
                    finished = [about]
                elif "measuring" in about:
                    about["measuring"]["measured"] = value
                elif "diagnosing" in about:
                    about["diagnosing"]["diagnosis"] = value
                elif "auditing" in about:
                    about["auditing"]["audit"] = value
                else:
                    about["linearization"] = value
                for case in finished:
                    cases.append(case)
                    progress(len(cases), total, case)
                    waiting |= _diagnose(case, cases, inquiries, workers)
    mark_known(cases, before)
    changed = since(cases, before)
    if options.selection is None:
        for case in cases:
            case.pop("measured", None)
    order = {str(folder): i for i, folder in enumerate(folders)}
    cases.sort(key=lambda c: (order[c["folder"]], c["model"], c["engine"], c["place"]))
    return results(
        systems=sorted(systems, key=lambda s: order[s["folder"]]),
        models=sorted(models, key=lambda m: (order[m["folder"]], m["model"], m["engine"])),
        cases=cases,
        engines={name: engine.version() for name, engine in known.items()},
        resolution=options.resolution,
        seconds=time.perf_counter() - began,
        baseline=changed,
    )


def _cases(started: dict[Future[Any], Record | Path]) -> list[Record]:
    return [r for r in started.values() if isinstance(r, dict) and "scenario" in r]


def _plan(
    prepared: Prepared,
    known: dict[str, Engine],
    options: Options,
    workers: Workers,
    models: list[Record],
    inquiries: dict[tuple[str, str, str], _Inquiry],
    tracks: Mapping[str, Snapshot],
) -> tuple[list[Record], dict[Future[Any], Record | Path]]:
    """Start every case of a folder; returns those that can't be started, and the started ones."""
    ended: list[Record] = []
    started: dict[Future[Any], Record | Path] = {}
    for found in model_files(prepared.folder):
        if isinstance(found, dict):
            ended.append(found | {"system": prepared.system.name, "folder": str(prepared.folder)})
            continue
        for name in found.engines:
            if options.engines and name not in options.engines:
                continue
            selection = options.selection
            wanted = (str(prepared.folder), found.model.name, name)
            if selection is not None and wanted not in selection.models:
                continue
            model = {
                "system": prepared.system.name,
                "folder": str(prepared.folder),
                "model": found.model.name,
                "engine": name,
            }
            barred = hurdle(known, name, found)
            for place, scenario in enumerate(prepared.system.scenarios):
                case = model | {"scenario": scenario.name, "place": place}
                if barred is not None:
                    ended.append(case | barred)
                    continue
                task = case_task(prepared, found, name, scenario.name, options.resolution)
                started[workers.submit(run_case, task)] = case
                if selection is not None or case_id(case) in tracks:
                    of = (tracks if selection is None else selection.tracks).get(case_id(case))
                    measuring = measure_task(task, prepared.variants, of)
                    started[workers.submit(measure, measuring)] = {"measuring": case}
            if barred is None:
                models.append(model | texts(found))
                models[-1] |= {"linearization": []}
                if selection is None:
                    twins = LinearizationTask(
                        prepared.system,
                        found,
                        name,
                        prepared.equilibria,
                        prepared.amplitude,
                        prepared.push,
                    )
                    started[workers.submit(run_linearizations, twins)] = models[-1]
                    audit = workers.submit(run_audit, audit_task(prepared, found, name))
                    started[audit] = {"auditing": models[-1]}
                if selection is not None and not selection.diagnose:
                    continue
                inquiries[_key(model)] = _Inquiry(
                    diagnosis_task(prepared, found, name),
                    models[-1],
                    len(prepared.system.scenarios),
                )
    return ended, started


def texts(sidecar: Sidecar) -> Record:
    """A model file and its sidecar, as they are run."""
    files = {
        "text": sidecar.model,
        "sidecar": sidecar.model.with_name(f"{sidecar.model.name}.toml"),
    }
    return {name: path.read_text("utf-8", errors="replace") for name, path in files.items()}


def _key(record: Record) -> tuple[str, str, str]:
    return record["folder"], record["model"], record["engine"]


def _diagnose(
    case: Record,
    cases: list[Record],
    inquiries: dict[tuple[str, str, str], _Inquiry],
    workers: Workers,
) -> dict[Future[Any], Record | Path]:
    """Start the diagnosis of a model once its last case is in and one of them differs."""
    inquiry = inquiries.get(_key(case))
    if inquiry is None:
        return {}
    mine = [c for c in cases if _key(c) == _key(case)]
    differs = any(c["outcome"] == Outcome.DIFFERS for c in mine)
    if len(mine) < inquiry.scenarios or not differs:
        return {}
    return {workers.submit(diagnose_model, inquiry.task): {"diagnosing": inquiry.record}}


def audits(folders: Sequence[Path], options: Options) -> list[Record]:
    """Audit every model of the folders, without running a motion.

    A record has system, model, engine, `audit` (its findings) and `failed` (why there are none).
    """
    records: list[Record] = []
    with Workers(options.jobs or os.cpu_count() or 1, options.limit) as workers:
        prepared = [(folder, workers.submit(prepare, folder)) for folder in folders]
        pending: list[tuple[Record, Future[Any]]] = []
        for folder, future in prepared:
            value = workers.outcome(future)
            if isinstance(value, Failure):
                where = {"system": folder.name, "model": "system.py", "engine": "-"}
                records.append(where | {"failed": value.reason, "audit": []})
                continue
            for found in model_files(folder):
                if isinstance(found, dict):
                    where = {"system": folder.name, "model": found["model"], "engine": "-"}
                    records.append(where | {"failed": found["reason"], "audit": []})
                    continue
                for name in found.engines:
                    if not options.engines or name in options.engines:
                        where = {
                            "system": value.system.name,
                            "model": found.model.name,
                            "engine": name,
                        }
                        task = audit_task(value, found, name)
                        pending.append((where, workers.submit(run_audit, task)))
        for where, future in pending:
            value = workers.outcome(future)
            failed = value.reason if isinstance(value, Failure) else ""
            records.append(where | {"failed": failed, "audit": [] if failed else value})
    return records


def model_files(folder: Path) -> Iterator[Sidecar | Record]:
    """Every model file's sidecar; a record of failure for one that can't be read or has none."""
    described = set()
    for path in sorted(folder.glob("*.toml")):
        described.add(path.with_suffix("").name)
        try:
            yield read_sidecar(path)
        except SidecarError as error:
            yield _not_run(path.with_suffix("").name, str(error))
    for path in sorted(folder.iterdir()):
        if path.suffix in (".xml", ".urdf") and path.name not in described:
            yield _not_run(
                path.name,
                f"{path}: this model file has no sidecar; write {path.name}.toml with at least"
                f" engines = {json.dumps([e.name for e in readers(path.suffix)])}"
                " (or the engines meant)",
            )
    if not described:
        yield _not_run("-", f"{folder}: it has no model file with a sidecar, so nothing was run")


def hurdle(known: dict[str, Engine], name: str, sidecar: Sidecar) -> Record | None:
    """Why a model can't be run in an engine, as the fields of its cases; None where it can."""
    engine = known.get(name)
    if engine is None:
        names = ", ".join(sorted(known))
        reason = f"{sidecar.model}.toml: no engine {name!r} is known; known are {names}"
        return failed(Failure(reason, ""))
    if engine.version() is None:
        return _empty() | {"outcome": str(Outcome.ABSENT), "reason": f"{name} is not installed"}
    if sidecar.model.suffix not in engine.formats:
        reads = ", ".join(engine.formats)
        return failed(Failure(f"{sidecar.model}: {name} reads {reads} files alone", ""))
    return None


def _unprepared(folder: Path, failure: Failure) -> Record:
    return _not_run("system.py", failure.reason) | {
        "system": folder.name,
        "folder": str(folder),
        "printed": failure.stdout,
    }


def _not_run(model: str, reason: str) -> Record:
    case = {"model": model, "engine": "-", "scenario": "-", "place": 0}
    return case | failed(Failure(reason, ""))


def failed(failure: Failure) -> Record:
    """The fields of a case that could not be run."""
    return _empty() | {
        "outcome": str(Outcome.FAILED),
        "reason": failure.reason,
        "printed": failure.stdout,
    }


def _empty() -> Record:
    """The fields of a case that was not judged."""
    numbers = ("discrepancy", "uncertainty", "order", "shipped_step", "raw_error")
    return dict.fromkeys(numbers) | {"component": "", "seconds": 0.0, "series": None}
