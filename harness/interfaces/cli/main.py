"""The command line, `crosscheck COMMAND`.

`commands.COMMANDS` declares the commands, and entry points add those of extras and other packages.
The module with a command's function is imported after parsing.
"""

import argparse
import errno
import io
import os
import shlex
import signal
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby
from typing import TextIO, cast

from physics_crosscheck.harness import __version__
from physics_crosscheck.harness.documents.reading import USD_OUTSIDE, USD_VARIANTS
from physics_crosscheck.harness.jobs.environment import claim_defaults
from physics_crosscheck.harness.jobs.stop import Stopped, raising
from physics_crosscheck.harness.paths import RESOLUTION
from .arguments import XACRO_ARGUMENTS, with_xacro_option
from .commands import COMMANDS
from .completion import COMPLETING, complete, words_before
from .exit_codes import AGREE, FAIL, SIGNALLED, USAGE
from .help import Command, CommandParser, suggestion

DESCRIPTION = """\
Check whether physics model files are right, to nine digits.
Find wrong numbers by file and line."""

EPILOG = """\
Exit codes:
  0  pass
  1  a difference
  2  wrong usage
  3  something could not be checked

`crosscheck COMMAND --help` has options, examples and exit codes of a command."""


def program() -> int:
    """Run the command line as a program; return the exit code."""
    protect_streams()
    claim_defaults()
    code = main()
    if error := output_error():
        message = f"cannot write to standard output: {error}. The printed text is incomplete."
        print(f"crosscheck: {message}", file=sys.stderr)
        return code or FAIL
    return code


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    if COMPLETING in os.environ:
        given = words_before()
    try:
        with raising():
            # Within: a command's modules are imported here, which takes a while on a busy machine.
            return _parse_and_run(given)
    except OSError as error:
        print(f"crosscheck: {_file_error(error)}", file=sys.stderr)
        return FAIL
    except KeyboardInterrupt as stopped:
        number = stopped.number if isinstance(stopped, Stopped) else signal.SIGINT
        print(f"crosscheck: stopped by {signal.Signals(number).name}", file=sys.stderr)
        return SIGNALLED + number


def _parse_and_run(given: Sequence[str]) -> int:
    commands = _commands_for(given)
    parser = build_parser(commands, given[:1])
    for name in given[:1]:
        if name in commands:
            _apply_settings(subparsers(parser)[name], commands[name])
    if COMPLETING in os.environ:
        complete(parser)
    _check_first(parser, given)
    options, unknown = parser.parse_known_args(with_xacro_option(given))
    if unknown:
        subparsers(parser).get(options.command or "", parser).reject_unknown(unknown)
    if options.command is None:
        parser.print_help()
        return AGREE
    if hasattr(options, "resolution"):
        # A resolution that the user states also counts where an engine's own precision is less.
        options.exact = options.resolution is not None
        options.resolution = options.resolution or RESOLUTION
    for name, key in ((XACRO_ARGUMENTS, "xacro_arg"), (USD_VARIANTS, "variant")):
        os.environ.update({name: shlex.join(words)} if (words := getattr(options, key, ())) else {})
    os.environ.update({USD_OUTSIDE: "1"} if getattr(options, "allow_outside", False) else {})
    for note in getattr(options, "settings_notes", ()):
        print(f"crosscheck: {note}", file=sys.stderr)
    return _guarded(commands[options.command], options)


def _commands_for(given: Sequence[str]) -> Mapping[str, Command]:
    """Return the commands that a command line needs: registered ones for help and other names."""
    if given and (given[0] in COMMANDS or given[0] == "--version"):
        return COMMANDS
    # Imported here: a command of this program does not need to look for others.
    from .registry import all_commands

    return all_commands()


def _check_first(parser: CommandParser, given: Sequence[str]) -> None:
    """Reject an unknown option in place of a command, before its value is read as a command."""
    first = given[0] if given else "-h"
    options = ("--help", "--version")
    if first == "-h" or not first.startswith("-"):
        return
    if not any(option.startswith(first) for option in options):
        hint = (
            suggestion(first, options) or " Options follow the command: `crosscheck run --strict`."
        )
        parser.error(f"unknown option {first} before a command.{hint}")


def _file_error(error: OSError) -> str:
    """Return the message about a file that can't be read or written."""
    if not error.filename:
        try:
            os.getcwd()
        except OSError:
            return "the working folder was removed. Change to an existing folder."
        return error.strerror or str(error)
    remedy = "Check the path, its permissions and the free disk space."
    return f"{error.filename}: cannot be read or written: {error.strerror}. {remedy}"


def _guarded(command: Command, options: argparse.Namespace) -> int:
    """Run a command; on GitHub, keep names in its output from acting as workflow commands."""
    is_github = getattr(options, "format", "") == "github"
    if not is_github and os.environ.get("GITHUB_ACTIONS", "").lower() != "true":
        return _run(command, options)
    from physics_crosscheck.harness.results.github import plain_logs

    with plain_logs():
        return _run(command, options)


def _run(command: Command, options: argparse.Namespace) -> int:
    # Imported here: help alone does not need it.
    from pkgutil import resolve_name

    try:
        code: int = resolve_name(command.function)(options)
    except Exception as error:
        # Imported here: only an error needs them, and records take longest to import.
        from physics_crosscheck.harness.baseline.store import BaselineError
        from physics_crosscheck.harness.jobs.executor import ClusterError
        from physics_crosscheck.harness.modelfiles.folders import FolderError
        from physics_crosscheck.harness.records.read import ResultsError

        if not isinstance(error, (BaselineError, ClusterError, FolderError, ResultsError)):
            raise
        print(f"crosscheck: {error}", file=sys.stderr)
        code = FAIL if isinstance(error, BaselineError) else USAGE
    return code


def build_parser(commands: Mapping[str, Command], declared: Collection[str]) -> CommandParser:
    """Build the parser of the command line.

    Args:
        commands: all commands by name.
        declared: commands whose options are declared, which imports the possible values.
    """
    parser = CommandParser(
        prog="crosscheck",
        usage="crosscheck COMMAND [options]",
        description="\n".join([DESCRIPTION, *_command_lines(commands)]),
        epilog=EPILOG,
    )
    parser.add_argument(
        "--version",
        action="version",
        version=f"crosscheck {__version__}",
        help="Print the version and exit",
    )
    commands_parser = parser.add_subparsers(
        dest="command", metavar="COMMAND", help=argparse.SUPPRESS
    )
    for name, command in commands.items():
        subparser = commands_parser.add_parser(
            name, prog=f"crosscheck {name}", help=command.purpose
        )
        if name in declared:
            subparser.declare(command)
    return parser


def subparsers(parser: CommandParser) -> Mapping[str, CommandParser]:
    """Return the parsers of the commands, by name."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return action.choices
    return {}


def _command_lines(commands: Mapping[str, Command]) -> Iterator[str]:
    width = max(map(len, commands)) + 2
    for title, group in groupby(commands.items(), lambda item: item[1].group):
        yield from ("", f"{title}:")
        for name, command in group:
            yield f"  {name:<{width}}{command.purpose}"


def _apply_settings(parser: CommandParser, command: Command) -> None:
    """Make a project's settings the defaults of a command."""
    from .settings import SettingsError, apply

    try:
        apply(parser, command.settings)
    except SettingsError as error:
        parser.exit(USAGE, f"crosscheck: {error}\n")


if __name__ == "__main__":
    sys.exit(program())


def protect_streams() -> None:
    """Make the standard streams writable, however the shell left them.

    A closed stream becomes the null device. Otherwise the next opened file would get its number,
    and the output of libraries.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            os.set_inheritable(number, True)  # our own processes would find it closed again
    sys.stdout, sys.stderr = _tolerant(sys.stdout, 1), _tolerant(sys.stderr, 2)


def output_error() -> str:
    """Return why standard output is incomplete; empty if its reader just stopped reading."""
    stream = sys.stdout
    if not isinstance(stream, io.TextIOWrapper):
        return ""
    stream.flush()
    raw = getattr(stream.buffer, "raw", None)
    return raw.error if isinstance(raw, _DiscardingFile) else ""


def _tolerant(stream: TextIO | None, number: int) -> TextIO:
    """Return a stream like another that raises no error after its reader has closed."""
    wrapper = stream if isinstance(stream, io.TextIOWrapper) else None
    return cast(
        TextIO,
        io.TextIOWrapper(
            io.BufferedWriter(_DiscardingFile(number, "w", closefd=False)),
            encoding=wrapper.encoding if wrapper else "utf-8",
            errors="backslashreplace",
            line_buffering=wrapper.line_buffering if wrapper else number == 2,
        ),
    )


class _DiscardingFile(io.FileIO):
    """A file that discards data after it becomes unwritable."""

    _is_broken = False
    error = ""

    def write(self, data: object) -> int:
        """Write data until the reader is gone or the disk is full; discard it from then on."""
        view = memoryview(data)  # type: ignore[arg-type]  # any object with a buffer
        if self._is_broken:
            return view.nbytes
        try:
            return super().write(view)
        except OSError as error:
            if error.errno not in (errno.EPIPE, errno.ENOSPC, errno.EIO, errno.ESHUTDOWN):
                raise
            self._is_broken = True
            if error.errno != errno.EPIPE:
                self.error = error.strerror or str(error)
            return view.nbytes
