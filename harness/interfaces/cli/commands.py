"""The table of commands: their options, help, settings and functions.

This module imports only what parsing needs, so help and completion load no sympy and no engine.
"""

import argparse
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

from physics_crosscheck.harness.jobs.limits import FAULT_SECONDS
from . import arguments
from .completion import SHELLS
from .help import ARGUMENTS, INTERRUPTED, Command, group, option, switch

_CLI = "physics_crosscheck.harness.interfaces.cli"

_BASELINE_SETTINGS = ("folders", "engines", "resolution", "limit", "memory", "jobs", "baseline")
"""Settings of commands that run models and compare them with the baseline."""


def _verbosity(command: argparse.ArgumentParser) -> None:
    verbosity = group(command, "Output").add_mutually_exclusive_group()
    verbosity.add_argument(
        "-q", "--quiet", action="store_true", help="Print only problems and the summary"
    )
    verbosity.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="Print a line for each finished case, and missing engines",
    )


_RUN_OPTIONS = (
    arguments.ENGINE,
    arguments.WORDS,
    arguments.RESOLUTION,
    arguments.THOROUGH,
    switch("Checks", "--require-engines", "Fail if a default engine is not installed"),
    arguments.out("reports"),
    arguments.output_format("text", "concise", "json", "github", "sarif"),
    arguments.SELECT,
    arguments.IGNORE,
    arguments.DETAILS,
    _verbosity,
    arguments.CACHE,
    arguments.BASELINE,
    *arguments.limits(),
    arguments.jobs(),
    arguments.scheduler,
)
"""Options that `run` and `demo` share."""

_RUN_CODES = {
    "0": "Every case agrees, or its difference is accepted.",
    "1": "A case differs or is unresolved, or a number in a file is wrong.",
    "2": "Wrong usage, an unknown target, or a folder that is in use.",
    "3": "A check could not run, nothing was tested, or --strict or --require-engines fails.",
    **INTERRUPTED,
}

_SELECTION = (
    arguments.targets(
        required=False, kinds="Folders and robot files", default="those of the baseline"
    ),
    arguments.ENGINE,
    arguments.RESOLUTION,
    arguments.THOROUGH,
    *arguments.limits(),
    arguments.jobs(),
    arguments.BASELINE,
    arguments.DIAGNOSE,
)
"""Options that select cases, of `gate`."""


def _demo_defaults(command: argparse.ArgumentParser) -> None:
    """Set the options of `run` that make no sense for the built-in systems."""
    command.set_defaults(
        last_failed=False,
        standalone=False,
        watch=False,
        strict=False,
        floating=None,
        motion=0.0,
        smooth=True,
        ideal=False,
        model="",
    )


def _start(text: str) -> dict[str, float]:
    """Return the values of a start state, by coordinate."""
    state = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise argparse.ArgumentTypeError(f"must look like theta=1.5, not {part!r}")
        state[name.strip()] = number
    return state


def _all_codes(**_: object) -> Iterable[str]:
    from physics_crosscheck.harness.records.codes import codes

    return codes()


COMMANDS: Mapping[str, Command] = {
    "run": Command(
        group="Check models",
        purpose="Check model files against their equations of motion",
        description="Check model files against their equations of motion, in every engine.\n"
        "Write results.json and the report index.html.",
        examples={
            "Check one robot file": "crosscheck run robot.urdf",
            "Check a folder in MuJoCo, and reuse results": "crosscheck run my_arm --engine mujoco"
            " --cache .cache",
        },
        exit_codes=_RUN_CODES,
        options=(
            arguments.targets(required=False, default=arguments.BELOW),
            *_RUN_OPTIONS,
            *arguments.ROBOT_OPTIONS,
            arguments.MOTION,
            arguments.SMOOTH,
            arguments.IDEAL,
            arguments.STRICT,
            switch(
                "Selection", "--last-failed", "Run only cases that did not pass in the last run"
            ),
            switch(
                "Output", "--watch", "Run again when a file is saved, with a cache; Ctrl-C ends"
            ),
        ),
        function=f"{_CLI}.run:main",
        settings=(
            *_BASELINE_SETTINGS,
            "cache",
            "out",
            "strict",
            "require-engines",
            "select",
            "ignore",
        ),
    ),
    "demo": Command(
        group="Check models",
        purpose="Check the built-in example systems",
        description="Check the six built-in example systems in every engine.\n"
        "Write results.json and the report index.html.",
        examples={
            "Check all of them": "crosscheck demo",
            "Check the driven cases in MuJoCo": "crosscheck demo -k driven --engine mujoco",
        },
        exit_codes=_RUN_CODES,
        options=(*_RUN_OPTIONS, _demo_defaults),
        function=f"{_CLI}.run:demo",
    ),
    "list": Command(
        group="Check models",
        purpose="List the cases that run would check",
        description="List the cases that `crosscheck run` would check.\n"
        "Each case has a name: SYSTEM/MODEL/SCENARIO [ENGINE]. Nothing runs.",
        examples={
            "List the cases of a folder and of a robot file": "crosscheck list my_arm robot.urdf",
            "List the driven cases in MuJoCo": "crosscheck list -k driven --engine mujoco",
        },
        exit_codes={
            "0": "The cases were listed.",
            "2": "Wrong usage, an unknown target, or no such case.",
            **INTERRUPTED,
        },
        options=(
            arguments.targets(required=False, default=arguments.BELOW),
            arguments.ENGINE,
            arguments.WORDS,
            *arguments.ROBOT_OPTIONS,
            arguments.output_format("text", "json"),
        ),
        function=f"{_CLI}.list:main",
        settings=("folders", "engines"),
    ),
    "audit": Command(
        group="Check models",
        purpose="Check the numbers of model files without running motions",
        description="Check the numbers of model files and engines without running motions.\n"
        "Print wrong numbers with file and line, and implausible ones as advice.",
        examples={
            "Audit every model of a folder, and a robot file": "crosscheck audit my_arm robot.urdf",
            "Print file:line: CODE message": "crosscheck audit robot.urdf --format concise",
        },
        exit_codes={
            "0": "No number is wrong; advice does not count.",
            "1": "A number is wrong.",
            "2": "Wrong usage, or an unknown target.",
            "3": "An audit failed, or no engine of the models is installed.",
            **INTERRUPTED,
        },
        options=(
            arguments.targets(required=True),
            arguments.ENGINE,
            *arguments.ROBOT_OPTIONS,
            *arguments.limits(),
            arguments.jobs(),
            arguments.CACHE,
            arguments.output_format("text", "concise"),
            arguments.SELECT,
            arguments.IGNORE,
            arguments.DETAILS,
            switch(
                "Output", "--fix", "Write the numbers that findings state, and print the changes"
            ),
        ),
        function=f"{_CLI}.audit:main",
        settings=("engines", "limit", "memory", "jobs", "cache", "select", "ignore"),
    ),
    "step": Command(
        group="Check models",
        purpose="List the error of the time step by engine",
        description="List the error of a robot file's time step in each engine.\n"
        "Print the largest stable step, and the step for a requested error.",
        examples={
            "List the steps for an error of 1 %": "crosscheck step robot.urdf --error 1%",
            "Choose a step in MuJoCo": "crosscheck step robot.xml --engine mujoco --error 0.1%",
        },
        exit_codes={
            "0": "The step is stable in every engine.",
            "1": "The step is unstable in an engine.",
            "2": "Wrong usage, or an unknown target.",
            "3": "No engine could run the file.",
            **INTERRUPTED,
        },
        options=(
            arguments.targets(required=True),
            option(
                "Checks",
                "--error",
                type=arguments.share,
                default=0.01,
                metavar="SHARE",
                help="Error relative to the motion's amplitude [0.01]",
            ),
            arguments.ENGINE,
            *arguments.ROBOT_OPTIONS,
            arguments.output_format("text", "json"),
            *arguments.limits(),
        ),
        function=f"{_CLI}.step:main",
        settings=("engines", "limit", "memory"),
    ),
    "mutate": Command(
        group="Check models",
        purpose="Plant known faults and report which ones the checks detect",
        description="Plant known faults in models and report which ones the checks detect.\n"
        "Your files stay as they are: every fault goes into a copy.",
        examples={
            "Plant faults in a robot file": "crosscheck mutate robot.urdf --engine mujoco",
            "Keep every result for a program": "crosscheck mutate my_arm --json faults.json",
        },
        exit_codes={
            "0": "Every fault that motions can show was detected.",
            "1": "A fault was missed, or a correct model was reported as wrong.",
            "2": "Wrong usage, or an unknown target.",
            "3": "A model was wrong before any fault, or no fault could be planted.",
            **INTERRUPTED,
        },
        options=(
            arguments.targets(required=True),
            arguments.ENGINE,
            *arguments.ROBOT_OPTIONS,
            arguments.THOROUGH,
            *arguments.limits(FAULT_SECONDS),
            arguments.jobs("2"),
            arguments.JSON_FILE,
        ),
        function=f"{_CLI}.mutate:main",
        settings=("engines", "limit", "memory", "jobs"),
    ),
    "compare": Command(
        group="Compare",
        purpose="Compare two model files without declared equations",
        description="Compare two model files of one mechanism, without declared equations.\n"
        "Print whether they move alike, and what differs; write compare.html.",
        examples={
            "Compare two files": "crosscheck compare robot.urdf robot.xml",
            "Compare one file in two engines": "crosscheck compare a.urdf a.urdf"
            " --engine-b pybullet",
        },
        exit_codes={
            "0": "The models agree.",
            "1": "They differ, the result is unresolved, or --strict was not met.",
            "2": "Wrong usage, or joints that cannot be paired.",
            "3": "A model could not be read or run, or an engine is not installed.",
            **INTERRUPTED,
        },
        options=(
            option(ARGUMENTS, "a", type=Path, metavar="A", help="First model file"),
            option(ARGUMENTS, "b", type=Path, metavar="B", help="Second model file"),
            option("Selection", "--engine", metavar="NAME", help="Engine of both models"),
            option("Selection", "--engine-a", metavar="NAME", help="Engine of A"),
            option("Selection", "--engine-b", metavar="NAME", help="Engine of B"),
            option(
                "Comparison",
                "--joints",
                default="",
                metavar="A=B,...",
                help="Pair joints of A and B, e.g. hip=j1,knee=-j2 [by name]",
            ),
            option(
                "Comparison",
                "--map",
                type=Path,
                metavar="FILE",
                help="TOML file: [joints] gives joints of B as expressions of A's",
            ),
            option(
                "Comparison",
                "--start",
                action="append",
                default=[],
                type=_start,
                metavar="JOINT=VALUE,...",
                help="Start state, e.g. j=1,j_dot=0; repeatable [drawn within joint limits]",
            ),
            switch(
                "Comparison",
                "--include-constraints",
                "Include contacts, joint limits, dry friction and couplings",
            ),
            *arguments.SOURCES,
            arguments.floating("as the other file"),
            arguments.RESOLUTION,
            arguments.STRICT,
            arguments.DETAILS,
            arguments.out("reports"),
            arguments.JSON_FILE,
            *arguments.limits(),
        ),
        function=f"{_CLI}.compare:main",
        settings=("resolution", "limit", "memory"),
    ),
    "gate": Command(
        group="Keep a baseline",
        purpose="Run changed models and compare them with the baseline",
        description="Run the models that changed and compare them with the accepted baseline.\n"
        "Write gate.json, summary.md and gate.html. Made for CI.",
        examples={
            "Check what changed since the baseline": "crosscheck gate",
            "Run every case of one folder": "crosscheck gate my_arm --all",
        },
        exit_codes={
            "0": "Every case is as accepted.",
            "1": "A case changed, is new, or is missing.",
            "2": "Wrong usage, or an unknown folder.",
            "3": "A case could not run, nothing ran, or the baseline is unreadable.",
            **INTERRUPTED,
        },
        options=(
            *_SELECTION,
            switch("Selection", "--all", "Run every case, changed or not", dest="every"),
            arguments.out("reports/gate"),
        ),
        function=f"{_CLI}.gate:main",
        settings=_BASELINE_SETTINGS,
    ),
    "accept": Command(
        group="Keep a baseline",
        purpose="Accept the current results as the baseline",
        description="Accept the current results as the baseline, with a reason.\n"
        "Models that changed run first; the baseline folder gets the results.",
        examples={
            "Accept a robot file": "crosscheck accept robot.urdf --reason 'First baseline'",
            "Accept the cases of one model": "crosscheck accept --reason 'Mass fixed'"
            " 'arm/arm.urdf/*'",
        },
        exit_codes={
            "0": "The results were accepted, or nothing had changed.",
            "2": "Wrong usage, an unknown folder or case, or a run in CI.",
            "3": "A case could not run, or the baseline could not be read or written.",
            **INTERRUPTED,
        },
        options=(
            option(
                ARGUMENTS,
                "cases",
                nargs="*",
                metavar="TARGET",
                help="Folders, robot files or cases, e.g. 'arm/arm.urdf/*' [all]",
            ),
            option(
                "Baseline",
                "--reason",
                required=True,
                metavar="TEXT",
                help="Reason, stored in the baseline (required)",
            ),
            switch("Baseline", "--untested", "Accept files that every engine refuses"),
            option(
                "Selection",
                "--folder",
                action=arguments.AppendAction,
                default=[],
                dest="folders",
                metavar="FOLDER",
                help="Folder or robot file; repeatable [those of the baseline]",
            ),
            arguments.ENGINE,
            *arguments.SOURCES,
            arguments.floating("as accepted"),
            arguments.chosen_model("as accepted"),
            arguments.RESOLUTION,
            arguments.THOROUGH,
            *arguments.limits(),
            arguments.jobs(),
            arguments.BASELINE,
            switch("Output", "-v --verbose", "Print a line for each accepted case"),
        ),
        function=f"{_CLI}.gate:accept_main",
        settings=_BASELINE_SETTINGS,
    ),
    "new": Command(
        group="Create models and reports",
        purpose="Create a system folder, optionally from a model file",
        description="Create a system folder with comments that explain every part.\n"
        "It runs as it is; with --from, it declares the bodies of your model.",
        examples={
            "Create an example to edit": "crosscheck new my_arm",
            "Create a folder from a model file": "crosscheck new my_arm --from arm.urdf",
        },
        exit_codes={
            "0": "The folder was written.",
            "2": "Wrong usage, or an unusable folder name.",
            "3": "The model could not be read, or the folder could not be written.",
        },
        options=(
            option(
                ARGUMENTS,
                "name",
                metavar="NAME",
                help="Folder to create; its name becomes the system's name",
            ),
            option(
                "Robot files",
                "--from",
                dest="source",
                type=Path,
                metavar="FILE",
                help="Model file to start from: URDF, SDFormat or MJCF",
            ),
            *arguments.SOURCES,
            arguments.floating(),
            arguments.chosen_model("the only movable one"),
        ),
        function=f"{_CLI}.new:main",
    ),
    "derive": Command(
        group="Create models and reports",
        purpose="Print equations of motion, linearization and modes",
        description="Print the equations of motion of system folders and robot files.\n"
        "Folders that declare energies have linearizations, modes and errata, too.",
        examples={
            "Print the equations of a robot file": "crosscheck derive robot.urdf",
            "Print those of a system folder as LaTeX": "crosscheck derive my_arm --latex",
        },
        exit_codes={
            "0": "All equations were printed.",
            "2": "Wrong usage, or an unknown target.",
            "3": "The equations of a target could not be derived.",
            **INTERRUPTED,
        },
        options=(
            arguments.targets(required=True),
            *arguments.ROBOT_OPTIONS,
            *arguments.limits(),
            switch("Output", "--latex", "Print LaTeX instead of text"),
        ),
        function=f"{_CLI}.derive:main",
        settings=("limit", "memory"),
    ),
    "report": Command(
        group="Create models and reports",
        purpose="Create the HTML report of a finished run",
        description="Create the HTML report index.html of a finished run.\nNothing runs.",
        examples={
            "Create the report of the last run": "crosscheck report",
            "Create that of another run": "crosscheck report old/",
        },
        exit_codes={
            "0": "The page was written.",
            "2": "Wrong usage, unreadable results, or a page by another program.",
            "3": "The page could not be written.",
        },
        options=(
            option(
                ARGUMENTS,
                "results",
                nargs="?",
                type=Path,
                default=Path("reports"),
                metavar="RESULTS",
                help="File results.json, or its folder [reports]",
            ),
            option(
                "Output",
                "--out",
                type=Path,
                metavar="DIR",
                help="Folder for output files [RESULTS]",
            ),
        ),
        function=f"{_CLI}.report:main",
    ),
    "explain": Command(
        group="Set up",
        purpose="Explain a message code, and what to do",
        description="Explain a message code: cause, example and remedy.\n"
        "Without a code, list all codes; other words search their texts.",
        examples={
            "Explain one code": "crosscheck explain XC101",
            "Search for words": "crosscheck explain joint limit",
        },
        exit_codes={"0": "The page was printed.", "2": "Wrong usage, or an unknown code."},
        options=(
            option(
                ARGUMENTS,
                "codes",
                nargs="*",
                metavar="CODE",
                help="Message codes or names, or words to search for [list all]",
                completer=_all_codes,
            ),
        ),
        function=f"{_CLI}.explain:main",
    ),
    "engines": Command(
        group="Set up",
        purpose="List engines, their versions and capabilities",
        description="List the physics engines: version, file formats and capabilities.\n"
        "For an engine that is missing, print the command that installs it.",
        examples={
            "List all engines": "crosscheck engines",
            "Test the adapter of your own engine": "crosscheck engines --conformance my_engine",
        },
        exit_codes={
            "0": "The engines were listed, or the adapter passed every test.",
            "1": "The adapter failed a conformance test.",
            "2": "Wrong usage, or an engine that is not installed.",
        },
        options=(
            option(
                "Checks",
                "--conformance",
                metavar="NAME",
                help="Test this engine's adapter against the protocol, on its own samples",
            ),
        ),
        function=f"{_CLI}.engines:main",
    ),
    "completion": Command(
        group="Set up",
        purpose="Print a shell completion script",
        description="Print a shell script that completes crosscheck commands with Tab.\n"
        "Add the matching example to the start-up file of your shell.",
        examples={
            "In ~/.bashrc": 'eval "$(crosscheck completion bash)"',
            "In ~/.config/fish/config.fish": "crosscheck completion fish | source",
        },
        exit_codes={"0": "The script was printed.", "2": "Wrong usage."},
        options=(
            option(
                ARGUMENTS,
                "shell",
                choices=SHELLS,
                metavar="SHELL",
                help=f"Shell: {', '.join(SHELLS)}",
            ),
        ),
        function=f"{_CLI}.completion:main",
    ),
}
"""The commands of this program by name, in the groups and the order that help shows."""
