"""The way of the data, once through: folders -> reference -> engines -> verdicts -> results.

system.py --prepare--> reference motions --+
                                           +--run_case--> verdicts --> results
model files and sidecars --plan--> tasks --+
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harness.audit import audit_task, run_audit
from harness.case import CaseTask, TwinTask, run_case, run_twins
from harness.engine import Engine
from harness.engines import engines
from harness.inquiry import InquiryTask, inquire
from harness.prepare import Prepared, prepare
from harness.results import results
from harness.sidecar import Sidecar, SidecarError, read_sidecar
from harness.verdict import Outcome
from harness.workers import LIMIT, Failure, Workers

Record = dict[str, Any]
Progress = Callable[[int, int, Record | None], None]
"""Called with (cases done, cases known, the case just done or None)."""


@dataclass(frozen=True)
class Options:
    """What `crosscheck run` may be told."""

    engines: tuple[str, ...] = ()
    resolution: float = 1e-9
    jobs: int = 0
    limit: float = LIMIT


@dataclass(frozen=True)
class _Inquiry:
    """What a diagnosis would need, should one of a model's scenarios differ."""

    task: InquiryTask
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
    with Workers(options.jobs or os.cpu_count() or 1, options.limit) as workers:
        waiting: dict[Future[Any], Record | Path] = {
            workers.submit(prepare, folder): folder for folder in folders
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
                        finished, started = _plan(value, known, options, workers, models, inquiries)
                        waiting |= started
                        total += len(_cases(started))
                    total += len(finished)
                elif isinstance(value, Failure):
                    if "scenario" in about:
                        finished = [about | _failed(value)]
                    elif "diagnosing" in about:
                        about["diagnosing"]["diagnosis"] = {"reason": value.reason}
                    elif "auditing" in about:
                        about["auditing"]["audit"] = []
                    else:
                        about |= {"linearization": [], "reason": value.reason}
                elif "scenario" in about:
                    finished = [about | value]
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
    order = {str(folder): i for i, folder in enumerate(folders)}
    cases.sort(key=lambda c: (order[c["folder"]], c["model"], c["engine"], c["place"]))
    return results(
        systems=sorted(systems, key=lambda s: order[s["folder"]]),
        models=sorted(models, key=lambda m: (order[m["folder"]], m["model"], m["engine"])),
        cases=cases,
        engines={name: engine.version() for name, engine in known.items()},
        resolution=options.resolution,
        seconds=time.perf_counter() - began,
    )


def _cases(started: dict[Future[Any], Record | Path]) -> list[Record]:
    return [r for r in started.values() if isinstance(r, dict) and "scenario" in r]


def _plan(
    prepared: Prepared, known: dict[str, Engine], options: Options, workers: Workers,
    models: list[Record], inquiries: dict[tuple[str, str, str], _Inquiry],
) -> tuple[list[Record], dict[Future[Any], Record | Path]]:  # fmt: skip
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
            model = {
                "system": prepared.system.name, "folder": str(prepared.folder),
                "model": found.model.name, "engine": name,
            }  # fmt: skip
            hurdle = _hurdle(known, name, found)
            for place, scenario in enumerate(prepared.system.scenarios):
                case = model | {"scenario": scenario.name, "place": place}
                if hurdle is not None:
                    ended.append(case | hurdle)
                    continue
                task = CaseTask(
                    prepared.system, found, name, scenario.name, prepared.motions[scenario.name],
                    prepared.scales[scenario.name], prepared.amplitude, prepared.power,
                    prepared.components, options.resolution,
                )  # fmt: skip
                started[workers.submit(run_case, task)] = case
            if hurdle is None:
                twins = TwinTask(
                    prepared.system, found, name, prepared.equilibria, prepared.amplitude,
                    prepared.push,
                )  # fmt: skip
                models.append(model | texts(found))
                started[workers.submit(run_twins, twins)] = models[-1]
                audit = workers.submit(run_audit, audit_task(prepared, found, name))
                started[audit] = {"auditing": models[-1]}
                inquiry = InquiryTask(
                    prepared.system, found, name, prepared.motions, prepared.scales,
                    prepared.variants,
                )  # fmt: skip
                inquiries[_key(model)] = _Inquiry(
                    inquiry, models[-1], len(prepared.system.scenarios)
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
    case: Record, cases: list[Record], inquiries: dict[tuple[str, str, str], _Inquiry],
    workers: Workers,
) -> dict[Future[Any], Record | Path]:  # fmt: skip
    """Start the diagnosis of a model once its last case is in and one of them differs."""
    inquiry = inquiries.get(_key(case))
    if inquiry is None:
        return {}
    mine = [c for c in cases if _key(c) == _key(case)]
    differs = any(c["outcome"] == Outcome.DIFFERS for c in mine)
    if len(mine) < inquiry.scenarios or not differs:
        return {}
    return {workers.submit(inquire, inquiry.task): {"diagnosing": inquiry.record}}


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
                            "system": value.system.name, "model": found.model.name, "engine": name,
                        }  # fmt: skip
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
                ' engines = ["mujoco"] (or the engines meant)',
            )
    if not described:
        yield _not_run("-", f"{folder}: it has no model file with a sidecar, so nothing was run")


def _hurdle(known: dict[str, Engine], name: str, sidecar: Sidecar) -> Record | None:
    engine = known.get(name)
    if engine is None:
        names = ", ".join(sorted(known))
        reason = f"{sidecar.model}.toml: no engine {name!r} is known; known are {names}"
        return _failed(Failure(reason, ""))
    if engine.version() is None:
        return _empty() | {"outcome": str(Outcome.ABSENT), "reason": f"{name} is not installed"}
    if sidecar.model.suffix not in engine.formats:
        reads = ", ".join(engine.formats)
        return _failed(Failure(f"{sidecar.model}: {name} reads {reads} files alone", ""))
    return None


def _unprepared(folder: Path, failure: Failure) -> Record:
    return _not_run("system.py", failure.reason) | {
        "system": folder.name, "folder": str(folder), "printed": failure.printed,
    }  # fmt: skip


def _not_run(model: str, reason: str) -> Record:
    case = {"model": model, "engine": "-", "scenario": "-", "place": 0}
    return case | _failed(Failure(reason, ""))


def _failed(failure: Failure) -> Record:
    return _empty() | {
        "outcome": str(Outcome.FAILED), "reason": failure.reason, "printed": failure.printed,
    }  # fmt: skip


def _empty() -> Record:
    """The fields of a case that was not judged."""
    numbers = ("discrepancy", "uncertainty", "order", "shipped_step", "raw_error")
    return dict.fromkeys(numbers) | {"component": "", "seconds": 0.0, "series": None}
