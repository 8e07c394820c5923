"""Arguments that several commands take, and what they accept."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from physics_crosscheck.harness.baseline.place import DEFAULT
from physics_crosscheck.harness.cli.completion import completed_by, engine_names, systems_and_files
from physics_crosscheck.harness.schedule.limits import MEMORY, SECONDS, Limits

SCHEDULER = "CROSSCHECK_SCHEDULER"
"""The environment variable with the address of a scheduler."""


def folders(command: argparse.ArgumentParser, *, some: bool, models: bool = True) -> None:
    """Add FOLDER ...; `some`: at least one; `models`: files in them may be named too."""
    told = "system folders, or model files in them" if models else "system folders"
    action = command.add_argument(
        "folders",
        nargs="+" if some else "*",
        metavar="FOLDER",
        help=told if some else f"{told}; none: built-in",
    )
    completed_by(action, systems_and_files)


class Gathered(argparse.Action):
    """Gathers values; unlike `append`, the first puts the default aside."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        """Add a value."""
        now = getattr(namespace, self.dest)
        setattr(namespace, self.dest, [*(() if now is self.default else now), values])


def engine(command: argparse.ArgumentParser) -> None:
    """Add --engine NAME, repeatable."""
    action = command.add_argument(
        "--engine", action=Gathered, default=[], metavar="NAME", help="only this engine; repeatable"
    )
    completed_by(action, engine_names)


def words(command: argparse.ArgumentParser) -> None:
    """Add -k WORDS."""
    command.add_argument(
        "-k",
        dest="words",
        default="",
        metavar="WORDS",
        help="only cases whose names have these words: 'driven and not (robot or free)'",
    )


def jobs(command: argparse.ArgumentParser, otherwise: str = "one per processor") -> None:
    """Add --jobs N; `otherwise`: how many there are where none are asked for."""
    command.add_argument(
        "--jobs", type=positive, default=0, metavar="N", help=f"worker processes ({otherwise})"
    )


def cache(command: argparse.ArgumentParser) -> None:
    """Add --cache DIR."""
    command.add_argument(
        "--cache",
        type=Path,
        default=None,
        metavar="DIR",
        help="what was found is kept there, and had from there where nothing it depends on is"
        " another, such as .crosscheck_cache",
    )


def scheduler(command: argparse.ArgumentParser) -> None:
    """Add --scheduler ADDRESS."""
    command.add_argument(
        "--scheduler",
        default=os.environ.get(SCHEDULER, ""),
        metavar="ADDRESS",
        help="run on a cluster of dask.distributed, as tcp://HOST:8786"
        f" (${SCHEDULER}, else this machine)",
    )


def alone(command: argparse.ArgumentParser) -> None:
    """Add --alone."""
    command.add_argument(
        "--alone",
        action="store_true",
        help="files in a system folder too are taken as robots' files, without their sidecars",
    )


def floating(command: argparse.ArgumentParser) -> None:
    """Add --floating."""
    command.add_argument(
        "--floating",
        action="store_true",
        help="the root link of a URDF that is given alone moves freely; else it is fixed",
    )


def chosen_model(command: argparse.ArgumentParser) -> None:
    """Add --model."""
    command.add_argument(
        "--model",
        dest="chosen_model",
        default="",
        metavar="NAME",
        help="which of several models of an SDFormat file [the only one that moves]",
    )


def environments(command: argparse.ArgumentParser) -> None:
    """Add --environments DIR."""
    # Imported here: most commands make none.
    from physics_crosscheck.harness.versions import place as kept

    place = kept.cache()
    if place.is_relative_to(Path.home()):  # as a help text shows it
        place = Path("~") / place.relative_to(Path.home())
    command.add_argument(
        "--environments",
        type=Path,
        metavar="DIR",
        help=f"where environments are made once and kept ({place})",
    )


def baseline(command: argparse.ArgumentParser) -> None:
    """Add --baseline DIR."""
    command.add_argument(
        "--baseline",
        type=Path,
        default=DEFAULT,
        metavar="DIR",
        help=f"the accepted baseline ({DEFAULT.as_posix()})",
    )


def resolution_of(command: argparse.ArgumentParser) -> None:
    """Add --resolution R."""
    command.add_argument(
        "--resolution",
        type=resolution,
        default=1e-9,
        metavar="R",
        help="relative discrepancy to resolve (1e-9)",
    )


def limits(command: argparse.ArgumentParser, seconds_each: float = SECONDS) -> None:
    """Add --limit S and --memory GIB."""
    command.add_argument(
        "--limit",
        type=seconds,
        default=seconds_each,
        metavar="S",
        help=f"processor seconds that one task may use ({seconds_each:g})",
    )
    command.add_argument(
        "--memory",
        type=memory,
        default=MEMORY,
        metavar="GIB",
        help=f"GiB of memory that a worker may hold ({MEMORY:g})",
    )


def limits_of(options: argparse.Namespace) -> Limits:
    """The limits that are meant."""
    return Limits(seconds=options.limit, memory=options.memory)


def positive(text: str) -> int:
    """A whole number above zero."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is no positive number")
    return value


def resolution(text: str) -> float:
    """A resolution that double precision can serve."""
    # Imported here: help alone needs no records.
    from physics_crosscheck.harness.options import resolvable

    value = float(text)
    if not resolvable(value):
        raise argparse.ArgumentTypeError(f"{text} is not between 1e-13 and 1e-2")
    return value


def seconds(text: str) -> float:
    """A time above zero."""
    value = float(text)
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{text} is no time in seconds")
    return value


def memory(text: str) -> float:
    """GiB in which Python and an engine find room."""
    value = float(text)
    if not 0.5 <= value < 1e6:
        raise argparse.ArgumentTypeError(f"{text} is not at least 0.5 GiB")
    return value
