"""A system folder from a model file: read, planned, written, and checked in every engine."""

from __future__ import annotations

import types
from dataclasses import replace
from pathlib import Path

from harness.audit.plan import audits
from harness.engines.registry import readers
from harness.files.reading import read_regular
from harness.scaffold.assets import neighbours
from harness.scaffold.constants import Ledger, Row
from harness.scaffold.folder import NewError, write_folder
from harness.scaffold.mechanism import Mechanism
from harness.scaffold.mjcf import read_mjcf
from harness.scaffold.scenarios import plan, provisional
from harness.scaffold.text import sidecar_text, system_text
from harness.scaffold.urdf import read_urdf
from harness.text.visible import odd_name, visible
from reference.system import System

_FORMATS = (".urdf", ".xml")
GRAVITY = 9.81
STEP = 0.002


def from_model(model: Path, target: Path) -> tuple[str, ...]:
    """Write the folder of a model file; returns what there is to say about it.

    Nothing is written where what was read is not what any engine makes of the file.

    Raises:
        NewError: naming file, line and what can't be read.
    """
    if model.suffix not in _FORMATS:
        raise NewError(f"{model}: a model file is a .urdf, or an MJCF ending with .xml")
    if (why := odd_name(model.name)) is not None:
        raise NewError(f"{visible(str(model))}: its name has {why}; rename it")
    try:
        data = read_regular(model)
    except OSError as error:
        raise NewError(f"{model}: can't be read: {error.strerror}") from None
    beside = neighbours(model, data)
    ledger = Ledger(model, data)
    mechanism = _read(model, data, ledger)
    if not mechanism.joints:
        raise NewError(f"{model}: it has no moving joint")
    mechanism = _with_symbols(mechanism, ledger)

    def text(chosen: object) -> str:
        return system_text(target.name, model.name, mechanism, ledger.rows, chosen)  # type: ignore[arg-type]  # a Plan

    system = _declared(text(provisional(mechanism.joints)), model)
    chosen = plan(system, mechanism.joints)
    sidecar = f"{model.name}.toml"
    left_out: dict[str, str] = {}
    remarks = list(mechanism.remarks)

    def sidecar_bytes() -> bytes:
        meant = [engine for engine in readers(model.suffix) if engine.name not in left_out]
        return sidecar_text(
            model.name,
            meant,
            mechanism,
            ledger,
            left_out,
            _settings(model.suffix),
        ).encode()

    def check(made: Path) -> None:
        disagree = _checked(made, target, model.suffix, left_out)
        (made / sidecar).write_bytes(sidecar_bytes())
        remarks.extend(disagree)

    files = {
        model.name: data,
        **beside,
        "system.py": text(chosen).encode(),
        sidecar: sidecar_bytes(),
    }
    write_folder(target, files, check)
    return tuple(remarks)


def _read(model: Path, data: bytes, ledger: Ledger) -> Mechanism:
    if model.suffix == ".xml":
        return read_mjcf(model, data, ledger)
    mechanism = read_urdf(model, data, ledger)
    g = ledger.name("g")
    ledger.rows.append(
        Row(
            name=g,
            value=GRAVITY,
            unit="m/s^2",
            description="gravity",
            source=f"{model.name}.toml; a URDF states none",
        )
    )
    ledger.bindings["sidecar:settings.gravity[2]"] = f"-{g}"
    return replace(mechanism, gravity=("0", "0", f"-{g}"))


def _settings(suffix: str) -> list[str]:
    """Lines of a sidecar's settings, for a format that states none."""
    if suffix != ".urdf":
        return []
    taken = [f"{e.title} would take {e.unstated}" for e in readers(suffix) if e.unstated]
    first, *others = [*taken, ""]
    rest = "".join(f", {words.replace(' would take', '')}" for words in others if words)
    return [
        f"# A URDF carries neither; {first}{rest}.",
        "[settings]",
        f"step = {STEP}",
        f"gravity = [0, 0, -{GRAVITY}]",
        "",
    ]


def _with_symbols(mechanism: Mechanism, ledger: Ledger) -> Mechanism:
    """Names for the forces and the centres, which no constant has."""
    return replace(
        mechanism,
        bodies=tuple(
            replace(
                body,
                centred=ledger.name(body.name, "centre"),
                joints=tuple(replace(j, force=ledger.name("force", j.name)) for j in body.joints),
            )
            for body in mechanism.bodies
        ),
    )


def _declared(text: str, model: Path) -> System:
    """The system that a system.py would declare."""
    module = types.ModuleType("new_system")
    try:
        exec(compile(text, "system.py", "exec"), module.__dict__)
    except (ArithmeticError, RecursionError, TypeError, ValueError) as error:
        raise NewError(f"{model}: what it says makes no mechanism: {error}") from None
    system: System = module.system
    return system


def _checked(made: Path, target: Path, suffix: str, left_out: dict[str, str]) -> list[str]:
    """What engines that run the file have to say against it; `left_out` gets those that can't.

    Raises:
        NewError: where no installed engine agrees with what was read.
    """
    installed = tuple(e.name for e in readers(suffix) if e.version() is not None)
    if not installed:
        return ["no engine that runs it is installed: what was read is not checked"]
    against: list[str] = []
    agrees = False
    for model in audits([made], engines=installed):
        engine = model.id.engine
        wrong = [one.message for one in model.findings if one.severity == "finding"]
        if model.failure and engine == "-":
            raise NewError(_plain(model.failure, made, target))
        if model.failure:
            left_out[engine] = _plain(model.failure, made, target)
            against.append(f"{engine} is left out: {left_out[engine]}")
        elif wrong:
            against += [f"{engine}: {_plain(m, made, target)}" for m in wrong]
        else:
            agrees = True
    if not agrees:
        raise NewError(
            f"{target}: nothing was written, since no engine agrees with what was read: "
            + "; ".join(against or ["none ran it"])
        )
    return against


def _plain(message: str, made: Path, target: Path) -> str:
    return " ".join(message.replace(str(made), str(target)).split())
