"""The commands of a document, and the output that it shows.

A block of ```sh is run line by line. A preceding `<!-- not run: all: why -->` or
`<!-- not run: `command`, `command`: why -->` excludes commands; `# exits with 1` after a command
states its exit code. A block without a language must be output of the last command before it in
the same section, except for numbers.
"""

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
    """A line of shell, its exit code, and the shown part of its output."""

    text: str
    code: int
    shown: list[str] = field(default_factory=list)


def commands(text: str) -> tuple[list[Command], list[Command]]:
    """Return the commands of a document to run, and the excluded ones."""
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
            names, why = mark.rsplit(": ", 1)
            assert why.strip(), "give the reason for not running it"
            whole = whole or names == "all"
            single |= set(re.findall(r"`([^`]+)`", names))
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
    """Check that a command printed each line that a document shows, wrapped at any width."""
    actual = plain(stdout)
    for line in command.shown:
        assert plain(line) in actual, f"{command.text} does not print {line!r}:\n{stdout}"


def plain(text: str) -> str:
    """Remove numbers and spacing, which depend on the machine and on engine versions."""
    return re.sub(r"\s+", " ", re.sub(r"-?\d[\d.]*(?:e[+-]?\d+)?", "#", text)).strip()
