"""The command `crosscheck versions`."""

from pathlib import Path

from physics_crosscheck.harness.interfaces.cli import arguments
from physics_crosscheck.harness.interfaces.cli.help import INTERRUPTED, Command, option

ENVIRONMENTS = option(
    "Caching",
    "--environments",
    type=Path,
    metavar="DIR",
    help="Folder for Python environments [physics-crosscheck/environments in the user cache]",
)

COMMAND = Command(
    group="Compare",
    purpose="Compare several versions of an engine",
    description="Run the same models in several versions of an engine and compare them.\n"
    "Each version runs in its own environment. The gate compares them.",
    examples={
        "Compare two versions of MuJoCo": "crosscheck versions arm.urdf"
        " --engine mujoco 3.3.7 3.4.0",
        "Use an environment of your own": "crosscheck versions --engine mujoco 3.3.7 3.4.0=env",
    },
    exit_codes={
        "0": "Nothing changed between the versions.",
        "1": "A case changed.",
        "2": "Wrong usage, or an unknown target.",
        "3": "A version could not be installed, or a case could not be compared.",
        **INTERRUPTED,
    },
    options=(
        arguments.targets(required=False, kinds="System folders and robot files"),
        option(
            "Selection",
            "--engine",
            nargs="+",
            action="append",
            required=True,
            metavar=("NAME", "VERSION"),
            help="Engine and at least two versions, as VERSION or VERSION=ENVIRONMENT (required)",
        ),
        *arguments.SOURCES,
        arguments.floating(),
        arguments.RESOLUTION,
        arguments.DIAGNOSE,
        arguments.out("reports/versions"),
        ENVIRONMENTS,
        *arguments.limits(),
        arguments.jobs(),
    ),
    function="physics_crosscheck.harness.extras.versions.main:main",
    settings=("resolution", "limit", "memory", "jobs"),
)
