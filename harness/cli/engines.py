"""`crosscheck engines`: what is installed, versions, capabilities."""

from __future__ import annotations

import argparse

from harness.cli.exit_codes import AGREE
from harness.engines.registry import engines


def add(command: argparse.ArgumentParser) -> None:
    """It takes no arguments."""


def main(options: argparse.Namespace) -> int:
    """Print a line an engine, and one a capability."""
    for name, engine in sorted(engines().items()):
        version = engine.version()
        print(f"{name:<10} {version or 'not installed':<14} reads {', '.join(engine.formats)}")
        for capability in engine.capabilities:
            print(f"{'':<11}- {capability}")
    return AGREE
