"""Run code with an environment's interpreter and this program's packages."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Container, Mapping, Sequence
from pathlib import Path

from physics_crosscheck.harness.extras.versions.environments import EnvironmentError_, site_folders
from physics_crosscheck.harness.paths import IMPORT_ROOT
from physics_crosscheck.harness.results.visible import visible

_BEGIN = """
import pathlib, site, sys
here, places, separator, package, engine, version, why, *rest = sys.argv[1:]
def end(reason):
    pathlib.Path(why).write_text(reason, encoding="utf-8")
    sys.exit(1)
own = f"{sys.version_info.major}.{sys.version_info.minor}"
if own != here:
    end(f"it is Python {own}, and this program's packages are for {here}")
for place in filter(None, places.split(separator)):
    if place not in sys.path:
        site.addsitedir(place)
try:
    import physics_crosscheck
    from physics_crosscheck.harness.extras.versions.child import unusable
except ImportError as error:
    end(f"{type(error).__name__}: {error}")
if problem := unusable(engine, version, package):
    end(problem)
"""
"""Code of the environment's interpreter: this program's packages follow its own."""


def launch(
    engine: str,
    version: str,
    python: str,
    code: str,
    words: Sequence[str],
    answers: Container[int] = (0,),
) -> int:
    """Run code in an environment, in its own process; return its exit code.

    Args:
        engine, version: version that the environment must have.
        python: the environment's interpreter.
        code: code to run; it finds `words` in `rest`.
        words: arguments of the code.
        answers: exit codes of the code; any other one is an error.

    Raises:
        EnvironmentError_: if it can't run, with the reason.
    """
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    places, package = os.pathsep.join(site_folders()), str(IMPORT_ROOT)
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as scratch:
        why = Path(scratch) / "why.txt"
        given = here, places, os.pathsep, package, engine, version, str(why), *words
        ended = subprocess.run(
            [python, "-P", "-c", _BEGIN + code, *given],
            stdin=subprocess.DEVNULL,
            env=_process_environment(),
            check=False,
        ).returncode
        reason = why.read_text(encoding="utf-8") if why.is_file() else ""
    if ended not in answers:
        reason = reason or f"it ended with code {ended}"
    if reason:
        raise EnvironmentError_(f"{engine} {version} can't be run by {visible(python)}: {reason}")
    return ended


def _process_environment() -> Mapping[str, str]:
    """Return the environment variables of that process: a checkout comes first on its path.

    An installed package is found with its dependencies, after the environment's own packages.
    Before them, the engine installed here would run instead.
    """
    here = str(IMPORT_ROOT)
    if here in {str(Path(place).resolve()) for place in site_folders()}:
        return os.environ
    path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path}
