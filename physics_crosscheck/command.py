"""Building blocks of a command; `docs/how-to/own-command.md` shows how to write one."""

from physics_crosscheck.harness.interfaces.cli.arguments import AppendAction
from physics_crosscheck.harness.interfaces.cli.exit_codes import AGREE, DIFFER, FAIL, USAGE
from physics_crosscheck.harness.interfaces.cli.help import Command, group, option

__all__ = [
    "AGREE", "DIFFER", "FAIL", "USAGE", "AppendAction", "Command", "group", "option",
]  # fmt: skip
