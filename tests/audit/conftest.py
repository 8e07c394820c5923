import shutil

import pytest

from harness.audit.run import audit
from harness.files.sidecar import read_sidecar
from tests.audit.models import MODELS, prepared


@pytest.fixture
def look(tmp_path):
    """Audit a copy of a built-in model after (old, new) changes of its text, or its sidecar's."""

    def run(system, name, engine, *changes):
        for file in (name, f"{name}.toml"):
            shutil.copy(MODELS / system / file, tmp_path / file)
        for old, new in changes:
            files = [tmp_path / name, tmp_path / f"{name}.toml"]
            file = next(f for f in files if old in f.read_text())
            file.write_text(file.read_text().replace(old, new, 1))
        return audit(prepared(system), read_sidecar(tmp_path / f"{name}.toml"), engine)

    return run
