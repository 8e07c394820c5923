"""Command parsers: options in groups, help that fits narrow terminals, and "did you mean"."""

import argparse
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from .completion import Completer
from .exit_codes import USAGE

GROUPS = (
    "Arguments",
    "Selection",
    "Robot files",
    "Variants",
    "Comparison",
    "Checks",
    "Output",
    "Caching",
    "Baseline",
    "Limits",
    "Other options",
)
"""Titles of option groups, in the order that help shows them."""

ARGUMENTS, OTHERS = GROUPS[0], GROUPS[-1]

INTERRUPTED = {"128 + N": "Stopped by signal N; 130 means Ctrl-C."}
"""Exit code of every command that runs models."""

_HANGING = re.compile(r" *(?:\S+(?: \+ \S+)? {2,})?")
"""Pattern of a line's indentation and the term before two spaces that it explains."""


Option = Callable[[argparse.ArgumentParser], object]
"""Declares an argument, an option, or several that belong together."""


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command, apart from its name.

    Its function is named as `module:function`, and the module is imported when the command runs.
    So help and completion load neither sympy nor an engine.

    Attributes:
        group: title of its group in `crosscheck --help`.
        purpose: its line there.
        description: two lines: the command's purpose, and its output or requirements.
        examples: command lines, by purpose.
        exit_codes: meanings, by code.
        options: its arguments and options.
        function: takes the parsed options, and returns the exit code.
        settings: keys of `[tool.crosscheck]` that set defaults of its options.
    """

    group: str
    purpose: str
    description: str
    examples: Mapping[str, str]
    exit_codes: Mapping[str, str]
    options: tuple[Option, ...]
    function: str
    settings: tuple[str, ...] = ()


class CommandParser(argparse.ArgumentParser):
    """A parser whose options are in groups, and whose errors name the remedy."""

    about: Command

    def __init__(self, *, usage: str | None = None, **more: Any) -> None:
        super().__init__(usage=usage, formatter_class=_Formatter, add_help=False, **more)
        self._positionals.title, self._optionals.title = ARGUMENTS, OTHERS
        self._action_groups.remove(self._optionals)
        for title in GROUPS[1:-1]:
            self.add_argument_group(title)
        self._action_groups.append(self._optionals)
        self.add_argument("-h", "--help", action="help", help="Print this help and exit")

    def declare(self, about: Command) -> None:
        """Add a command's options, description, usage, examples and exit codes."""
        for add in about.options:
            add(self)
        self.about, self.description = about, about.description
        self.usage = usage(self)
        examples = [f"  # {what}\n  {line}" for what, line in about.examples.items()]
        width = max(map(len, about.exit_codes)) + 2
        codes = [f"  {code:<{width}}{meaning}" for code, meaning in about.exit_codes.items()]
        self.epilog = "\n".join(["Examples:", *examples, "", "Exit codes:", *codes])

    def error(self, message: str) -> NoReturn:
        """Print the error and how to get help, and exit with 2."""
        self.exit(USAGE, f"{self.prog}: {message}\nSee `{self.prog} --help`.\n")

    def reject_unknown(self, words: Iterable[str]) -> NoReturn:
        """Exit with the message about unknown words of a command line."""
        messages = []
        for word in words:
            name = word.partition("=")[0]
            if name.startswith("-"):
                options = [option for option in self._option_string_actions if option != "-h"]
                messages.append(f"unknown option {name}.{suggestion(name, options)}")
            else:
                messages.append(f"unexpected argument {word!r}.")
        self.error(" ".join(messages))

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Reject an invalid choice, and suggest a similar one."""
        choices = list(map(str, action.choices or ()))
        if not choices or value in choices:
            return
        if isinstance(action, argparse._SubParsersAction):
            self.error(_unknown_command(str(value), choices))
        choice_list = ", ".join(choices)
        hint = suggestion(str(value), choices)
        raise argparse.ArgumentError(
            action, f"unknown value {value!r}.{hint} Choose from {choice_list}."
        )


class _Formatter(argparse.HelpFormatter):
    """Help that keeps line breaks, with each line wrapped at its own indentation."""

    def __init__(self, prog: str, **more: Any) -> None:
        super().__init__(prog, max_help_position=26, **more)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(_wrapped(f"{indent}{line}", width) for line in text.splitlines())

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(text, width, **_WHOLE_WORDS)

    def add_usage(self, usage: str | None, *more: Any, **named: Any) -> None:
        """Add a usage line, broken between arguments."""
        if usage and usage is not argparse.SUPPRESS:
            lead = len(f"usage: {self._prog} ")
            usage_text = textwrap.fill(
                f"usage: {usage}", self._width, subsequent_indent=" " * lead, **_WHOLE_WORDS
            )
            usage = usage_text.removeprefix("usage: ").replace("\xa0", " ")
        super().add_usage(usage, *more, **named)


_WHOLE_WORDS: Mapping[str, Any] = {"break_long_words": False, "break_on_hyphens": False}


def _wrapped(line: str, width: int) -> str:
    hanging = _HANGING.match(line)
    lead = len(hanging[0]) if hanging else 0
    return textwrap.fill(line, width, subsequent_indent=" " * lead, **_WHOLE_WORDS)


def group(command: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """Return the option group of a title; create it if it is missing."""
    groups = (one for one in command._action_groups if one.title == title)
    return next(groups, None) or command.add_argument_group(title)


def option(title: str, *names: str, completer: Completer | None = None, **settings: Any) -> Option:
    """Return an option in the group of a title; `settings` are those of `add_argument`."""

    def add(command: argparse.ArgumentParser) -> None:
        action = group(command, title).add_argument(*names, **settings)
        if completer is not None:
            action.completer = completer  # type: ignore[attr-defined]

    return add


def switch(title: str, names: str, text: str, **settings: Any) -> Option:
    """Return an option without a value, by its names in one text and its help."""
    return option(title, *names.split(), action="store_true", help=text, **settings)


def usage(command: argparse.ArgumentParser) -> str:
    """Return the usage line: required options and positional arguments are spelled out."""
    parts = [command.prog, "[options]"]
    for action in command._actions:
        if action.required and action.option_strings:
            parts.append(f"{action.option_strings[0]} {metavar(action)}")
    for action in command._actions:
        if not action.option_strings and action.help is not argparse.SUPPRESS:
            parts.append(metavar(action))
    return " ".join(part.replace(" ", "\xa0") for part in parts)


def metavar(action: argparse.Action) -> str:
    """Return the values of an option or argument as help shows them; empty without values."""
    if action.nargs == 0:
        return ""
    name = action.metavar
    if isinstance(name, tuple):
        name = " ".join(name)
    if name is None:
        name = "|".join(map(str, action.choices)) if action.choices else action.dest.upper()
    if action.nargs == "*":
        return f"[{name} ...]"
    return f"{name} ..." if action.nargs == "+" else name


def suggestion(word: str, names: Iterable[str]) -> str:
    """Return ` Did you mean X?` for a name that resembles a known one; empty otherwise."""
    # Imported here: only a wrong name needs it.
    from difflib import get_close_matches

    close = get_close_matches(word, list(names), n=1)
    return f" Did you mean {close[0]}?" if close else ""


def _unknown_command(word: str, commands: Iterable[str]) -> str:
    # Imported here: only a wrong word needs them.
    import shlex
    from pathlib import Path

    commands = list(commands)
    message = f"unknown command {word!r}."
    if hint := suggestion(word, commands):
        return f"{message}{hint}"
    if Path(word).exists():
        return f"{message} To check this path, run `crosscheck run {shlex.quote(word)}`."
    return f"{message} Commands: {', '.join(commands)}."
