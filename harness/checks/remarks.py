"""Source lines of the defaults that engines and formats apply."""

from __future__ import annotations

from pathlib import Path

from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.modelfiles.bindings import SIDECAR
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.records.base import SourceLine


def where(remark: Remark, sidecar: Sidecar, engine: str) -> SourceLine | None:
    """Return the line that a remark concerns, or only the file, or None."""
    if remark.address is None:
        return None
    file, address = sidecar.model, remark.address
    if address.startswith(SIDECAR):
        file, address = Path(f"{file}.toml"), address.removeprefix(SIDECAR)
        key = address.removeprefix("settings.")
        if key in sidecar.engine_settings.get(engine, {}):
            address = f"settings.{engine}.{key}"
    return SourceLine(file=str(file), line=line_of(file, address))
