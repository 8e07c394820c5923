"""Options that several commands share, each defined once, and the values that they accept."""

import argparse
import contextlib
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from physics_crosscheck.harness.jobs.limits import MEMORY, SECONDS, Limits
from physics_crosscheck.harness.paths import DEFAULT_FOLDER
from .completion import engine_names, systems_and_files
from .help import ARGUMENTS, Option, group, option, switch

T = TypeVar("T", float, int)

SCHEDULER = "CROSSCHECK_SCHEDULER"
"""The environment variable with the address of a scheduler."""

XACRO_OPTION = "--xacro-arg"
XACRO_ARGUMENTS = "CROSSCHECK_XACRO_ARGS"
"""The environment variable with arguments of xacro sources."""

_ASSIGNMENT = re.compile(r"[A-Za-z_]\w*:=")


def xacro_argument(text: str) -> str:
    """Return a text such as `gripper:=true`; raise argparse's error for another one."""
    if not _ASSIGNMENT.match(text):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME:=VALUE, such as gripper:=true")
    return text


def variant_selection(text: str) -> str:
    """Return a text such as `size=large`; raise argparse's error for another one."""
    if not all(text.partition("=")):
        raise argparse.ArgumentTypeError(f"{text!r} is not SET=NAME, such as size=large")
    return text


def with_xacro_option(given: Sequence[str]) -> list[str]:
    """Return a command line with the option in front of each `name:=value` that lacks it."""
    return [
        f"{XACRO_OPTION}={word}" if _ASSIGNMENT.match(word) and last != XACRO_OPTION else word
        for last, word in zip(["", *given], given, strict=False)
    ]


def targets(
    *,
    required: bool,
    kinds: str = "Folders, model or robot files, case names",
    default: str = "all built-in systems",
) -> Option:
    """Return TARGET ...; `kinds` describes possible names, `default` the targets without a name."""
    return option(
        ARGUMENTS,
        "folders",
        nargs="+" if required else "*",
        metavar="TARGET",
        help=kinds + ("" if required else f" [{default}]"),
        completer=systems_and_files,
    )


BELOW = "those below the working folder"
"""Default targets of commands that search for models."""


class AppendAction(argparse.Action):
    """Append values; unlike `append`, the first one replaces the default."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        """Append a value."""
        now = getattr(namespace, self.dest)
        setattr(namespace, self.dest, [*(() if now is self.default else now), values])


def scheduler(command: argparse.ArgumentParser) -> None:
    """Add --scheduler ADDRESS; the environment is read when a parser is built."""
    group(command, "Limits").add_argument(
        "--scheduler",
        default=os.environ.get(SCHEDULER, ""),
        metavar="ADDRESS",
        help=f"Use a Dask cluster, e.g. tcp://HOST:8786 [${SCHEDULER} or this machine]",
    )


def jobs(default: str = "one per processor") -> Option:
    """Return --jobs N; `default` describes the number of workers without this option."""
    return option(
        "Limits", "--jobs", type=positive, default=0, metavar="N",
        help=f"Worker processes [{default}]",
    )  # fmt: skip


def floating(default: str = "free on legs, wheels or rotors") -> Option:
    """Return --floating and --no-floating; `default` describes what happens without them."""
    return option(
        "Robot files",
        "--floating",
        action=argparse.BooleanOptionalAction,
        default=None,
        help=f"Free or hold a URDF's root [{default}]",
    )


def chosen_model(default: str = "each that moves") -> Option:
    """Return --model; `default` describes what is read without it."""
    return option(
        "Robot files",
        "--model",
        default="",
        metavar="NAME",
        help=f"Model to read from an SDFormat file [{default}]",
    )


def out(default: str) -> Option:
    """Return --out DIR."""
    return option(
        "Output",
        "--out",
        type=Path,
        default=Path(default),
        metavar="DIR",
        help=f"Folder for output files [{default}]",
    )


def output_format(*formats: str) -> Option:
    """Return --format; the first format is the default."""
    return option(
        "Output",
        "--format",
        choices=formats,
        default=formats[0],
        help=f"Printed format [{formats[0]}]",
    )


def limits(seconds_each: float = SECONDS) -> tuple[Option, ...]:
    """Return --limit SECONDS and --memory GIB."""
    return (
        option(
            "Limits",
            "--limit",
            type=seconds,
            default=seconds_each,
            metavar="SECONDS",
            help=f"Processor seconds per task [{seconds_each:g}]",
        ),
        option(
            "Limits",
            "--memory",
            type=memory,
            default=MEMORY,
            metavar="GIB",
            help=f"Memory per worker process, in GiB [{MEMORY:g}]",
        ),
    )


def limits_of(options: argparse.Namespace) -> Limits:
    """Return the limits that the options set."""
    return Limits(seconds=options.limit, memory=options.memory)


def _reader(
    kind: Callable[[str], T], expected: str, valid: Callable[[float], bool]
) -> Callable[[str], T]:
    """Return a function that reads a number, and raises argparse's error for an invalid one."""

    def read(text: str) -> T:
        with contextlib.suppress(ValueError):
            if valid(value := kind(text)):
                return value
        raise argparse.ArgumentTypeError(f"must be {expected}, not {text or 'empty'}")

    return read


positive = _reader(int, "a whole number above 0", lambda value: value >= 1)
seconds = _reader(float, "a number of seconds above 0 and below 1e6", lambda value: 0 < value < 1e6)
memory = _reader(float, "at least 0.5 GiB and below 1e6 GiB", lambda value: 0.5 <= value < 1e6)


def _resolvable(value: float) -> bool:
    # Imported here: help alone needs no records.
    from physics_crosscheck.harness.planning.options import resolvable

    return resolvable(value)


resolution = _reader(float, "a number between 1e-13 and 1e-2", _resolvable)


def _as_share(text: str) -> float:
    return float(text.rstrip("% ")) / (100 if text.rstrip().endswith("%") else 1)


share = _reader(
    _as_share, "a share above 0 and below 1, such as 1% or 0.01", lambda value: 0 < value < 1
)


ENGINE = option(
    "Selection",
    "--engine",
    action=AppendAction,
    dest="engines",
    default=[],
    metavar="NAME",
    help="Use only this engine; repeatable [all that read the model]",
    completer=engine_names,
)
WORDS = option(
    "Selection",
    "-k",
    dest="words",
    default="",
    metavar="EXPRESSION",
    help="Select cases by name, e.g. 'driven and not (robot or free)'",
)
CACHE = option(
    "Caching",
    "--cache",
    type=Path,
    default=None,
    metavar="DIR",
    help="Store results here; reuse those whose inputs have not changed",
)


def code_prefixes(text: str) -> tuple[str, ...]:
    """Return comma-separated codes, or their first characters, such as XC1,XC207.

    Raises:
        ArgumentTypeError: for one that is the start of no code that can be ignored.
    """
    from physics_crosscheck.harness.records.codes import codes
    from physics_crosscheck.harness.results.ignored import IGNORABLE

    given = tuple(filter(None, re.split(r"[,\s]+", text.upper())))
    for prefix in given:
        matching = [code for code in codes() if code.startswith(prefix)]
        groups = ", ".join(f"{one}xx" for one in IGNORABLE)
        why = f"{prefix} cannot be ignored, since nothing is tested there; only {groups} can"
        if not any(code.startswith(IGNORABLE) for code in matching):
            none = f"no code begins with {prefix}; see crosscheck explain"
            raise argparse.ArgumentTypeError(why if matching else none)
    return given


SELECT, IGNORE = (
    option("Selection", name, type=code_prefixes, default=(), metavar="CODES", help=text)
    for name, text in {
        "--select": "Report only findings with these codes, e.g. XC1,XC207 [all]",
        "--ignore": "Ignore findings with these codes, or first characters of codes",
    }.items()
)


DETAILS = switch(
    "Output", "--details", "Print figures, coverage, steps, runs and minor findings too"
)
STANDALONE = switch(
    "Robot files",
    "--standalone",
    "Treat files in system folders as robot files; ignore their sidecars",
)
XACRO = option(
    "Robot files",
    XACRO_OPTION,
    action=AppendAction,
    type=xacro_argument,
    default=[],
    metavar="NAME:=VALUE",
    help="Argument of xacro sources; the option's name may be left out",
)
VARIANT = option(
    "Robot files",
    "--variant",
    action=AppendAction,
    type=variant_selection,
    default=[],
    metavar="SET=NAME",
    help="Variant of a USD robot [as the file selects]",
)
OUTSIDE = switch(
    "Robot files", "--allow-outside", "Read USD layers outside of the robot's folder too"
)
SOURCES = (XACRO, VARIANT, OUTSIDE)
"""How a robot file is made of its sources."""

ROBOT_OPTIONS = (STANDALONE, *SOURCES, floating(), chosen_model())
"""How robot files are read."""

MOTION = option(
    "Robot files",
    "--motion",
    type=seconds,
    default=0.0,
    metavar="SECONDS",
    help="Also run a motion from rest: its error at dt [no motion]",
)
SMOOTH = switch(
    "Robot files",
    "--smooth",
    "Check without limits, friction, contacts and drives only [also with them]",
)
IDEAL = switch(
    "Checks", "--ideal", "Judge by rigid contacts, not by each engine's law [by the law]"
)
BASELINE = option(
    "Baseline",
    "--baseline",
    type=Path,
    default=DEFAULT_FOLDER,
    metavar="DIR",
    help=f"Folder of accepted results [{DEFAULT_FOLDER.as_posix()}]",
)
JSON_FILE = option(
    "Output", "--json", type=Path, metavar="FILE", help="Write the results to this JSON file"
)
DIAGNOSE = switch("Checks", "--diagnose", "Find the cause of each difference; slower")
STRICT = switch(
    "Checks", "--strict", "Fail for parts not compared and losses of an engine's precision"
)
THOROUGH = switch(
    "Checks", "--thorough", "Run every check, also where a cheaper one decides; slower"
)
RESOLUTION = option(
    "Checks",
    "--resolution",
    type=resolution,
    metavar="VALUE",
    help="Smallest relative difference to detect [1e-9]",
)
