"""The wheel, built once and installed in a separate environment outside the checkout."""

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
    """An environment; the one with the wheel does not use the checkout."""

    bin: Path

    def shell(
        self, command: str, cwd: Path, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run a line of shell as a user would; return the finished process."""
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
"""This environment with the checkout, for tests that do not need the wheel."""


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Install the wheel of the source distribution, with this environment's dependencies."""
    folder = tmp_path_factory.mktemp("installed")
    quiet: dict[str, Any] = {"check": True, "capture_output": True, "text": True}
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(folder), "-t"]
    subprocess.run([*build, "sdist"], cwd=ROOT, **quiet)
    (source,) = folder.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        archive.extractall(folder, filter="data")
    subprocess.run([*build, "wheel"], cwd=folder / source.name.removesuffix(".tar.gz"), **quiet)
    (wheel,) = folder.glob("*.whl")
    home = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], **quiet)
    python = home / "bin" / "python"
    site_folder = Path(sysconfig.get_path("purelib", vars={"base": str(home)}))
    # These folders are only on the path: the .pth file of an editable install there is ignored, so
    # the checkout is not found.
    (site_folder / "dependencies.pth").write_text("\n".join(site.getsitepackages()) + "\n")
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
