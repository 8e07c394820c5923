import shutil
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.records import AuditFinding
from tests.audit.models import MODELS, AuditCopy, audit
from tests.physics import physics as prepared
from tests.standing import keep_default_engines


@pytest.fixture
def audit_copy(tmp_path: Path) -> AuditCopy:
    """Audit a copy of a built-in model after (old, new) changes of its text, or its sidecar's."""

    def run(
        system: str, name: str, engine: str, *changes: tuple[str, str]
    ) -> tuple[AuditFinding, ...]:
        for file in (name, f"{name}.toml"):
            shutil.copy(MODELS / system / file, tmp_path / file)
        keep_default_engines(tmp_path)
        for old, new in changes:
            files = [tmp_path / name, tmp_path / f"{name}.toml"]
            path = next(f for f in files if old in f.read_text())
            path.write_text(path.read_text().replace(old, new, 1))
        return audit(prepared(system), read_sidecar(tmp_path / f"{name}.toml"), engine)

    return run
