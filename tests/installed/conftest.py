"""The wheel, built once and installed in an environment of its own, far from the checkout."""

from __future__ import annotations

import os
import site
import subprocess
import sys
import sysconfig
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Installed:
    """An environment; nothing in that with the wheel knows of the checkout."""

    bin: Path

    def shell(
        self, command: str, cwd: Path, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run a line of shell as a user would; returns the finished process."""
        clean = {
            k: v
            for k, v in os.environ.items()
            if not k.startswith(("PYTHON", "PYTEST", "GITHUB", "VIRTUAL_ENV"))
        }
        clean.pop("CI", None)
        clean["PATH"] = f"{self.bin}{os.pathsep}{clean['PATH']}"
        return subprocess.run(
            ["bash", "-c", command],
            cwd=cwd,
            capture_output=True,
            text=True,
            timeout=1800,
            check=False,
            env={**clean, **environment},
        )


CHECKOUT = Installed(Path(sys.executable).parent)
"""This environment, with the checkout: for what is no matter of the wheel."""


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Install the wheel of the source distribution, beside this environment's dependencies."""
    folder = tmp_path_factory.mktemp("installed")
    quiet: dict[str, Any] = {"check": True, "capture_output": True, "text": True}
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(folder), "-t"]
    subprocess.run([*build, "sdist"], cwd=ROOT, **quiet)
    (source,) = folder.glob("*.tar.gz")
    with tarfile.open(source) as packed:
        packed.extractall(folder, filter="data")
    subprocess.run([*build, "wheel"], cwd=folder / source.name.removesuffix(".tar.gz"), **quiet)
    (wheel,) = folder.glob("*.whl")
    home = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], **quiet)
    python = home / "bin" / "python"
    own = Path(sysconfig.get_path("purelib", vars={"base": str(home)}))
    # On the path alone: the .pth of an editable install in there is not read, so that the checkout
    # is not found.
    (own / "dependencies.pth").write_text("\n".join(site.getsitepackages()) + "\n")
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "--python",
            str(python),
            "install",
            "--no-deps",
            "--no-index",
            "--disable-pip-version-check",
            str(wheel),
        ],
        **quiet,
    )
    pytest_script = home / "bin" / "pytest"
    pytest_script.write_text(f"#!{python}\nimport sys, pytest\nsys.exit(pytest.console_main())\n")
    pytest_script.chmod(0o755)
    return Installed(home / "bin")
