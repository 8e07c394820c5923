"""The commands of a document, and what it says that they print.

A block of ```sh is run line by line. Before it, `<!-- not run: all: why -->` or
`<!-- not run: `command`, `command`: why -->` excepts what is not; `# exits with 1` after a command
is the code that it must end with. What is quoted below a block, in a block without a language, must
have come out of the command before it in its section, numbers apart.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
_BLOCK = re.compile(
    r"(^## )|((?:<!-- not run: .*?-->\n)*)^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE
)
_EXCEPT = re.compile(r"<!-- not run: (.*?) -->", re.DOTALL)


@dataclass
class Command:
    """A line of shell, the code it ends with, and what is shown of its output."""

    text: str
    code: int
    shown: list[str] = field(default_factory=list)


def commands(text: str) -> tuple[list[Command], list[Command]]:
    """The commands of a document that are to be run, and those that are not, with the reason."""
    run, excepted = [], []
    last: Command | None = None
    for heading, marks, language, body in _BLOCK.findall(text):
        if heading:
            last = None
            continue
        if language == "" and last is not None:
            last.shown += body.splitlines()
        if language != "sh":
            continue
        whole, single, why = False, set(), ""
        for mark in _EXCEPT.findall(marks):
            what, why = mark.rsplit(": ", 1)
            assert why.strip(), "say why it is not run"
            whole = whole or what == "all"
            single |= set(re.findall(r"`([^`]+)`", what))
        pattern = re.compile(r"(.*?)(?:\s+# ?(.*))?$")
        lines = [m for line in body.splitlines() if line and (m := pattern.match(line))]
        texts = [match[1] for match in lines]
        last = None
        assert single <= set(texts), f"not in the block: {single - set(texts)}"
        for match in lines:
            code = re.search(r"exits with (\d)", match[2] or "")
            command = Command(match[1], int(code[1]) if code else 0)
            if whole or match[1] in single:
                excepted.append(command)
            else:
                run.append(command)
            if whole or match[1] not in single:
                last = command
    return run, excepted


def check_shown(command: Command, stdout: str) -> None:
    """Check that a command printed each line that a document quotes, wrapped at any width."""
    came = plain(stdout)
    for line in command.shown:
        assert plain(line) in came, f"{command.text} does not say {line!r}:\n{stdout}"


def plain(text: str) -> str:
    """A line without its numbers and spacing, which a machine and an engine's version set."""
    return re.sub(r"\s+", " ", re.sub(r"-?\d[\d.]*(?:e[+-]?\d+)?", "#", text)).strip()
