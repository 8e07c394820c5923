"""The arguments of `crosscheck engines`."""

from __future__ import annotations

import argparse


def add(command: argparse.ArgumentParser) -> None:
    """One option."""
    command.add_argument(
        "--conformance",
        metavar="NAME",
        help="hold one engine's adapter against the protocol, on the samples that it offers",
    )
