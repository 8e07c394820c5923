"""`crosscheck engines`: installed engines and their capabilities; conformance of an adapter."""

import argparse
import sys

from physics_crosscheck.harness.engines.conformance import conform_samples
from physics_crosscheck.harness.engines.protocol import Engine
from physics_crosscheck.harness.engines.registry import engines, missing
from physics_crosscheck.harness.render.terminal.console import terminal, wrapped
from .exit_codes import AGREE, DIFFER, USAGE
from .help import suggestion


def main(options: argparse.Namespace) -> int:
    """Print a line per engine and capability, or a line per conformance test of an adapter."""
    all_engines = engines()
    if options.conformance is not None:
        engine = all_engines.get(options.conformance)
        if engine is None or engine.version() is None:
            installed = sorted(
                name for name in all_engines if all_engines[name].version() is not None
            )
            hint = suggestion(options.conformance, installed)
            message = f"engine {options.conformance!r} is not installed.{hint}"
            print(f"crosscheck: {message} Installed: {', '.join(installed)}.", file=sys.stderr)
            return USAGE
        return _conformance(engine)
    width = terminal().width
    for name, engine in sorted(all_engines.items()):
        version = engine.version()
        print(f"{name:<10} {version or 'not installed':<14} reads {', '.join(engine.formats)}")
        about = [] if version else [missing(engine).partition("; ")[2]]
        for text in (*about, *(f"- {one}" for one in engine.capabilities)):
            print("\n".join(wrapped(f"{'':<11}{text}", width)))
    return AGREE


def _conformance(engine: Engine) -> int:
    results = conform_samples(engine)
    for file, checks in results.items():
        print(file)
        for check in checks:
            print(f"  {check}")
    passed = all(check.passed for checks in results.values() for check in checks)
    return AGREE if results and passed else DIFFER
