"""Create a system folder from a mechanism's energies: read, plan, and check in every engine."""

from __future__ import annotations

import types
from dataclasses import replace
from pathlib import Path

import sympy as sp

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.commands.scaffold.assets import neighbours
from physics_crosscheck.harness.commands.scaffold.constants import ConstantRow, Ledger
from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.commands.scaffold.mechanism import Mechanism
from physics_crosscheck.harness.commands.scaffold.mjcf import read_mjcf
from physics_crosscheck.harness.commands.scaffold.scenarios import ScenarioPlan, plan, provisional
from physics_crosscheck.harness.commands.scaffold.text import sidecar_text, system_text
from physics_crosscheck.harness.commands.scaffold.urdf import read_urdf
from physics_crosscheck.harness.engines.registry import default_engines
from physics_crosscheck.reference.mechanism.system import System

GRAVITY = 9.81
STEP = 0.002


class Energies:
    """Folder of a mechanism whose energies are written as formulas.

    Args:
        model: the file.
        data: its content.
        target: the folder to write.

    Attributes:
        remarks: remarks to print.
        operations: number of operations in T and V.
        files: files to write; complete after `plan`.

    Raises:
        NewError: naming file, line and the unreadable part.
    """

    def __init__(self, model: Path, data: bytes, target: Path) -> None:
        self._model, self._data, self._target = model, data, target
        self._neighbours = neighbours(model, data)
        self._ledger = Ledger(model, data)
        mechanism = _read(model, data, self._ledger)
        if not mechanism.joints:
            raise NewError(f"{model}: it has no moving joint")
        self._mechanism = _with_symbols(mechanism, self._ledger)
        self._system = _declared(self._text(provisional(self._mechanism.joints)), model)
        self._left_out: dict[str, str] = {}
        self.remarks = list(mechanism.remarks)
        self.operations = int(sp.count_ops(self._system.T) + sp.count_ops(self._system.V))
        self.files: dict[str, bytes] = {}

    def plan(self) -> None:
        """Choose a rest position and motions, which completes the files.

        Raises:
            NewError: if no rest position is found.
        """
        chosen = plan(self._system, self._mechanism.joints)
        self.files = {
            self._model.name: self._data,
            **self._neighbours,
            "system.py": self._text(chosen).encode(),
            self._sidecar: self._sidecar_bytes(),
        }

    def check(self, folder: Path) -> None:
        """Compare engines with the equations that were read; skip engines that can't run the file.

        Raises:
            NewError: if no engine agrees.
        """
        suffix = self._model.suffix
        self.remarks.extend(_checked(folder, self._target, suffix, self._left_out))
        (folder / self._sidecar).write_bytes(self._sidecar_bytes())

    def _text(self, chosen: ScenarioPlan) -> str:
        rows = self._ledger.rows
        return system_text(self._target.name, self._model.name, self._mechanism, rows, chosen)

    @property
    def _sidecar(self) -> str:
        return f"{self._model.name}.toml"

    def _sidecar_bytes(self) -> bytes:
        suffix = self._model.suffix
        return sidecar_text(
            self._model.name,
            [engine for engine in default_engines(suffix) if engine.name not in self._left_out],
            self._mechanism,
            self._ledger,
            self._left_out,
            format_settings(suffix),
        ).encode()


def _read(model: Path, data: bytes, ledger: Ledger) -> Mechanism:
    if model.suffix == ".xml":
        return read_mjcf(model, data, ledger)
    mechanism = read_urdf(model, data, ledger)
    g = ledger.name("g")
    ledger.rows.append(
        ConstantRow(
            name=g,
            value=GRAVITY,
            unit="m/s^2",
            description="gravity",
            source=f"{model.name}.toml; a URDF states none",
        )
    )
    ledger.bindings["sidecar:settings.gravity[2]"] = f"-{g}"
    return replace(mechanism, gravity=("0", "0", f"-{g}"))


def format_settings(suffix: str) -> list[str]:
    """Return the lines of a sidecar's settings for a format that states none."""
    if suffix != ".urdf":
        return []
    required = [
        f"{e.title} would take {e.default_settings_note}"
        for e in default_engines(suffix)
        if e.default_settings_note
    ]
    first, *others = [*required, ""]
    rest = "".join(f", {words.replace(' would take', '')}" for words in others if words)
    return [
        f"# A URDF carries neither; {first}{rest}.",
        "[settings]",
        f"step = {STEP}",
        f"gravity = [0, 0, -{GRAVITY}]",
        "",
    ]


def _with_symbols(mechanism: Mechanism, ledger: Ledger) -> Mechanism:
    """Name the forces and the frames at centres of mass, which have no constants."""
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
    """Return the system that a system.py would declare."""
    module = types.ModuleType("new_system")
    try:
        exec(compile(text, "system.py", "exec"), module.__dict__)
    except (ArithmeticError, RecursionError, TypeError, ValueError) as error:
        raise NewError(f"{model}: its content is not a mechanism: {error}") from None
    system: System = module.system
    return system


def _checked(folder: Path, target: Path, suffix: str, left_out: dict[str, str]) -> list[str]:
    """Return the engines' disagreements with a written folder; `left_out` gets unusable engines.

    Raises:
        NewError: if no installed engine agrees with the equations that were read.
    """
    installed = tuple(e.name for e in default_engines(suffix) if e.version() is not None)
    if not installed:
        return ["no engine that runs it is installed, so the new folder is not checked"]
    against: list[str] = []
    agrees = False
    for model in audits([folder], engines=installed):
        engine = model.id.engine
        wrong = [one.message for one in model.findings if one.severity == "finding"]
        if model.failure and engine == "-":
            raise NewError(_plain(model.failure, folder, target))
        if model.failure:
            left_out[engine] = _plain(model.failure, folder, target)
            against.append(f"{engine} is left out: {left_out[engine]}")
        elif wrong:
            against += [f"{engine}: {_plain(m, folder, target)}" for m in wrong]
        else:
            agrees = True
    if not agrees:
        raise NewError(
            f"{target}: nothing was written because no engine agrees with the equations read from "
            f"it: {'; '.join(against or ['no engine ran it'])}. See what crosscheck run FILE names "
            "as the cause"
        )
    return against


def _plain(message: str, folder: Path, target: Path) -> str:
    return " ".join(message.replace(str(folder), str(target)).split())
