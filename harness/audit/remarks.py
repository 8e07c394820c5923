"""Where what engines and formats do on their own stands in a model's files."""

from __future__ import annotations

from pathlib import Path

from harness.engines.remark import Remark
from harness.files.bindings import SIDECAR
from harness.files.locations import line_of
from harness.files.sidecar import Sidecar


def where(remark: Remark, sidecar: Sidecar, engine: str) -> str:
    """file:line of what a remark is about, the file alone, or nothing."""
    if remark.address is None:
        return ""
    file, address = sidecar.model, remark.address
    if address.startswith(SIDECAR):
        file, address = Path(f"{file}.toml"), address.removeprefix(SIDECAR)
        key = address.removeprefix("settings.")
        if key in sidecar.engine_settings.get(engine, {}):
            address = f"settings.{engine}.{key}"
    line = line_of(file, address)
    return str(file) if line is None else f"{file}:{line}"
