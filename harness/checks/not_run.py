"""Records of cases that could not run, with their reasons."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import asdict, replace

from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.engines.registry import install_command
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.case import Case, CaseId, CaseKind
from physics_crosscheck.harness.records.outcome import Outcome


@dataclass(frozen=True)
class CannotRun:
    """A reason why a model cannot run in an engine: ABSENT, or FAILED with a kind."""

    outcome: Outcome
    reason: str
    kind: CaseKind


def cannot_run(
    adapters: Mapping[str, Engine], name: str, model: Sidecar | Path
) -> CannotRun | None:
    """Return why a model can't run in an engine; None if it can.

    Args:
        adapters: all engines.
        name: name of the engine.
        model: the sidecar, which may name any engine; or a robot file.
    """
    if isinstance(model, Path):
        return absent(adapters[name])
    sidecar, engine = model, adapters.get(name)
    if engine is None:
        names = ", ".join(sorted(adapters))
        return CannotRun(
            Outcome.FAILED,
            f"{sidecar.model}.toml: unknown engine {name!r}; known engines: {names}",
            "engine",
        )
    if why := absent(engine):
        return why
    if sidecar.model.suffix not in engine.formats:
        reads = ", ".join(engine.formats)
        reason = f"{sidecar.model}: {name} reads only {reads} files"
        return CannotRun(Outcome.FAILED, reason, "format")
    return None


def absent(engine: Engine) -> CannotRun | None:
    """Return the reason if an engine is not installed, otherwise None."""
    if engine.version() is None:
        return CannotRun(
            Outcome.ABSENT, f"{engine.name} is not installed; {install_command(engine)}", ""
        )
    return None


def skipped_case(case_id: CaseId, folder: str, why: CannotRun) -> Case:
    """Build the record of a case that was not started."""
    return replace(_case(case_id, folder, why.outcome, why.reason, ""), kind=why.kind)


def failed_case(case_id: CaseId, folder: str, failure: Failure) -> Case:
    """Return the record of a case that could not run, or that stands for a whole model or target.

    Args:
        case_id: the case.
        folder: the system folder, or the robot file.
        failure: the reason.
    """
    file = Path(folder) if Path(folder).name == case_id.model else Path(folder) / case_id.model
    reason = failure.about(file)
    case = _case(case_id, folder, Outcome.FAILED, reason, failure.stdout)
    return replace(case, locations=failure.locations, kind=failure.kind)


def _case(case_id: CaseId, folder: str, outcome: Outcome, reason: str, stdout: str) -> Case:
    return Case(**asdict(case_id), folder=folder, outcome=outcome, reason=reason, stdout=stdout)


def not_of_a_tree(sidecar: Sidecar) -> str:
    """Return why a sidecar does not fit declared bodies, in a sentence; "" if it fits."""
    given = {
        "coordinates": sidecar.coordinates, "readback": sidecar.readback,
        "bindings": sidecar.bindings, "frames": sidecar.frames,
    }  # fmt: skip
    unread = [f"[{key}]" for key, value in given.items() if value]
    if not unread:
        return ""
    return (
        f"{sidecar.model}.toml: {', '.join(unread)}: system.py declares bodies, "
        "whose joints are matched by name only; remove "
        f"{('it' if len(unread) == 1 else 'them')}"
    )
